#!/usr/bin/env python3
"""Markdown tables of the results of shear-warp-mip-benchmark, on standard output.

table.py results.json > results.md

Fails if a benchmark ended with an error, or lacks a counter.
"""

import json
import sys
from pathlib import Path

import pandas as pd

COMMON = {
    "read_limit_ms": "read limit, ms",
    "read_limit_ratio": "x read limit",
    "projection_ms": "projection, ms",
    "warp_ms": "warp, ms",
    "skipped_fraction": "skipped, %",
}
COLUMNS = {
    "mip": {
        "min_ms": "ms, minimum",
        "median_ms": "ms, median",
        **COMMON,
        "worst_view_ratio": "worst view, x read limit",
        "raycast_ratio": "x faster than ray casting",
        "plain_ratio": "x faster than plain shear-warp",
        "oversampling_ratio": "x the time with oversampling",
        "preparation_ms": "preparation, ms",
        "peak_mb": "peak memory, MB",
    },
    "cine": {"frame_ms": "ms, a frame", **COMMON, "single_ratio": "x faster than single views"},
}
VARIANTS = {
    f"{name}_ratio": f"{name}, x the time"
    for name in "first first_x minimum absolute depth slab box mask small_mask local fading exact".split()
}
NAME = (
    r"(?:(?P<family>cine)/(?P<axis>\w+)/)?mip/(?P<data>[^/]+)/(?P<size>\w+)/(?P<pixel_type>\w+)/(?P<set>\w+)"
    r"/threads:(?P<threads>\d+)/(?P<mode>\w+)"
)
TEXTS = {"data": "data", "set": "instruction set", "threads": "threads", "mode": "reduced resampling"}


def format_number(value: float) -> str:
    if pd.isna(value):
        return ""
    return f"{value:.0f}" if value >= 100 or value == 0 else f"{value:#.3g}"


def find_faults(results: pd.DataFrame, counters: list[str]) -> list[str]:
    """What is wrong with the benchmarks that ran to their end."""
    is_missing = ~(results[counters] > 0)
    is_missing["skipped_fraction"] = ~(results["skipped_fraction"] >= 0)
    is_auto = results["mode"] == "auto"
    only = {
        **dict.fromkeys(["raycast_ratio", "plain_ratio"], results["threads"] == "1"),
        **dict.fromkeys(VARIANTS, is_auto),
        "oversampling_ratio": is_auto & (results["set"] != "portable"),
        "peak_mb": Path("/proc/self/clear_refs").exists(),
    }
    for counter in only.keys() & set(counters):
        is_missing[counter] &= only[counter]
    faults = [f"{results.name[row]}: no {counter}" for (row, counter), bad in is_missing.stack().items() if bad]
    is_odd = results["skipped_fraction"] > (results["mode"] != "off")
    is_odd |= results.get("min_ms", 0) > results.get("median_ms", 0)
    return faults + [
        f"{name}: more is skipped than can be, or the minimum is not the least" for name in results.name[is_odd]
    ]


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    whole = json.loads(Path(sys.argv[1]).read_text())
    results = pd.DataFrame([each for each in whole["benchmarks"] if each["run_type"] == "iteration"])
    if results.empty:
        sys.exit("error: no benchmark has run")
    results = results.assign(**results["name"].str.extract(NAME))
    results["data"] += (", axis " + results["axis"]).fillna("")
    columns = COLUMNS[results["family"].fillna("mip")[0]]
    if not set(VARIANTS).isdisjoint(results):
        columns = columns | VARIANTS
    results = results.reindex(columns=[*dict.fromkeys([*results, *columns, "error_message"])])
    is_done = results["error_message"].isna()
    failed = results[~is_done]
    faults = [*(failed["name"] + ": " + failed["error_message"]), *find_faults(results[is_done], list(columns))]

    context = whole["context"]
    caches = ", ".join(f"L{cache['level']} {cache['type']} {cache['size'] // 1024} KiB" for cache in context["caches"])
    print("# Results of shear-warp-mip-benchmark\n")
    print(
        f"{context['date']}, {context.get('processor', 'unknown processor')}, {context['num_cpus']} processors at "
        f"{context['mhz_per_cpu']} MHz, {caches}; ITK {context.get('itk')}, {context.get('compiler')}"
    )
    results["skipped_fraction"] *= 100
    shown = results.assign(**results[list(columns)].apply(lambda column: column.map(format_number)))
    errors = "error: " + failed["error_message"].astype(str).str.replace("|", "/", regex=False).str.replace("\n", " ")
    shown.loc[~is_done, "read_limit_ms"] = errors
    for (size, pixel_type), rows in shown.groupby(["size", "pixel_type"], sort=False):
        table = rows[[*TEXTS, *columns]].rename(columns=TEXTS | columns)
        align = ["left"] * len(TEXTS) + ["right"] * len(columns)
        print(f"\n## {size}, {pixel_type}\n")
        print(table.to_markdown(index=False, disable_numparse=True, colalign=align))
    if faults:
        sys.exit("error: " + "\nerror: ".join(faults))


if __name__ == "__main__":
    main()

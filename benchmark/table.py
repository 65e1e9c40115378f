#!/usr/bin/env python3
"""Markdown tables of the results of shear-warp-mip-benchmark, on standard output.

table.py results.json > results.md

Fails if a benchmark ended with an error, or lacks a counter.
"""

import json
import math
import sys
from pathlib import Path

COUNTERS = (
    "read_limit_ratio worst_view_ratio read_limit_ms min_ms median_ms projection_ms warp_ms preparation_ms "
    "skipped_fraction"
).split()
COMPARISONS = ["raycast_ratio", "plain_ratio"]  # with one thread
OVERSAMPLING = ["oversampling_ratio"]  # in mode auto, unless portable
ZERO_ALLOWED = ["skipped_fraction"]


def parse_name(name: str) -> dict[str, str]:
    """The parts of mip/mra/512x512x512/uint16/avx2/threads:2/auto and Google Benchmark's own suffixes."""
    _, kind, size, pixel_type, instruction_set, threads, mode, *_ = name.split("/")
    return {
        "kind": kind,
        "size": size,
        "pixel type": pixel_type,
        "instruction set": instruction_set,
        "threads": threads.removeprefix("threads:"),
        "mode": mode,
    }


def find_faults(benchmark: dict, has_peak: bool) -> list[str]:
    """What is wrong with a benchmark's result."""
    if benchmark.get("error_occurred"):
        return [benchmark["error_message"]]
    parts = parse_name(benchmark["name"])
    needed = COUNTERS + (COMPARISONS if parts["threads"] == "1" else []) + (["peak_mb"] if has_peak else [])
    if parts["mode"] == "auto" and parts["instruction set"] != "portable":
        needed += OVERSAMPLING
    faults = []
    for counter in needed:
        value = benchmark.get(counter, math.nan)
        if not (math.isfinite(value) and (value > 0.0 or (counter in ZERO_ALLOWED and value == 0.0))):
            faults.append(f"{counter} is {value}")
    if not faults:
        if benchmark["skipped_fraction"] > (0.0 if parts["mode"] == "off" else 1.0):
            faults.append(f"skipped_fraction is {benchmark['skipped_fraction']}")
        if benchmark["min_ms"] > benchmark["median_ms"]:
            faults.append("min_ms is above median_ms")
    return faults


def format_row(benchmark: dict) -> list[str]:
    """The cells of a benchmark's line."""

    def cell(counter: str, scale: float = 1.0) -> str:
        if counter not in benchmark:
            return ""
        value = scale * benchmark[counter]
        return f"{value:.0f}" if value >= 100.0 or value == 0.0 else f"{value:#.3g}"

    parts = parse_name(benchmark["name"])
    if benchmark.get("error_occurred"):
        values = ["error: " + benchmark["error_message"].replace("|", "/").replace("\n", " ")] + [""] * 11
    else:
        values = [
            cell("min_ms"),
            cell("median_ms"),
            cell("read_limit_ms"),
            cell("read_limit_ratio"),
            cell("worst_view_ratio"),
            cell("raycast_ratio"),
            cell("plain_ratio"),
            cell("oversampling_ratio"),
            cell("skipped_fraction", 100.0),
            cell("preparation_ms"),
            cell("peak_mb"),
        ]
    return [parts["kind"], parts["instruction set"], parts["threads"], parts["mode"], *values]


HEADINGS = [
    "data",
    "instruction set",
    "threads",
    "reduced resampling",
    "ms, minimum",
    "ms, median",
    "read limit, ms",
    "x read limit",
    "worst view, x read limit",
    "x faster than ray casting",
    "x faster than plain shear-warp",
    "x the time with oversampling",
    "skipped, %",
    "preparation, ms",
    "peak memory, MB",
]


def format_line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def format_tables(results: dict, benchmarks: list[dict]) -> str:
    """The machine, and a table for each size and pixel type."""
    context = results["context"]
    caches = ", ".join(f"L{cache['level']} {cache['type']} {cache['size'] // 1024} KiB" for cache in context["caches"])
    lines = [
        f"{context['date']}, {context.get('processor', 'unknown processor')}, {context['num_cpus']} processors at "
        f"{context['mhz_per_cpu']} MHz, {caches}; ITK {context.get('itk')}, {context.get('compiler')}",
    ]
    groups: dict[tuple[str, str], list[dict]] = {}
    for benchmark in benchmarks:
        parts = parse_name(benchmark["name"])
        groups.setdefault((parts["size"], parts["pixel type"]), []).append(benchmark)
    for (size, pixel_type), members in groups.items():
        lines += ["", f"## {size}, {pixel_type}", "", format_line(HEADINGS)]
        lines.append(format_line(["---"] * 4 + ["---:"] * (len(HEADINGS) - 4)))
        lines += [format_line(format_row(member)) for member in members]
    return "\n".join(lines)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    results = json.loads(Path(sys.argv[1]).read_text())
    benchmarks = [result for result in results["benchmarks"] if result.get("run_type") == "iteration"]
    if not benchmarks:
        sys.exit("error: no benchmark has run")
    print("# Results of shear-warp-mip-benchmark\n")
    print(format_tables(results, benchmarks))
    faults = [
        f"{benchmark['name']}: {fault}"
        for benchmark in benchmarks
        for fault in find_faults(benchmark, has_peak=Path("/proc/self/clear_refs").exists())
    ]
    if faults:
        sys.exit("error: " + "\nerror: ".join(faults))


if __name__ == "__main__":
    main()

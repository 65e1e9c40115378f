#!/usr/bin/env python3
"""Markdown tables of the results of shear-warp-mip-benchmark, on standard output.

table.py results.json > results.md

Fails if a benchmark ended with an error, or lacks a counter.
"""

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


class Column(NamedTuple):
    heading: str
    counter: str
    scale: float = 1.0
    is_needed: Callable[[dict[str, str]], bool] = lambda parts: True


def has_one_thread(parts: dict[str, str]) -> bool:
    return parts["threads"] == "1"


def is_auto(parts: dict[str, str]) -> bool:
    return parts["mode"] == "auto"


def has_oversampling(parts: dict[str, str]) -> bool:
    return is_auto(parts) and parts["instruction set"] != "portable"


COMMON = [
    Column("read limit, ms", "read_limit_ms"),
    Column("x read limit", "read_limit_ratio"),
    Column("projection, ms", "projection_ms"),
    Column("warp, ms", "warp_ms"),
    Column("skipped, %", "skipped_fraction", 100.0),
]
PEAK = [Column("peak memory, MB", "peak_mb")] if Path("/proc/self/clear_refs").exists() else []
COLUMNS = {
    "mip": [
        Column("ms, minimum", "min_ms"),
        Column("ms, median", "median_ms"),
        *COMMON,
        Column("worst view, x read limit", "worst_view_ratio"),
        Column("x faster than ray casting", "raycast_ratio", 1.0, has_one_thread),
        Column("x faster than plain shear-warp", "plain_ratio", 1.0, has_one_thread),
        Column("x the time with oversampling", "oversampling_ratio", 1.0, has_oversampling),
        Column("preparation, ms", "preparation_ms"),
        *PEAK,
    ],
    "cine": [
        Column("ms, a frame", "frame_ms"),
        *COMMON,
        Column("x faster than single views", "single_ratio"),
    ],
}
VARIANTS = [
    Column(f"{name}, x the time", f"{name}_ratio", 1.0, is_auto)
    for name in "first first_x minimum absolute depth slab box mask small_mask local fading exact".split()
]
ZERO_ALLOWED = ["skipped_fraction"]


def parse_name(name: str) -> dict[str, str]:
    """The parts of mip/mra/512x512x512/uint16/avx2/threads:2/auto/..., or of cine/oblique/ and the same."""
    before, after = name.split("mip/")
    family, axis = before.split("/")[:2] if before else ("mip", "")
    kind, size, pixel_type, instruction_set, threads, mode, *_ = after.split("/")
    return {
        "family": family,
        "kind": f"{kind}, axis {axis}" if axis else kind,
        "size": size,
        "pixel type": pixel_type,
        "instruction set": instruction_set,
        "threads": threads.removeprefix("threads:"),
        "mode": mode,
    }


def find_columns(benchmarks: list[dict]) -> list[Column]:
    """The columns of benchmarks of one family; those of the variants if one of them was measured."""
    columns = COLUMNS[parse_name(benchmarks[0]["name"])["family"]]
    has_variants = any(column.counter in benchmark for benchmark in benchmarks for column in VARIANTS)
    return columns + (VARIANTS if has_variants else [])


def find_faults(benchmark: dict, columns: list[Column]) -> list[str]:
    """What is wrong with a benchmark's result."""
    if benchmark.get("error_occurred"):
        return [benchmark["error_message"]]
    parts = parse_name(benchmark["name"])
    faults = []
    for column in columns:
        value = benchmark.get(column.counter, math.nan)
        is_valid = math.isfinite(value) and (value > 0.0 or (column.counter in ZERO_ALLOWED and value == 0.0))
        if column.is_needed(parts) and not is_valid:
            faults.append(f"{column.counter} is {value}")
    if not faults:
        if benchmark["skipped_fraction"] > (0.0 if parts["mode"] == "off" else 1.0):
            faults.append(f"skipped_fraction is {benchmark['skipped_fraction']}")
        if "min_ms" in benchmark and benchmark["min_ms"] > benchmark["median_ms"]:
            faults.append("min_ms is above median_ms")
    return faults


def format_row(benchmark: dict, columns: list[Column]) -> list[str]:
    """The cells of a benchmark's line."""

    def cell(column: Column) -> str:
        if column.counter not in benchmark:
            return ""
        value = column.scale * benchmark[column.counter]
        return f"{value:.0f}" if value >= 100.0 or value == 0.0 else f"{value:#.3g}"

    parts = parse_name(benchmark["name"])
    if benchmark.get("error_occurred"):
        message = benchmark["error_message"].replace("|", "/").replace("\n", " ")
        values = ["error: " + message] + [""] * (len(columns) - 1)
    else:
        values = [cell(column) for column in columns]
    return [parts["kind"], parts["instruction set"], parts["threads"], parts["mode"], *values]


HEADINGS = ["data", "instruction set", "threads", "reduced resampling"]


def format_line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def format_tables(results: dict, benchmarks: list[dict], columns: list[Column]) -> str:
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
        lines += ["", f"## {size}, {pixel_type}", "", format_line(HEADINGS + [column.heading for column in columns])]
        lines.append(format_line(["---"] * len(HEADINGS) + ["---:"] * len(columns)))
        lines += [format_line(format_row(member, columns)) for member in members]
    return "\n".join(lines)


def main() -> None:
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    results = json.loads(Path(sys.argv[1]).read_text())
    benchmarks = [result for result in results["benchmarks"] if result.get("run_type") == "iteration"]
    if not benchmarks:
        sys.exit("error: no benchmark has run")
    print("# Results of shear-warp-mip-benchmark\n")
    columns = find_columns(benchmarks)
    print(format_tables(results, benchmarks, columns))
    faults = [f"{benchmark['name']}: {fault}" for benchmark in benchmarks for fault in find_faults(benchmark, columns)]
    if faults:
        sys.exit("error: " + "\nerror: ".join(faults))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The time from `python` to the first picture of a small file, and what is loaded for it.

    start.py                          # median of 5, of the package, of ITK and NumPy alone, and of the program
    start.py --program shear-warp-mip

Each run is a process of its own. Run it on a quiet machine, and without packages that ITK imports when they are there,
such as xarray and dask.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MIP = "from itk_shearwarpmip import mip; mip({!r})"
MODULES = (
    MIP
    + "; import sys; print(*sorted(m[4:-6] for m in sys.modules if m[:6] in ('itk.IT', 'itk.Sh') and m[-6:] == 'Python'))"
)


def measure(command: list[str], count: int) -> float:
    seconds = []
    for _ in range(count):
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=5, help="runs of each; the median counts")
    parser.add_argument("--program", default=os.environ.get("SHEARWARPMIP_PROGRAM", "shear-warp-mip"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        volume = str(Path(folder, "volume.nrrd"))
        subprocess.run([options.program, "--write-phantom", volume, "--phantom-size", "64", "60", "40"], check=True)
        python = [sys.executable, "-c"]
        print("| | s |\n|---|---|")
        for name, command in (
            ("first picture of a file in Python", [*python, MIP.format(volume)]),
            ("import of NumPy and ITK", [*python, "import numpy, itk"]),
            ("picture by the program", [options.program, volume, str(Path(folder, "mip.png"))]),
        ):
            print(f"| {name} | {measure(command, options.count):.2f} |", flush=True)
        print(subprocess.run([*python, MODULES.format(volume)], check=True, capture_output=True, text=True).stdout)


if __name__ == "__main__":
    main()

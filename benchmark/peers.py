#!/usr/bin/env python3
"""The same image and the same views through other packages' maximum intensity projections: time and accuracy.

Every peer (a file of benchmark/peer/) makes the same picture: square, as wide as the larger of the image's x and y,
centered on the image's center, at the image's smallest spacing (1 mm for the made image). Times measure the work
for a new view, without imports, compiling and handing the image to the library. Each peer has a process of its own: one
that crashes, hangs or is not installed is a line of the table and no more.

The error is the difference from the exact picture: the maximum of the trilinear interpolant along each pixel's ray, by
our filter with `Exact`. Pixels whose exact maximum lies less than a voxel from the image's rim are left out, because
packages end their rays differently there. In percent of the data's range:

  magnitude, p99, largest   mean, 99th percentile and maximum of the error's magnitude
  mean                      mean of the error with its sign
  bound                     0.85 of the mean magnitude of the difference from the exact picture moved by a pixel to the
                            left, right, top or bottom, whichever is least; the picture is wrong, and the exit status 1,
                            if `magnitude` is more: another view or place
  above                     percent of the pixels that are above the exact value by more than a grey level and 1/8192 of
                            the range: none for whoever interpolates linearly on rays and does no more

    pip install -r benchmark/peers-requirements.txt dist/itk_shearwarpmip-*.whl
    peers.py --output results
    peers.py --image head.nrrd --views y30 y90+x10 --peers ours itk --pictures --output results
"""

from __future__ import annotations

import argparse
import importlib
import importlib.metadata
import math
import multiprocessing
import os
import platform
import re
import statistics
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
import pandas as pd
import psutil
from peer.volume import Peer, View, Volume, make_head, read_image

matplotlib.use("Agg")
import matplotlib.pyplot as plt

BUDGET = 10.0  # seconds spent on a view, after which no repetition begins
TIMEOUT = 300.0  # seconds of silence, after which a peer is stopped
BUSY = 0.3  # processors that other programs use when times are not worth much
BOUND = 0.85  # measured: right pictures up to 0.75 (noise in a view along the grid: 0.97), wrong ones from 0.98
CROP = 24  # pixels along each side of the magnified vessel
THREADS = (  # what the peers' processes inherit, for libraries that have no call for it
    "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS LP_NUM_THREADS NUMBA_NUM_THREADS OMP_NUM_THREADS OPENBLAS_NUM_THREADS"
    " VTK_SMP_MAX_THREADS"
).split()

PANELS: Any = {"squeeze": False, "layout": "constrained", "subplot_kw": {"frame_on": False, "xticks": [], "yticks": []}}

Record = dict[str, Any]
Exact = tuple[np.ndarray, np.ndarray]  # the picture, and which of its pixels count


class Entry(NamedTuple):
    """A peer: its title, the package of PyPI, the module of benchmark/peer/ and options of its class."""

    title: str
    package: str
    module: str
    options: dict[str, Any]


PEERS = {
    "ours": Entry("ShearWarpMIP", "itk-shearwarpmip", "ours", {}),
    "ours-2": Entry("ShearWarpMIP, Oversampling 2", "itk-shearwarpmip", "ours", {"oversampling": 2}),
    "ours-exact": Entry("ShearWarpMIP, Exact", "itk-shearwarpmip", "ours", {"exact": True}),
    "rtk": Entry("RTK", "itk-rtk", "rtk", {}),
    "numba": Entry("Numba, ray casting", "numba", "numba_rays", {}),
    "vtk-rays": Entry("VTK, ray casting", "vtk", "vtk_rays", {}),
    "vtk-slab": Entry("VTK, slab reslice", "vtk", "vtk_slab", {}),
    "itk": Entry("ITK, resampling", "itk", "itk_resample", {}),
    "scipy": Entry("SciPy, affine_transform", "scipy", "scipy_rotate", {}),
}


def clock(peer: Peer, view: View) -> tuple[float, float]:
    """Seconds by the clock and of all processors that one projection takes."""
    processor, start = time.process_time(), time.perf_counter()
    peer.project(view)
    return time.perf_counter() - start, time.process_time() - processor


def measure(peer: Peer, view: View, repetitions: int) -> Record:
    """The first projection of a view, then others until `repetitions` or BUDGET are spent; times in ms.

    A peer whose first projection alone spends the budget is timed by that one. `cores` is the peer's processor time by
    time, `others` the same ratio of all other programs meanwhile, which is not known for what is over at once.
    """
    psutil.cpu_percent()
    own, start = time.process_time(), time.perf_counter()
    first = clock(peer, view)
    runs: list[tuple[float, float]] = []
    while len(runs) < repetitions and first[0] + sum(run[0] for run in runs) < BUDGET:
        runs.append(clock(peer, view))
    own, elapsed = time.process_time() - own, time.perf_counter() - start
    machine = psutil.cpu_percent() / 100 * psutil.cpu_count()
    seconds, processor = zip(*(runs or [first]))
    return {
        "first_ms": 1000 * first[0],
        "min_ms": 1000 * min(seconds),
        "median_ms": 1000 * statistics.median(seconds),
        "runs": len(seconds),
        "cores": sum(processor) / sum(seconds),
        "others": max(0.0, machine - own / elapsed) if elapsed > 0.3 else math.nan,  # the system counts in 10 ms
        "picture": peer.picture().astype(float),
    }


def project(key: str, volume: Volume, view: View, arguments: argparse.Namespace) -> Record:
    """The record of a view, in the peer's process."""
    entry = PEERS[key]
    version = importlib.metadata.version(entry.package)
    peer = importlib.import_module(f"peer.{entry.module}").Projector(volume, arguments.threads, **entry.options)
    record = measure(peer, view, arguments.repetitions)
    return record | {"version": f"{version} {peer.note}".strip()}


def run(key: str, volume: Volume, arguments: argparse.Namespace) -> list[Record]:
    """A record for each view by a peer in a process of its own, up to the first problem."""
    print(f"{volume.name}: {PEERS[key].title} ...", file=sys.stderr, flush=True)
    records: list[Record] = []
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        try:
            for view in arguments.views:
                record = process.submit(project, key, volume, view, arguments).result(TIMEOUT)
                records.append({"image": volume.name, "view": view.name, "peer": key} | record)
        except (Exception, SystemExit) as error:  # of any library, broken in any way; or it crashed or hangs
            is_silent = isinstance(error, TimeoutError)
            problem = f"no answer for {TIMEOUT:g} s" if is_silent else f"{type(error).__name__}: {error}"
            problem = " ".join(problem.split())[:200].rstrip(": ")
            records.append({"image": volume.name, "view": None, "peer": key, "problem": problem})
            for child in multiprocessing.active_children():
                child.kill()
    return records


def compare(record: Record, exact: Exact, volume: Volume) -> None:
    """Adds how far the picture is from the exact one, in percent of the data's range."""
    percent = 100 / volume.range
    grey = percent if volume.voxels.dtype.kind in "iu" else 0.0

    def error(pixels: int, axis: int) -> np.ndarray:
        """From the exact picture moved by `pixels`."""
        expected, inside = (np.roll(array, pixels, axis) for array in exact)
        return percent * (record["picture"] - expected)[inside]

    found = error(0, 0)
    moved = min(np.abs(error(pixels, axis)).mean() for pixels in (-1, 1) for axis in (0, 1))
    record |= {
        "magnitude": np.abs(found).mean(),
        "p99": np.percentile(np.abs(found), 99),
        "largest": np.abs(found).max(),
        "mean": found.mean(),
        "above": 100 * (found > grey + 100 / 8192).mean(),
        "bound": BOUND * moved,
    }
    record["picture_is"] = "right" if record["magnitude"] <= record["bound"] else "WRONG"


def project_image(volume: Volume, arguments: argparse.Namespace) -> tuple[list[Record], dict[str, Exact]]:
    """Every peer's records for an image, compared; the exact pictures of the views."""
    try:
        from peer.ours import exact_picture

        exact = {view.name: exact_picture(volume, view, arguments.threads) for view in arguments.views}
    except (ImportError, AttributeError) as error:
        sys.exit(f"error: there are no exact pictures without itk-shearwarpmip: {error}")
    records = [r for key in PEERS if key in arguments.peers for r in run(key, volume, arguments)]
    done = [record for record in records if record["view"]]
    ours = {r["view"]: r["median_ms"] for r in done if r["peer"] == "ours"}
    for record in done:
        record["x_ours"] = record["median_ms"] / ours.get(record["view"], math.nan)
        compare(record, exact[record["view"]], volume)
    return records, exact


def markdown(table: pd.DataFrame, head: str) -> str:
    """Times and errors of each image, a row for each peer; errors are over all views."""
    parts = [head]
    for image, rows in table.groupby("image", sort=False):
        names = rows.groupby("peer", sort=False)[[c for c in ("version", "problem") if c in rows]].first()
        names.insert(0, image, [PEERS[key].title for key in names.index])
        done = rows.dropna(subset="view")
        if done.empty:
            parts.append(names.to_markdown(index=False))
            continue
        ratios = done["x_ours"].map(" ({:.3g})".format, na_action="ignore").fillna("")
        cells = done["median_ms"].map("{:.3g}".format) + ratios
        times = done.assign(cells=cells).pivot(index="peer", columns="view", values="cells")[done["view"].unique()]
        how = dict.fromkeys(["magnitude", "p99", "largest", "mean", "above"], "mean") | {"largest": "max"}
        errors = done.groupby("peer").agg(how).map("{:.3f}".format)
        texts = "Median times of a view in ms (times ours):", "Errors, %, mean over the views; the largest of all:"
        for title, numbers in zip(texts, (times, errors)):
            align = ["left"] * names.shape[1] + ["right"] * numbers.shape[1]
            whole = names.join(numbers).fillna("")
            parts += [title, whole.to_markdown(index=False, disable_numparse=True, colalign=align)]
    return "\n\n".join(parts) + "\n"


def draw_pictures(file: Path, records: list[Record], volume: Volume) -> None:
    """The pictures side by side: a row for each view, a column for each peer."""
    views, keys = (list(dict.fromkeys(r[name] for r in records)) for name in ("view", "peer"))
    size = (2.4 * len(keys), 2.6 * len(views))
    figure, panels = plt.subplots(len(views), len(keys), figsize=size, **PANELS)
    high = max(np.percentile(r["picture"], 99.8) for r in records)
    for r in records:
        panel = panels[views.index(r["view"]), keys.index(r["peer"])]
        panel.imshow(r["picture"], cmap="gray", vmin=volume.voxels.min(), vmax=high)
        panel.set_title(f"{PEERS[r['peer']].title}, {r['view']}", fontsize=8)
    figure.savefig(file, dpi=130)


def find_vessel(records: list[Record], exact: dict[str, Exact]) -> tuple[str, slice, slice]:
    """The view and window where ray casting with a step of a voxel errs most in the mean: at thin vessels."""
    done = {record["peer"] for record in records}
    step = next(key for key in ("numba", "itk", "vtk-slab", "scipy", *PEERS) if key in done)
    found = []
    for r in records:
        if r["peer"] == step:
            expected, inside = exact[r["view"]]
            error = np.abs(r["picture"] - expected) * inside
            sums = np.lib.stride_tricks.sliding_window_view(error, [min(CROP, *error.shape)] * 2).sum(axis=(2, 3))
            found.append((sums.max(), r["view"], *np.unravel_index(sums.argmax(), sums.shape)))
    _, view, row, column = max(found)
    return view, slice(row, row + CROP), slice(column, column + CROP)


def draw_vessel(file: Path, records: list[Record], exact: dict[str, Exact], volume: Volume) -> None:
    """The same small vessel by each peer, magnified without interpolation, and its error beneath."""
    view, *window = find_vessel(records, exact)
    expected, inside = (array[*window] for array in exact[view])
    percent = 100 / volume.range
    chosen = [r for r in records if r["view"] == view and r["peer"] != "ours-exact"]
    crops = {"Exact maximum": expected, **{PEERS[r["peer"]].title: r["picture"][*window] for r in chosen}}
    limit = percent * np.percentile([np.abs(crop - expected) for crop in crops.values()], 99.5)
    columns = math.ceil(len(crops) / 2)
    figure, panels = plt.subplots(4, columns, figsize=(1.9 * columns, 8), **PANELS)
    for n, (title, crop) in enumerate(crops.items()):
        top, bottom = panels[2 * (n // columns) :, n % columns][:2]
        top.imshow(crop, cmap="gray", vmin=expected.min(), vmax=expected.max(), interpolation="none")
        top.set_title(title, fontsize=8)
        if n > 0:
            error = np.where(inside, percent * (crop - expected), np.nan)
            drawn = bottom.imshow(error, cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="none")
    if len(crops) > 1:
        scale = panels[1, 0].inset_axes([0.05, 0.45, 0.9, 0.08])
        figure.colorbar(drawn, cax=scale, orientation="horizontal", label="error, % of the range")
    figure.savefig(file, dpi=100)


def parse_size(text: str) -> tuple[int, ...]:
    """Voxels along x, y and z."""
    x, y, z = map(int, text.split("x"))
    if min(x, y, z) < 16:
        raise argparse.ArgumentTypeError("at least 16 voxels along each axis")
    return x, y, z


def parse_count(text: str) -> int:
    """A number from 1 on."""
    if int(text) < 1:
        raise argparse.ArgumentTypeError("at least 1")
    return int(text)


def parse_arguments() -> argparse.Namespace:
    """The command line; `sources` are the file or the sizes of made images."""
    epilog = "peers:\n" + "\n".join(f"  {key:<12} {peer.title} ({peer.package})" for key, peer in PEERS.items())
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form, epilog=epilog)
    add, views = parser.add_argument, [View.parse(text) for text in ("y30", "x40", "y60+x20")]
    add("--size", type=parse_size, nargs="+", metavar="NXxNYxNZ", help="of made images [256x256x64 512x512x512]")
    add("--image", type=Path, metavar="FILE", help="a 3D image that ITK reads, instead of made ones")
    text = "rotations by degrees about the axes, of which + makes products [y30 x40 y60+x20]"
    add("--views", type=View.parse, nargs="+", default=views, metavar="VIEW", help=text)
    add("--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help="which [all]")
    add("--repetitions", type=parse_count, default=10, metavar="N", help=f"of each view [10]; up to {BUDGET:g} s")
    add("--threads", type=parse_count, default=2, metavar="N", help="of every peer [2]")
    add("--output", type=Path, metavar="DIR", help="for peers.csv and peers.md [none]")
    text = "pictures-IMAGE.png too, and vessel-IMAGE.png: where ray casting errs most, magnified"
    add("--pictures", action="store_true", help=text)
    add("--smoke", action="store_true", help="a quick try: small image, few repetitions: the times are void")
    arguments = parser.parse_args()
    if arguments.pictures and not arguments.output:
        parser.error("--pictures needs --output")
    if arguments.image and arguments.size:
        parser.error("--image and --size exclude each other")
    if arguments.smoke:
        arguments.size, arguments.repetitions = [(64, 64, 32)], min(2, arguments.repetitions)
    arguments.sources = [arguments.image] if arguments.image else arguments.size or [(256, 256, 64), (512, 512, 512)]
    arguments.views = list({view.name: view for view in arguments.views}.values())
    return arguments


def main() -> None:
    """Runs everything; the exit status tells whether the pictures are right."""
    arguments = parse_arguments()
    for name in THREADS:
        os.environ[name] = str(arguments.threads)
    output: Path | None = arguments.output
    if output:
        output.mkdir(parents=True, exist_ok=True)
    everything: list[Record] = []
    for source in arguments.sources:
        try:
            volume = read_image(source) if arguments.image else make_head(source)
        except (ImportError, ValueError) as error:
            sys.exit(f"error: {error}")
        records, exact = project_image(volume, arguments)
        everything += records
        done = [record for record in records if record["view"]]
        if arguments.pictures and done:
            name = re.sub(r"[^\w.-]", "_", volume.name)
            draw_pictures(output / f"pictures-{name}.png", done, volume)
            draw_vessel(output / f"vessel-{name}.png", done, exact, volume)

    table = pd.DataFrame(everything).drop(columns="picture", errors="ignore")
    if "runs" in table:
        table["runs"] = table["runs"].astype("Int64")
    done = table.dropna(subset="view")
    shown = table.drop(columns="version", errors="ignore").fillna({"view": ""})
    print(shown.to_string(index=False, na_rep="", float_format="{:.3f}".format))
    system = f"{platform.system()}, Python {platform.python_version()}"
    head = f"{platform.machine()}, {os.cpu_count()} processors, {system}; {arguments.threads} threads."
    if "others" in done and done["others"].max() > BUSY:
        warning = f"Other programs used up to {done['others'].max():.1f} processors meanwhile: the times are void."
        print(f"warning: {warning}", file=sys.stderr)
        head += f" {warning}"
    if output:
        table.to_csv(output / "peers.csv", index=False)
        (output / "peers.md").write_text(markdown(table, head))
    if done.empty:
        sys.exit("error: no peer could be measured")
    if done["picture_is"].eq("WRONG").any():
        sys.exit("error: a picture is wrong")


if __name__ == "__main__":
    main()

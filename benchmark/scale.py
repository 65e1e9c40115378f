#!/usr/bin/env python3
"""itk_shearwarpmip.mip against the size of the volume and the number of workers: time, memory, bytes moved.

Volumes are uncompressed OME-Zarr of uint16: the made angiogram of peers.py, which repeats after 512 voxels. Each case
(size of the volume, size of the blocks that tasks read, number of workers) has a cluster of its own, whose workers are
processes with one thread. One view goes before those that are timed, so that packages are imported and the files lie in
the system's cache, where memory is enough. Every picture is compared with that of the filter for the whole volume in
memory, up to the size that --whole gives; that filter is timed too.

    pip install "$(echo dist/itk_shearwarpmip-*.whl)[distributed]" matplotlib pandas psutil tabulate
    scale.py --output results
    scale.py --sizes 512 1024 2150 --blocks 256 --folder /data --output results

Writes scale.json, scale.md and scale.svg. Nothing is judged by its time.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import re
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dask
import itk
import matplotlib
import numpy as np
import pandas as pd
import zarr
from distributed import Client, LocalCluster
from itk_shearwarpmip import mip, open_volume
from peer.volume import angiogram

matplotlib.use("Agg")
import matplotlib.pyplot as plt

VOXEL = 2  # bytes
PERIOD = 512  # voxels after which larger volumes repeat, a multiple of the chunks
SPACING = 0.4  # micrometres
CASES = {
    "edge": "edge",
    "megabytes": "volume, MB",
    "block": "block",
    "workers": "workers",
    "parts": "parts",
    "tasks": "tasks",
    "seconds": "a view, s",
    "others": "others",
    "megabytes_moved": "moved, MB",
    "peak_megabytes": "peak of a worker, MB",
    "ready_megabytes": "ready, MB",
}
WHOLE = {
    "edge": "edge",
    "threads": "threads",
    "first_view_seconds": "first view, s",
    "view_seconds": "other views, s",
    "reading_seconds": "reading the file before, s",
}


def write_volume(path: Path, edge: int, chunk: int) -> None:
    """An OME-Zarr 0.4 with one level, not compressed."""
    group = zarr.open_group(path, mode="w", zarr_format=2)
    array = group.create_array(
        "0",
        shape=(edge,) * 3,
        chunks=(min(chunk, edge),) * 3,
        dtype=np.uint16,
        compressors=None,
        chunk_key_encoding={"name": "v2", "separator": "/"},
    )
    scale = [{"type": "scale", "scale": [SPACING] * 3}]
    group.attrs["multiscales"] = [
        {
            "version": "0.4",
            "name": "made",
            "axes": [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"],
            "datasets": [{"path": "0", "coordinateTransformations": scale}],
        }
    ]
    voxels = angiogram((min(edge, PERIOD),) * 3).voxels
    for first in np.ndindex((-(-edge // chunk),) * 3):
        begin = chunk * np.array(first)
        end = np.minimum(begin + chunk, edge)
        array[tuple(map(slice, begin, end))] = voxels[
            np.ix_(*(np.arange(a, b) % len(voxels) for a, b in zip(begin, end)))
        ]


def make_view(image: Any) -> Any:
    """30 degrees about y and 20 about x, about the volume's centre."""
    view = itk.CenteredEuler3DTransform[itk.D].New()
    view.SetCenter(itk.ShearWarpMIPView.GetCentre(image))
    view.SetRotation(*np.radians((20.0, 30.0, 0.0)))
    return view


def time_median(function: Callable[[], Any], repeats: int) -> float:
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


def read_processor_seconds() -> tuple[float, float]:
    """Of a worker, and of the whole machine."""
    import psutil

    own, machine = psutil.Process().cpu_times(), psutil.cpu_times()
    return own.user + own.system, sum(machine) - machine.idle - getattr(machine, "iowait", 0)


def read_peak_memory() -> float:
    """Of a worker, in MB; Linux only."""
    status = Path("/proc/self/status")
    return int(re.search(r"VmHWM:\s+(\d+)", status.read_text())[1]) * 1024e-6 if status.exists() else float("nan")


def import_packages(path: Path) -> float:
    """Gets a worker ready to read and to project; its memory then, in MB."""
    import itk  # the module itself cannot be sent to a worker

    open_volume(path)
    zarr.open_group(path, mode="r")["0"][:1, :1, :1]
    itk.ShearWarpMIPPartImageFilter.keys()
    return read_peak_memory()


class Counted(Exception):
    """Ends a computation whose graph was only to be counted."""


def count_tasks(path: Path, view: Any) -> int:
    """The tasks of a view's graph."""

    def count(graph: Any, *_: Any, **__: Any) -> None:
        raise Counted(len(graph if isinstance(graph, dict) else graph.optimize().__dask_graph__()))

    with dask.config.set(scheduler=count):
        try:
            mip(path, view)
        except Counted as counted:
            return counted.args[0]
    raise AssertionError("a view without a graph")


def measure_case(path: Path, block: int, workers: int, options: argparse.Namespace) -> tuple[dict[str, Any], bytes]:
    """One volume, one size of blocks and one number of workers; the picture."""
    with (
        dask.config.set({"array.chunk-size": f"{block**3 * VOXEL}B"}),
        LocalCluster(
            n_workers=workers, threads_per_worker=1, memory_limit=options.memory_limit, dashboard_address=":0"
        ) as cluster,
        Client(cluster) as client,
    ):

        def read_others() -> float:
            """Processor seconds of the machine less those of this cluster."""
            machine = read_processor_seconds()[1]
            used = [own for own, _ in client.run(read_processor_seconds).values()]
            return machine - sum(used) - sum(os.times()[:2])

        ready = max(client.run(import_packages, path).values())
        opened = open_volume(path)
        view = make_view(opened.make_image())
        picture = mip(path, view)
        begin, others = time.perf_counter(), read_others()
        seconds = time_median(lambda: mip(path, view), options.repeats)
        others = max(0.0, (read_others() - others) / (time.perf_counter() - begin))
        peak = max(client.run(read_peak_memory).values())
        tasks = count_tasks(path, view)
    case = {
        "block": block,
        "workers": workers,
        "parts": int(np.prod(opened.array.numblocks)),
        "tasks": tasks,
        "seconds": seconds,
        "others": others,
        "megabytes_moved": picture["BytesSent"] / 1e6,
        "peak_megabytes": peak,
        "ready_megabytes": ready,
    }
    return case, np.asarray(picture).tobytes()


def measure_whole(path: Path, threads: int, repeats: int) -> tuple[dict[str, Any], bytes]:
    """The filter for the whole volume in memory: the first view of an image, and one when it is prepared; the picture."""
    opened = open_volume(path)
    begin = time.perf_counter()
    voxels = opened.array.compute(scheduler="threads", num_workers=threads)
    reading = time.perf_counter() - begin
    image = opened.make_part(voxels, (0, 0, 0))
    view = make_view(image)

    def make_filter() -> Any:
        projection = itk.ShearWarpMIPImageFilter.New(image, transform=view)
        projection.SetNumberOfWorkUnits(threads)
        projection.Update()
        return projection

    def project_again() -> None:
        prepared.Modified()
        prepared.Update()

    prepared = make_filter()
    project_again()
    measured = {
        "threads": threads,
        "first_view_seconds": time_median(make_filter, repeats),
        "view_seconds": time_median(project_again, repeats),
        "reading_seconds": reading,
    }
    return measured, np.asarray(prepared.GetOutput()).tobytes()


def measure(options: argparse.Namespace, folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The cases, and the filter for the whole volume."""
    cases, whole = [], []
    for edge in options.sizes:
        path = folder / f"{edge}.ome.zarr"
        write_volume(path, edge, options.chunk)
        expected = None
        for threads in options.workers if edge <= options.whole else []:
            measured, expected = measure_whole(path, threads, options.repeats)
            whole.append({"edge": edge, **measured})
        for block in options.blocks:
            for workers in options.workers:
                case, picture = measure_case(path, block, workers, options)
                name = f"{edge}, blocks of {block}, {workers} workers"
                if expected is not None and picture != expected:
                    sys.exit(f"error: {name}: the picture is not that of the whole volume")
                cases.append({"edge": edge, "megabytes": edge**3 * VOXEL / 1e6, **case})
                print(f"{name}: {case['seconds']:.2f} s, {case['peak_megabytes']:.0f} MB", file=sys.stderr)
        shutil.rmtree(path)
    return pd.DataFrame(cases), pd.DataFrame(whole, columns=list(WHOLE))


def report(cases: pd.DataFrame, whole: pd.DataFrame, repeats: int) -> str:
    """The results as Markdown."""
    return "\n\n".join(
        [
            f"{os.cpu_count()} cores, {platform.processor() or platform.machine()}; median of {repeats} views, workers with "
            "one thread each. Ready is a worker's memory after its imports. Others is how many cores other programs used "
            "meanwhile: times mean something if that is near zero.",
            cases.rename(columns=CASES).to_markdown(index=False, floatfmt=".4g"),
            "The filter for the whole volume in memory; every picture above has its bits:",
            whole.rename(columns=WHOLE).to_markdown(index=False, floatfmt=".4g"),
        ]
    )


def draw(path: Path, cases: pd.DataFrame, whole: pd.DataFrame) -> None:
    """Times against the size of the volume."""
    plt.rcParams.update({"font.size": 9, "axes.titlesize": 9, "svg.hashsalt": "0", "svg.fonttype": "none"})
    blocks = cases["block"].unique()
    figure, panels = plt.subplots(
        1, len(blocks), figsize=(2.2 + 3.4 * len(blocks), 2.8), layout="constrained", sharey=True, squeeze=False
    )
    alone = whole[whole["threads"] == 1].assign(gigabytes=lambda rows: rows["edge"] ** 3 * VOXEL / 1e9)
    for axes, block in zip(panels[0], blocks):
        rows = cases[cases["block"] == block].assign(gigabytes=lambda rows: rows["megabytes"] / 1e3)
        times = rows.pivot(index="gigabytes", columns="workers", values="seconds")
        times.add_suffix(" workers").plot(ax=axes, loglog=True, style="o-", legend=False)
        axes.plot(
            alone["gigabytes"], alone["first_view_seconds"], "x:", color="gray", label="whole in memory, 1 thread"
        )
        axes.set(xlabel="volume, GB", ylabel="s a view", title=f"blocks of {block}x{block}x{block}")
        axes.grid(alpha=0.3)
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside right upper")
    figure.savefig(path, bbox_inches="tight", pad_inches=0.05, metadata={"Date": None})
    plt.close(figure)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--output", type=Path, default=Path("scale-output"), help="folder of the results [scale-output]")
    add("--folder", type=Path, help="where volumes are made and removed again [a temporary one]")
    text = "edges in voxels; 2150 is 20 GB [256 512 1024]"
    add("--sizes", type=int, nargs="+", default=[256, 512, 1024], help=text)
    text = "edge of the chunks in the file, voxels [128]"
    add("--chunk", type=int, choices=(128, 256), default=128, help=text)
    text = "edges of what a task reads, whole chunks: Dask's array.chunk-size [128 256]"
    add("--blocks", type=int, nargs="+", default=[128, 256], help=text)
    add("--workers", type=int, nargs="+", default=[1, 2], help="numbers of worker processes [1 2]")
    add("--repeats", type=int, default=5, help="views, of whose times the median is taken [5]")
    add("--memory-limit", default="2GB", help="of a worker, as Dask has it [2GB]")
    add("--whole", type=int, default=1024, help="volumes up to this edge are projected in memory too [1024]")
    add("--smoke", action="store_true", help="only whether it works, with tiny volumes, in seconds")
    options = parser.parse_args()
    if options.smoke:
        options.sizes, options.chunk, options.blocks, options.workers, options.repeats = [48, 64], 32, [32], [2], 1
    if any(block % options.chunk for block in options.blocks):
        parser.error("--blocks must be multiples of --chunk")
    if min(*options.sizes, *options.workers, options.repeats) < 1:
        parser.error("--sizes, --workers and --repeats must be at least 1")
    return options


def main() -> None:
    options = parse_arguments()
    options.output.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        folder = options.folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        needed = (-(-max(options.sizes) // options.chunk) * options.chunk) ** 3 * VOXEL
        if shutil.disk_usage(folder).free < 1.05 * needed:
            sys.exit(f"error: {folder} has not the {needed / 1e9:.1f} GB that a volume needs")
        cases, whole = measure(options, folder)
    text = report(cases, whole, options.repeats)
    tables = {"cases": cases.to_dict("records"), "whole": whole.to_dict("records")}
    (options.output / "scale.json").write_text(json.dumps(tables, indent=1) + "\n")
    (options.output / "scale.md").write_text(text + "\n")
    draw(options.output / "scale.svg", cases, whole)
    print(text)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""itk_shearwarpmip.mip against the size of the volume and the number of workers: time, memory, bytes moved.

Volumes are uncompressed OME-Zarr of uint16: the synthetic head of peers.py, which repeats after 512 voxels. Each case
has a cluster of its own, whose workers are processes with one thread. One view goes before those that are timed, so
that packages are imported and the files lie in the system's cache, where memory is enough. Every picture is compared
with the filter's picture of the whole volume in memory, up to the size that --whole gives. `tasks` are those that the
workers execute for a view.

    pip install "$(echo dist/itk_shearwarpmip-*.whl)[distributed]" pandas tabulate
    scale.py --sizes 512 1024 2150 --blocks 256 --folder /data --output results
"""

from __future__ import annotations

import argparse
import itertools
import re
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from timeit import repeat
from typing import Any

import dask.array
import itk
import numpy as np
import pandas as pd
import zarr
from distributed import Client, LocalCluster
from itk_shearwarpmip import mip, open_image, open_volume
from peer.volume import make_head

PERIOD = 512  # voxels after which larger volumes repeat, a multiple of the chunks


def write_volume(path: Path, edge: int, chunk: int) -> None:
    """An OME-Zarr 0.4 with one level, not compressed."""
    group = zarr.open_group(path, mode="w", zarr_format=2)
    form: dict[str, Any] = {"compressors": None, "chunk_key_encoding": {"name": "v2", "separator": "/"}}
    array = group.create_array("0", shape=(edge,) * 3, chunks=(min(chunk, edge),) * 3, dtype=np.uint16, **form)
    axes = [{"name": name, "type": "space", "unit": "millimeter"} for name in "zyx"]
    datasets = [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [0.4] * 3}]}]
    group.attrs["multiscales"] = [{"version": "0.4", "name": "made", "axes": axes, "datasets": datasets}]
    head = dask.array.from_array(make_head((min(edge, PERIOD),) * 3).voxels, chunks=chunk)
    voxels = dask.array.tile(head, (-(-edge // PERIOD),) * 3)[:edge, :edge, :edge]
    dask.array.store(voxels, array, lock=False)


def time_median(function: Callable[[], Any], repeats: int) -> float:
    return statistics.median(repeat(function, "gc.enable()", number=1, repeat=repeats))


def read_peak_memory() -> float:
    """Of a worker, in MB; Linux only."""
    status = Path("/proc/self/status")
    return int(re.search(r"VmHWM:\s+(\d+)", status.read_text())[1]) * 1024e-6 if status.exists() else float("nan")


def count_tasks(dask_worker: Any) -> int:
    """That a worker has run."""
    return dask_worker.state.executed_count


def measure(path: Path, view: Any, block: int, workers: int, options: argparse.Namespace) -> tuple[dict, bytes]:
    """One volume, one size of blocks and one number of workers; the picture."""
    chunks = dask.config.set({"array.chunk-size": f"{2 * block**3}B"})
    limit = {"memory_limit": options.memory_limit, "dashboard_address": ":0"}
    with chunks, LocalCluster(n_workers=workers, threads_per_worker=1, **limit) as cluster, Client(cluster) as client:
        picture = mip(path, view)
        case = {
            "block": block,
            "workers": workers,
            "parts": open_volume(path).array.npartitions,
            "tasks": sum(client.run(count_tasks).values()),
            "a view, s": time_median(lambda: mip(path, view), options.repeats),
            "moved, MB": picture["BytesSent"] / 1e6,
            "peak of a worker, MB": max(client.run(read_peak_memory).values()),
        }
    return case, np.asarray(picture).tobytes()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--output", type=Path, default=Path("scale-output"), help="folder of scale.csv and scale.md [scale-output]")
    add("--folder", type=Path, help="where volumes are made and removed again [a temporary one]")
    add("--sizes", type=int, nargs="+", default=[256, 512, 1024], help="edges, voxels; 2150 is 20 GB [256 512 1024]")
    add("--chunk", type=int, choices=(128, 256), default=128, help="edge of the chunks in the file, voxels [128]")
    add("--blocks", type=int, nargs="+", default=[128, 256], help="edges of what a task reads, whole chunks [128 256]")
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
    options.output.mkdir(parents=True, exist_ok=True)

    cases: list[dict] = []
    for edge in options.sizes:
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            path = Path(folder) / "made.ome.zarr"
            write_volume(path, edge, options.chunk)
            view = itk.CenteredEuler3DTransform[itk.D].New()
            view.SetCenter(itk.ShearWarpMIPView.GetCenter(open_volume(path).make_image()))
            view.SetRotation(*np.radians((20.0, 30.0, 0.0)))
            expected = None
            if edge <= options.whole:
                image = open_image(path)
                whole = itk.ShearWarpMIPImageFilter.New(image, transform=view, number_of_work_units=1)
                seconds = time_median(whole.Update, 1)
                expected = np.asarray(whole.GetOutput()).tobytes()
                cases.append({"edge": edge, "block": "whole in memory, first view, 1 thread", "a view, s": seconds})
            for block, workers in itertools.product(options.blocks, options.workers):
                case, picture = measure(path, view, block, workers, options)
                if expected not in (None, picture):
                    sys.exit(f"error: {edge}: {case}: the picture differs from the picture of the whole volume")
                cases.append({"edge": edge, **case})
                print(cases[-1], file=sys.stderr)
    table = pd.DataFrame(cases)
    table.to_csv(options.output / "scale.csv", index=False)
    text = table.to_markdown(index=False, floatfmt=".4g", missingval="")
    (options.output / "scale.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()

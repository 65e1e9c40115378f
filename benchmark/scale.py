#!/usr/bin/env python3
"""itk_shearwarpmip.mip against the size of the volume and the number of workers: time, memory, bytes moved.

Volumes are made, chunk by chunk, as uncompressed OME-Zarr of uint16: filaments and cells on a dim background, which
repeat after 1024 voxels. Each case (size of the volume, size of the blocks that tasks read, number of workers) has a
cluster of its own, whose workers are processes with one thread. One view goes before those that are timed, so that
packages are imported and the files lie in the system's cache, where memory is enough.

A model is fitted to the times by least squares of the relative errors, without negative coefficients:

    t = bytes / (workers bandwidth) + a pixels log2(parts)

where pixels are those of the intermediate image and parts are the blocks; then with a time for each task of the graph
too, and then with a constant. All are printed with what they leave over.

    pip install "$(echo dist/itk_shearwarpmip-*.whl)[distributed]" matplotlib psutil scipy
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
import shutil
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import dask
import numpy as np

SEED = 20020547
VOXEL = 2  # bytes
PERIOD = 1024  # voxels after which larger volumes repeat, a multiple of the chunks
BACKGROUND, NOISE = 100, 12
SPACING = 0.4  # micrometres
FAR_FROM_CACHE = 2**30  # bytes that are gone through between two uses of a block
BLUE, ORANGE = "#2060c0", "#e07000"
MEGA, GIGA = 1e6, 1e9


# --------------------------------------------------------------------------------------------- data


def make_lines(generator: np.random.Generator, edge: int) -> np.ndarray:
    """Points of filaments through a volume, z, y, x and brightness, less than a voxel apart."""
    steps = np.linspace(0, 1, int(1.6 * edge), dtype=np.float32)[:, np.newaxis]
    lines = []
    for _ in range(max(3, 3 * edge**2 // 128**2)):
        ends = generator.uniform(0, edge, (2, 3)).astype(np.float32)
        wave = generator.normal(0, 0.04 * edge, (2, 3)).astype(np.float32)
        points = ends[0] + steps * (ends[1] - ends[0])
        points += wave[0] * np.sin(np.pi * steps) + wave[1] * np.sin(3 * np.pi * steps)
        lines.append(np.hstack((points, np.full_like(steps, generator.uniform(800, 5000)))))
    return np.concatenate(lines)


def make_stamp(deviation: float, radius: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and weights of a Gaussian ball."""
    offsets = np.indices((2 * radius + 1,) * 3).reshape(3, -1).T - radius
    weights = np.exp(-np.square(offsets).sum(axis=1) / (2 * deviation**2))
    return offsets[weights > 0.02], weights[weights > 0.02]


def stamp(block: np.ndarray, points: np.ndarray, deviation: float, radius: int) -> None:
    """Raises the voxels around points to Gaussian balls; points are relative to the block."""
    offsets, weights = make_stamp(deviation, radius)
    near = ((points[:, :3] > -radius - 1) & (points[:, :3] < np.array(block.shape) + radius)).all(axis=1)
    points = points[near]
    for offset, weight in zip(offsets, weights):
        places = np.rint(points[:, :3]).astype(int) + offset
        inside = ((places >= 0) & (places < block.shape)).all(axis=1)
        values = (BACKGROUND + weight * points[inside, 3]).astype(block.dtype)
        np.maximum.at(block, tuple(places[inside].T), values)


def make_block(first: tuple[int, ...], shape: tuple[int, ...], lines: np.ndarray) -> np.ndarray:
    """Voxels from number `first` (z, y, x) on; they depend on nothing but the place and the lines."""
    generator = np.random.default_rng([SEED, *first])
    block = (BACKGROUND + NOISE * generator.standard_normal(shape, np.float32)).astype(np.uint16)
    cells = generator.uniform(12, np.maximum(13, np.subtract(shape, 12)), (max(1, block.size // 700_000), 3))
    stamp(block, np.column_stack((cells, generator.uniform(500, 2500, len(cells)))), 4.0, 11)
    stamp(block, lines - np.array([*first, 0], np.float32), 1.2, 3)
    return block


def write_volume(path: Path, edge: int, chunk: int) -> None:
    """An OME-Zarr 0.4 with one level, not compressed."""
    import zarr

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
    period = min(edge, PERIOD)
    lines = make_lines(np.random.default_rng([SEED, edge]), period)
    begins = range(0, edge, chunk)
    # few lines meet a slice of blocks
    for z in begins:
        there = lines[(lines[:, 0] > z - 8) & (lines[:, 0] < z + chunk + 8)]
        for y in begins:
            near = there[(there[:, 1] > y - 8) & (there[:, 1] < y + chunk + 8)]
            for x in begins:
                shape = tuple(min(chunk, edge - begin) for begin in (z, y, x))
                # the same block of the first period was written before
                first = tuple(begin % period for begin in (z, y, x))
                block = (
                    make_block(first, shape, near)
                    if first == (z, y, x)
                    else array[tuple(slice(begin, begin + length) for begin, length in zip(first, shape))]
                )
                array[z : z + chunk, y : y + chunk, x : x + chunk] = block


# ------------------------------------------------------------------------------------------ measuring


ANGLES = {"z": (20.0, 30.0, 0.0), "y": (110.0, 30.0, 0.0), "x": (20.0, 120.0, 0.0)}


def make_view(image: Any, principal_axis: str = "z") -> Any:
    """30 degrees about y and 20 about x, about the volume's centre, or that many more about one of them."""
    import itk

    view = itk.CenteredEuler3DTransform[itk.D].New()
    view.SetCenter(itk.ShearWarpMIPView.GetCentre(image))
    view.SetRotation(*np.radians(ANGLES[principal_axis]))
    return view


def time_median(function: Callable[[], Any], repeats: int) -> float:
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


class Others:
    """Cores that other programs use meanwhile."""

    @staticmethod
    def _read() -> tuple[float, float]:
        import psutil

        times = psutil.cpu_times()
        used = sum(times) - times.idle - getattr(times, "iowait", 0)
        this = psutil.Process()
        for process in (this, *this.children(recursive=True)):
            with contextlib.suppress(psutil.Error):
                used -= process.cpu_times().user + process.cpu_times().system
        return time.perf_counter(), used

    def __enter__(self) -> Others:
        self._begin = self._read()
        return self

    def __exit__(self, *_: object) -> None:
        (begin, used_before), (end, used) = self._begin, self._read()
        self.cores = max(0.0, (used - used_before) / (end - begin))


class PeakMemory:
    """The largest resident set of each process, by samples; on Linux by the system's own record."""

    def __init__(self, processes: list[int]) -> None:
        import psutil

        self._processes = [psutil.Process(number) for number in processes]
        self._peaks = dict.fromkeys(processes, 0)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)

    def _sample(self) -> None:
        while not self._ended.wait(0.02):
            self._look()

    def _look(self) -> None:
        for process in self._processes:
            with contextlib.suppress(Exception):
                self._peaks[process.pid] = max(self._peaks[process.pid], process.memory_info().rss)

    def __enter__(self) -> PeakMemory:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._look()
        self._ended.set()
        self._thread.join()
        for number in self._peaks:
            with contextlib.suppress(OSError, StopIteration):
                status = Path(f"/proc/{number}/status").read_text()
                line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
                self._peaks[number] = 1024 * int(line.split()[1])

    def get(self) -> list[int]:
        """Bytes of each process."""
        return list(self._peaks.values())


def import_packages(path: Path) -> int:
    """The resident set, bytes, of a worker that is ready to read and to project."""
    import itk
    import psutil
    import zarr
    from itk_shearwarpmip import open_volume

    open_volume(path)
    zarr.open_group(path, mode="r")["0"][:1, :1, :1]
    itk.ShearWarpMIPPartImageFilter.keys()
    return psutil.Process().memory_info().rss


def do_nothing(_: Any) -> None:
    return None


def make_empty_graph(tasks: int) -> Any:
    """That many tasks, all but the last one independent."""
    nothing = dask.delayed(do_nothing, pure=False)
    return nothing([nothing(number) for number in range(tasks - 1)])


@contextlib.contextmanager
def start_workers(workers: int, memory_limit: str) -> Iterator[Any]:
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=workers, threads_per_worker=1, memory_limit=memory_limit, dashboard_address=":0"
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


class _Counted(Exception):
    """Ends a computation whose graph was only to be counted."""


def count_tasks(path: Path, view: Any) -> int:
    """The tasks of a view's graph."""
    from itk_shearwarpmip import mip

    def count(graph: Any, *_: Any, **__: Any) -> None:
        raise _Counted(len(graph if isinstance(graph, dict) else graph.optimize().__dask_graph__()))

    with dask.config.set(scheduler=count):
        try:
            mip(path, view)
        except _Counted as counted:
            return counted.args[0]
    raise AssertionError("a view without a graph")


def measure_case(
    path: Path, edge: int, block: int, workers: int, repeats: int, memory_limit: str, expected: bytes | None
) -> dict[str, Any]:
    """One volume, one size of blocks and one number of workers. The picture must be the expected one."""
    import itk
    from itk_shearwarpmip import mip, open_volume

    with (
        dask.config.set({"array.chunk-size": f"{block**3 * VOXEL}B"}),
        start_workers(workers, memory_limit) as client,
    ):
        ready = max(client.run(import_packages, path).values())
        opened = open_volume(path)
        image = opened.make_image()
        view = make_view(image)
        with PeakMemory(list(client.run(os.getpid).values())) as memory:
            picture = mip(path, view)
            with Others() as others:
                seconds = time_median(lambda: mip(path, view), repeats)
        tasks = count_tasks(path, view)
        if expected is not None and np.asarray(picture).tobytes() != expected:
            sys.exit(
                f"error: {edge}, blocks of {block}, {workers} workers: the picture is not that of the whole volume"
            )
        # every graph has keys of its own: results that workers still have are not computed again
        graphs = iter([make_empty_graph(tasks) for _ in range(repeats)])
        empty = time_median(lambda: next(graphs).compute(), repeats)
        small = dask.array.zeros([2 * number for number in opened.array.numblocks], dtype=np.uint16, chunks=2)
        mip(small, view)
        small_seconds = time_median(lambda: mip(small, view), repeats)
    factorization = itk.ShearWarpFactorization(view, image, picture)
    return {
        "edge": edge,
        "block": block,
        "workers": workers,
        "seconds": seconds,
        "others": others.cores,
        "bytes_read": edge**3 * VOXEL,
        "bytes_sent": int(picture["BytesSent"]),
        "parts": int(np.prod(opened.array.numblocks)),
        "tasks": tasks,
        "pixels": int(np.prod(list(factorization.GetIntermediateSize()))),
        "empty_graph_seconds": empty,
        "small_blocks_seconds": small_seconds,
        "ready_bytes": ready,
        "peak_bytes": max(memory.get()),
    }


def measure_whole(path: Path, edge: int, threads: int, repeats: int) -> tuple[dict[str, Any], bytes]:
    """The filter for the whole volume in memory: the first view of an image, and one when it is prepared; the picture."""
    import itk
    from itk_shearwarpmip import open_volume

    opened = open_volume(path)
    begin = time.perf_counter()
    voxels = opened.array.compute(scheduler="threads", num_workers=threads)
    reading = time.perf_counter() - begin
    image = opened.make_part(voxels, (0, 0, 0))
    view = make_view(image)

    def project_first() -> None:
        projection = itk.ShearWarpMIPImageFilter.New(image, transform=view)
        projection.SetNumberOfWorkUnits(threads)
        projection.Update()

    prepared = itk.ShearWarpMIPImageFilter.New(image, transform=view)
    prepared.SetNumberOfWorkUnits(threads)
    prepared.Update()
    prepared.Modified()
    prepared.Update()

    def project_again() -> None:
        prepared.Modified()
        prepared.Update()

    measured = {
        "edge": edge,
        "threads": threads,
        "first_view_seconds": time_median(project_first, repeats),
        "view_seconds": time_median(project_again, repeats),
        "reading_seconds": reading,
    }
    return measured, np.asarray(prepared.GetOutput()).tobytes()


def measure_block(block: int, repeats: int, far: int) -> dict[str, Any]:
    """The tasks of a volume in memory with one thread, against reading it; seconds per block."""
    import itk
    from dask.diagnostics import Profiler
    from itk_shearwarpmip import mip, open_volume

    first_block = make_block((0, 0, 0), (block,) * 3, make_lines(np.random.default_rng(SEED), block))
    # enough of them that none is in a cache when its turn comes again
    length = max(2, round((far / first_block.nbytes) ** (1 / 3)))
    blocks = [np.roll(first_block, number, axis=2) for number in range(length**3)]

    def get_block(block_info: dict[Any, Any]) -> np.ndarray:
        z, y, x = block_info[None]["chunk-location"]
        return blocks[(z * length + y) * length + x]

    volume = dask.array.map_blocks(
        get_block, chunks=((block,) * length,) * 3, dtype=np.uint16, meta=np.empty((0,) * 3, np.uint16)
    )
    opened = open_volume(volume)
    view = make_view(opened.make_image())
    bytes_sent = mip(volume, view)["BytesSent"]
    times: dict[str, list[float]] = {"project_chunks": [], "merge_": []}
    for _ in range(repeats):
        with dask.config.set(scheduler="synchronous"), Profiler() as profiler:
            mip(volume, view)
        for name, sums in times.items():
            done = [task for task in profiler.results if str(task.key).lstrip("('").startswith(name)]
            sums.append(sum(task.end_time - task.start_time for task in done) / len(blocks))

    def read(largest: Callable[[np.ndarray], Any]) -> float:
        return time_median(lambda: [largest(each) for each in blocks], repeats) / len(blocks)

    projection = itk.ShearWarpMIPPartImageFilter.New(opened.make_image())
    projection.SetWholeRegion(opened.region)
    projection.SetNumberOfWorkUnits(1)
    projection.SetReducedResampling(itk.ShearWarpMIPImageFilterEnums.ReducedResampling_Off)
    parts = [
        opened.make_part(each, np.multiply(place, block)) for each, place in zip(blocks, np.ndindex((length,) * 3))
    ]

    def project_parts() -> None:
        for part in parts:
            projection.SetInput(part)
            projection.Update()

    filter_seconds = {}
    for axis in ANGLES:
        projection.SetTransform(make_view(opened.make_image(), axis))
        filter_seconds[axis] = time_median(project_parts, repeats) / len(blocks)

    return {
        "block": block,
        "blocks": len(blocks),
        "bytes_sent": int(bytes_sent / len(blocks)),
        **{f"{name.rstrip('_')}_seconds": statistics.median(sums) for name, sums in times.items()},
        "filter_seconds": filter_seconds,
        "read_limit_seconds": min(read(np.max), read(lambda each: each.view(np.uint64).sum())),
    }


# -------------------------------------------------------------------------------------------- model

TERMS = {
    "bytes": "bytes / workers",
    "merging": "pixels log2(parts)",
    "tasks": "tasks",
    "view": "every view",
}
MODELS = {
    "bytes and merging": ("bytes", "merging"),
    "and tasks": ("bytes", "merging", "tasks"),
    "and a constant": ("bytes", "merging", "tasks", "view"),
}


def get_terms(case: dict[str, Any]) -> dict[str, float]:
    return {
        "bytes": case["bytes_read"] / case["workers"],
        "merging": case["pixels"] * np.log2(case["parts"]),
        "tasks": case["tasks"],
        "view": 1,
    }


def fit(cases: list[dict[str, Any]], terms: tuple[str, ...]) -> dict[str, Any]:
    """Coefficients that are not negative, and what is left over, relative to the times."""
    from scipy.optimize import nnls

    times = np.array([case["seconds"] for case in cases])
    rows = np.array([[get_terms(case)[term] for term in terms] for case in cases])
    rows /= times[:, np.newaxis]
    scale = rows.max(axis=0)
    scale[scale == 0] = 1
    found, _ = nnls(rows / scale, np.ones_like(times))
    coefficients = dict(zip(terms, (found / scale).tolist()))
    residuals = rows @ (found / scale) - 1
    return {
        "coefficients": coefficients,
        "residuals": residuals.tolist(),
        "root_mean_square": float(np.sqrt(np.mean(residuals**2))),
        "largest": float(np.abs(residuals).max()),
        "freedom": max(0, len(cases) - len(terms)),
    }


def predict(model: dict[str, Any], case: dict[str, Any]) -> float:
    """Seconds."""
    return sum(factor * get_terms(case)[term] for term, factor in model["coefficients"].items())


def extrapolate(cases: list[dict[str, Any]], block: int, edge: int, workers: int) -> dict[str, Any]:
    """What a larger case would be: its pixels, tasks and bytes moved are in proportion to the largest one measured."""
    nearest = max((case for case in cases if case["block"] == block), key=lambda case: case["edge"])
    parts = (-(-edge // block)) ** 3
    bytes_read = edge**3 * VOXEL
    return {
        "edge": edge,
        "block": block,
        "workers": workers,
        "bytes_read": bytes_read,
        "bytes_sent": round(nearest["bytes_sent"] * bytes_read / nearest["bytes_read"]),
        "pixels": round(nearest["pixels"] * (edge / nearest["edge"]) ** 2),
        "parts": parts,
        "tasks": round(nearest["tasks"] * parts / nearest["parts"]),
    }


def describe(name: str, factor: float) -> str:
    """A coefficient in units that can be read."""
    if factor == 0:
        return f"{TERMS[name]}: 0"
    if name == "bytes":
        return f"bandwidth of a worker: {1 / factor / MEGA:.0f} MB/s"
    if name == "merging":
        return f"{TERMS[name]}: {1e9 * factor:.2f} ns each"
    return f"{TERMS[name]}: {1e3 * factor:.3f} ms" + (" each" if name == "tasks" else "")


# -------------------------------------------------------------------------------------------- results


def make_table(header: list[str], rows: list[list[Any]]) -> str:
    lines = [header, ["---:"] * len(header), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def report(results: dict[str, Any]) -> str:
    """The results as Markdown."""
    cases, models = results["cases"], results["models"]
    modelled = [[f"{predict(model, case):.2f}" for model in models.values()] for case in cases]
    texts = [
        f"{results['machine']['cpus']} cores, {results['machine']['processor']}; median of {results['repeats']} views, "
        "workers with one thread each. Ready is a worker's memory after its imports. An empty graph has as many tasks "
        "that do nothing; blocks of 8 voxels have the graph of the view and nearly no voxels. Others is how many cores other "
        "programs used meanwhile: times mean something if that is near zero.",
        make_table(
            [
                "edge",
                "volume, MB",
                "block",
                "workers",
                "parts",
                "tasks",
                "a view, s",
                "others",
                *(f"by model: {name}" for name in models),
                "MB/s",
                "moved, MB",
                "of what is read",
                "peak of a worker, MB",
                "ready, MB",
                "empty graph, s",
                "blocks of 8 voxels, s",
            ],
            [
                [
                    case["edge"],
                    f"{case['bytes_read'] / MEGA:.0f}",
                    case["block"],
                    case["workers"],
                    case["parts"],
                    case["tasks"],
                    f"{case['seconds']:.2f}",
                    f"{case['others']:.1f}",
                    *model,
                    f"{case['bytes_read'] / case['seconds'] / MEGA:.0f}",
                    f"{case['bytes_sent'] / MEGA:.1f}",
                    f"{100 * case['bytes_sent'] / case['bytes_read']:.1f} %",
                    f"{case['peak_bytes'] / MEGA:.0f}",
                    f"{case['ready_bytes'] / MEGA:.0f}",
                    f"{case['empty_graph_seconds']:.3f}",
                    f"{case['small_blocks_seconds']:.2f}",
                ]
                for case, model in zip(cases, modelled)
            ],
        ),
    ]
    if results["whole"]:
        texts += [
            "The filter for the whole volume in memory; every picture above has its bits:",
            make_table(
                ["edge", "threads", "first view, s", "other views, s", "reading the file before, s"],
                [
                    [
                        each["edge"],
                        each["threads"],
                        f"{each['first_view_seconds']:.3f}",
                        f"{each['view_seconds']:.3f}",
                        f"{each['reading_seconds']:.2f}",
                    ]
                    for each in results["whole"]
                ],
            ),
        ]
    texts += [
        "The tasks for a volume in memory, one thread, and the part filter alone for views along each axis; all but the "
        "last column are times per block:",
        make_table(
            [
                "block",
                "read limit, ms",
                "project_chunks, ms",
                "merge_*, ms",
                *(f"filter along {axis}, ms" for axis in ANGLES),
                "project_chunks, x read limit",
                *(f"filter along {axis}, x" for axis in ANGLES),
                "merge_*, GB/s",
            ],
            [
                [
                    each["block"],
                    *(f"{1e3 * each[f'{name}_seconds']:.2f}" for name in ("read_limit", "project_chunks", "merge")),
                    *(f"{1e3 * seconds:.2f}" for seconds in each["filter_seconds"].values()),
                    f"{each['project_chunks_seconds'] / each['read_limit_seconds']:.1f}",
                    *(f"{seconds / each['read_limit_seconds']:.1f}" for seconds in each["filter_seconds"].values()),
                    f"{each['bytes_sent'] / max(each['merge_seconds'], 1e-9) / GIGA:.1f}",
                ]
                for each in results["blocks"]
            ],
        ),
        f"Models, with the relative errors that they leave in {len(cases)} cases:",
        "\n".join(
            f"- {name}: "
            + "; ".join(describe(term, factor) for term, factor in model["coefficients"].items())
            + f". Root mean square {100 * model['root_mean_square']:.0f} %, largest {100 * model['largest']:.0f} %, "
            f"{model['freedom']} degrees of freedom"
            for name, model in models.items()
        ),
        f"Extrapolated to {results['predictions'][0]['edge']}^3 voxels of 16 bits on "
        f"{results['predictions'][0]['workers']} such workers, all of them reading at once as fast as these:",
        make_table(
            [
                "block",
                "parts",
                "tasks",
                "read by a worker, GB",
                "moved, GB",
                "pixels",
                *(f"s, by model: {name}" for name in models),
            ],
            [
                [
                    each["block"],
                    each["parts"],
                    each["tasks"],
                    f"{each['bytes_read'] / each['workers'] / GIGA:.1f}",
                    f"{each['bytes_sent'] / GIGA:.0f}",
                    f"{each['pixels']:.2g}",
                    *(f"{predict(model, each):.0f}" for model in models.values()),
                ]
                for each in results["predictions"]
            ],
        ),
    ]
    return "\n\n".join(texts) + "\n"


def draw(path: Path, results: dict[str, Any]) -> None:
    """Measured times and the last model against the size of the volume."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 9, "axes.titlesize": 9, "svg.hashsalt": "0", "svg.fonttype": "none"})
    model = list(results["models"].values())[-1]
    cases = results["cases"]
    blocks = sorted({case["block"] for case in cases})
    figure, panels = plt.subplots(
        1, len(blocks), figsize=(2.2 + 3.4 * len(blocks), 2.8), layout="constrained", sharey=True, squeeze=False
    )
    for axes, block in zip(panels[0], blocks):
        for workers, colour in zip(sorted({case["workers"] for case in cases}), (ORANGE, BLUE)):
            those = [case for case in cases if (case["block"], case["workers"]) == (block, workers)]
            gigabytes = [case["bytes_read"] / GIGA for case in those]
            axes.plot(
                gigabytes,
                [case["seconds"] for case in those],
                "o",
                color=colour,
                label=f"{workers} worker{'s' if workers > 1 else ''}",
            )
            axes.plot(gigabytes, [predict(model, case) for case in those], color=colour, label="model")
        whole = [each for each in results["whole"] if each["threads"] == 1]
        if whole:
            axes.plot(
                [each["edge"] ** 3 * VOXEL / GIGA for each in whole],
                [each["first_view_seconds"] for each in whole],
                "x:",
                color="#606060",
                label="whole in memory, 1 thread",
            )
        axes.set(xscale="log", yscale="log", xlabel="volume, GB", title=f"blocks of {block}x{block}x{block}")
        axes.grid(alpha=0.3)
    panels[0][0].set_ylabel("s a view")
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside right upper")
    figure.savefig(path, bbox_inches="tight", pad_inches=0.05, metadata={"Date": None})
    plt.close(figure)


# -------------------------------------------------------------------------------------------- program


def find_processor() -> str:
    with contextlib.suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line for line in lines if line.startswith("model name")).partition(":")[2].strip()
    return platform.processor()


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    cases, whole = [], []
    for edge in options.sizes:
        path = folder / f"{edge}.ome.zarr"
        begin = time.perf_counter()
        write_volume(path, edge, options.chunk)
        print(f"{edge}: made in {time.perf_counter() - begin:.0f} s", file=sys.stderr)
        expected = None
        if edge <= options.whole:
            for threads in options.workers:
                measured, expected = measure_whole(path, edge, threads, options.repeats)
                whole.append(measured)
        for block in options.blocks:
            for workers in options.workers:
                case = measure_case(path, edge, block, workers, options.repeats, options.memory_limit, expected)
                cases.append(case)
                print(
                    f"{edge}: blocks of {block}, {workers} workers: {case['seconds']:.2f} s, "
                    f"{case['peak_bytes'] / MEGA:.0f} MB",
                    file=sys.stderr,
                )
        shutil.rmtree(path)
    models = {name: fit(cases, terms) for name, terms in MODELS.items()}
    return {
        "machine": {"cpus": os.cpu_count(), "processor": find_processor(), "system": platform.platform()},
        "repeats": options.repeats,
        "chunk": options.chunk,
        "memory_limit": options.memory_limit,
        "cases": cases,
        "whole": whole,
        "blocks": [measure_block(block, options.repeats, options.far) for block in options.blocks],
        "models": models,
        "predictions": [extrapolate(cases, block, 10_000, 100) for block in options.blocks],
    }


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--output", type=Path, default=Path("scale-output"), help="folder of the results [scale-output]"
    )
    parser.add_argument("--folder", type=Path, help="where volumes are made and removed again [a temporary one]")
    parser.add_argument(
        "--sizes", type=int, nargs="+", default=[256, 512, 1024], help="edges in voxels; 2150 is 20 GB [256 512 1024]"
    )
    parser.add_argument(
        "--chunk", type=int, choices=(128, 256), default=128, help="edge of the chunks in the file, voxels [128]"
    )
    parser.add_argument(
        "--blocks",
        type=int,
        nargs="+",
        default=[128, 256],
        help="edges of what a task reads, whole chunks: Dask's array.chunk-size [128 256]",
    )
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2], help="numbers of worker processes [1 2]")
    parser.add_argument("--repeats", type=int, default=5, help="views, of whose times the median is taken [5]")
    parser.add_argument("--memory-limit", default="2GB", help="of a worker, as Dask has it [2GB]")
    parser.add_argument(
        "--whole", type=int, default=1024, help="volumes up to this edge are projected in memory too [1024]"
    )
    parser.add_argument("--smoke", action="store_true", help="only whether it works, with tiny volumes, in seconds")
    return parser


def main() -> None:
    parser = make_parser()
    options = parser.parse_args()
    options.far = FAR_FROM_CACHE
    if options.smoke:
        options.sizes, options.chunk, options.blocks, options.workers = [48, 64], 32, [32], [2]
        options.repeats, options.far = 1, 0
    if any(block % options.chunk for block in options.blocks):
        parser.error("--blocks must be multiples of --chunk")
    if min(*options.sizes, *options.workers, options.repeats) < 1:
        parser.error("--sizes, --workers and --repeats must be at least 1")
    options.output.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        folder = options.folder or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        folder.mkdir(parents=True, exist_ok=True)
        largest = max(options.sizes)
        needed = (-(-largest // options.chunk) * options.chunk) ** 3 * VOXEL
        if shutil.disk_usage(folder).free < 1.05 * needed:
            sys.exit(f"error: {folder} has no {needed / GIGA:.1f} GB left for a volume of {largest}^3")
        results = measure(options, folder)
    text = report(results)
    (options.output / "scale.json").write_text(json.dumps(results, indent=1) + "\n")
    (options.output / "scale.md").write_text(text)
    draw(options.output / "scale.svg", results)
    print(text)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Makes a small light-sheet image as OME-Zarr, and projects it with the workers of a Dask cluster.

light_sheet.py folder
light_sheet.py folder --size 512 1024 1024 --workers 4

The folder gets light-sheet.ome.zarr (two resolutions), mip.png and turn.gif. No process ever holds the whole image.
"""

import argparse
import sys
import time
from pathlib import Path

import dask
import dask.array
import itk
import numpy as np
import zarr
from distributed import Client, LocalCluster
from itk_shearwarpmip import mip, open_volume, turn
from PIL import Image

SPACING = (0.8, 0.4, 0.4)  # micrometres along z, y, x
CHUNK = 128
BACKGROUND, NOISE = 100.0, 12.0
RADIUS = 4  # voxels around a filament's points


def make_filaments(shape: tuple[int, ...], generator: np.random.Generator) -> np.ndarray:
    """Points half a voxel apart along bent lines: z, y, x and brightness."""
    number, steps = 60, 2 * max(shape)
    place = generator.uniform(0, shape, (number, 3))
    direction = generator.normal(size=(number, 3))
    bend = np.zeros((number, 3))
    points = np.empty((steps, number, 4))
    points[..., 3] = generator.uniform(600, 5000, number)
    for step in range(steps):
        bend = 0.95 * bend + 0.003 * generator.normal(size=(number, 3))
        direction += bend
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        place = place + 0.5 * direction
        points[step, :, :3] = place
    return points.reshape(-1, 4)


def make_chunk(filaments: np.ndarray, block_info=None) -> np.ndarray:
    """Gaussian tubes on a background with noise."""
    place = np.array(block_info[None]["array-location"])
    first, shape = place[:, 0], place[:, 1] - place[:, 0]
    generator = np.random.default_rng(first)
    chunk = BACKGROUND + NOISE * generator.standard_normal(shape, np.float32)
    near = ((filaments[:, :3] > first - RADIUS - 1) & (filaments[:, :3] < first + shape + RADIUS)).all(axis=1)
    points = filaments[near, :3] - first
    centers = np.rint(points).astype(int)
    for offset in np.ndindex((2 * RADIUS + 1,) * 3):
        voxels = centers + np.array(offset) - RADIUS
        inside = ((voxels >= 0) & (voxels < shape)).all(axis=1)
        distance = np.square(voxels[inside] - points[inside]).sum(axis=1)
        light = BACKGROUND + filaments[near, 3][inside] * np.exp(-distance / (2 * 1.3**2))
        np.maximum.at(chunk, tuple(voxels[inside].T), light.astype(np.float32))
    return chunk.astype(np.uint16)


def write_image(path: Path, shape: tuple[int, ...]) -> None:
    """An OME-Zarr 0.5, the second resolution half as fine as the first."""
    filaments = dask.delayed(make_filaments(shape, np.random.default_rng(7)))
    finest = dask.array.map_blocks(
        make_chunk,
        filaments,
        chunks=dask.array.core.normalize_chunks(CHUNK, shape),
        dtype=np.uint16,
        meta=np.empty((0,) * 3, np.uint16),
    )
    group = zarr.open_group(path, mode="w", zarr_format=3)
    datasets = []
    for level in range(2):
        array = group.create_array(
            str(level), shape=[length >> level for length in shape], chunks=(CHUNK,) * 3, dtype=np.uint16
        )
        if level == 0:
            voxels = finest
        else:
            voxels = dask.array.from_zarr(group["0"])
            voxels = dask.array.coarsen(np.mean, voxels, dict.fromkeys(range(3), 2), trim_excess=True)
        dask.array.store(voxels.astype(np.uint16).rechunk(CHUNK), array, lock=False)
        scale = [spacing * 2**level for spacing in SPACING]
        # the center of the first voxel moves
        shift = [(of_level - spacing) / 2 for of_level, spacing in zip(scale, SPACING)]
        steps = [{"type": "scale", "scale": scale}, {"type": "translation", "translation": shift}]
        datasets.append({"path": str(level), "coordinateTransformations": steps})
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    group.attrs["ome"] = {
        "version": "0.5",
        "multiscales": [{"name": "light sheet", "axes": axes, "datasets": datasets}],
    }


def to_grey(pixels: np.ndarray) -> np.ndarray:
    """8 bits, from the background to what is among the brightest; dim light is raised."""
    light = np.clip((pixels - BACKGROUND) / max(np.percentile(pixels, 99.5) - BACKGROUND, 1), 0, 1)
    return (255 * light**0.7 + 0.5).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where image and pictures go")
    parser.add_argument(
        "--size", type=int, nargs=3, default=(256, 512, 512), metavar=("Z", "Y", "X"), help="voxels [256 512 512]"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes with one thread each [2]")
    parser.add_argument("--frames", type=int, default=24, help="frames of a full turn [24]")
    arguments = parser.parse_args()
    if min(arguments.size) < 2 or arguments.workers < 1 or arguments.frames < 1:
        sys.exit("error: --size must be at least 2, --workers and --frames at least 1")
    try:
        arguments.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.exit(f"error: {arguments.folder} can't be made: {error.strerror}")
    path = arguments.folder / "light-sheet.ome.zarr"

    with (
        LocalCluster(n_workers=arguments.workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        Client(cluster),
    ):
        write_image(path, tuple(arguments.size))
        view = itk.CenteredEuler3DTransform[itk.D].New()
        view.SetCenter(itk.ShearWarpMIPView.GetCenter(open_volume(path).make_image()))
        view.SetRotation(*np.radians([25.0, 35.0, 0.0]))
        mip(path, view, level=1)  # imports ITK on the workers

        start = time.perf_counter()
        picture = mip(path, view, background=BACKGROUND)
        seconds = time.perf_counter() - start
        rows, columns = np.asarray(picture).shape
        print(
            f"{columns} x {rows} pixels of {picture.GetSpacing()[0]:.3g} micrometres: {1000 * seconds:.0f} ms, "
            f"{picture['BytesSent'] / 1e6:.1f} MB in pieces"
        )
        Image.fromarray(to_grey(np.asarray(picture))).save(arguments.folder / "mip.png")

        # the coarser resolution is enough
        axis = (0.0, 1.0, 0.0)
        series = turn(
            path,
            itk.ShearWarpMIPView.MakeUprightTransform(open_volume(path).make_image(), axis),
            frames=arguments.frames,
            rotation_axis=axis,
            output_spacing=2 * SPACING[2],
            background=BACKGROUND,
        )
        frames = np.asarray(series.frames)
        first, *others = (Image.fromarray(grey) for grey in to_grey(frames))
        first.save(arguments.folder / "turn.gif", save_all=True, append_images=others, duration=100, loop=0)
        print(f"{arguments.frames} frames of {frames.shape[2]} x {frames.shape[1]} pixels")


if __name__ == "__main__":
    main()

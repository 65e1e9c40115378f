#!/usr/bin/env python3
"""Projects the skewed stack of a light-sheet microscope as it is, and deskews it first, for comparison.

skewed_stack.py folder
skewed_stack.py folder --size 512 256 512 --angle 30

The folder gets skewed-stack.ome.zarr and pictures.png: above the projection of the stack as it is, below the projection
after deskewing.
"""

import argparse
import sys
import time
from pathlib import Path

import itk
import numpy as np
import zarr
from itk_shearwarpmip import mip, open_image
from PIL import Image

PIXEL, STEP = 0.4, 0.8  # micrometres: of the camera, and of the stage from image to image
BACKGROUND = 100
WIDTH = 0.7  # micrometres: the standard deviation of a filament's light


def make_direction(degrees: float) -> np.ndarray:
    """Columns: the camera's columns go along x, its rows into the sample, and the stage along y."""
    angle = np.radians(degrees)
    return np.array([[1, 0, 0], [0, np.cos(angle), 1], [0, -np.sin(angle), 0]])


def make_stack(shape: tuple[int, ...], axes: np.ndarray) -> np.ndarray:
    """Bent filaments with light of a Gaussian profile, as the camera sees them; axes: micrometres per voxel."""
    generator = np.random.default_rng(7)
    lengths = np.array(shape[::-1])
    place = generator.uniform(0, lengths, (40, 3)) @ axes.T
    direction, bend = generator.normal(size=(2, 40, 3))
    light = generator.uniform(800, 5000, 40)
    to_index = np.linalg.inv(axes)
    reach = np.ceil(4 * WIDTH * np.linalg.norm(to_index, axis=1)).astype(int)
    offsets = np.stack(np.meshgrid(*(np.arange(-r, r + 1) for r in reach), indexing="ij"), -1).reshape(-1, 3)
    stack = np.zeros(shape, np.float32)
    for _ in range(2 * int(max(lengths * np.linalg.norm(axes, axis=0)) / WIDTH)):
        bend = 0.95 * bend + 0.02 * generator.normal(size=bend.shape)
        direction += 0.1 * bend
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        place = place + WIDTH / 2 * direction
        index = place @ to_index.T
        voxels = np.rint(index).astype(int)[:, None] + offsets
        away = (voxels - index[:, None]) @ axes.T
        values = light[:, None] * np.exp(-np.square(away).sum(axis=-1) / (2 * WIDTH**2))
        inside = ((voxels >= 0) & (voxels < lengths)).all(axis=-1)
        np.maximum.at(stack, tuple(voxels[inside].T[::-1]), values[inside].astype(np.float32))
    noise = generator.normal(0, 4, shape)
    return np.rint(stack + BACKGROUND + noise).astype(np.uint16)


def write_stack(path: Path, stack: np.ndarray) -> None:
    """An OME-Zarr 0.5, which has no place for the shear: only distances along the axes."""
    group = zarr.open_group(path, mode="w", zarr_format=3)
    group.create_array("0", data=stack, chunks=(64,) * 3)
    steps = [{"type": "scale", "scale": [STEP, PIXEL, PIXEL]}]
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    datasets = [{"path": "0", "coordinateTransformations": steps}]
    group.attrs["ome"] = {"version": "0.5", "multiscales": [{"axes": axes, "datasets": datasets}]}


def deskew(stack: itk.Image) -> itk.Image:
    """Resamples the stack on a straight grid that holds all of it."""
    size = itk.size(stack)
    corners = np.array(
        [stack.TransformIndexToPhysicalPoint([int(n) for n in (np.array(size) - 1) * at]) for at in np.ndindex(2, 2, 2)]
    )
    first, last = corners.min(axis=0), corners.max(axis=0)
    return itk.resample_image_filter(
        stack,
        size=[int(n) for n in np.ceil((last - first) / PIXEL) + 1],
        output_origin=first,
        output_spacing=[PIXEL] * 3,
        default_pixel_value=BACKGROUND,
    )


def take_time(function, *arguments, **keywords):
    """The result, and the milliseconds of the second call of two."""
    function(*arguments, **keywords)
    start = time.perf_counter()
    result = function(*arguments, **keywords)
    return result, 1000 * (time.perf_counter() - start)


def to_grey(pixels: np.ndarray) -> np.ndarray:
    """8 bits; dim light is raised."""
    light = np.clip((pixels.astype(float) - BACKGROUND) / 4000, 0, 1)
    return (255 * light**0.7 + 0.5).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the image and the pictures go")
    parser.add_argument(
        "--size", type=int, nargs=3, default=(256, 128, 256), metavar=("Z", "Y", "X"), help="voxels [256 128 256]"
    )
    parser.add_argument("--angle", type=float, default=31.8, help="degrees between light sheet and stage [31.8]")
    arguments = parser.parse_args()
    if min(arguments.size) < 2 or not 0 < arguments.angle < 180:
        sys.exit("error: --size must be at least 2, and --angle between 0 and 180")
    try:
        arguments.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.exit(f"error: {arguments.folder} can't be made: {error.strerror}")
    path = arguments.folder / "skewed-stack.ome.zarr"
    direction = make_direction(arguments.angle)
    write_stack(path, make_stack(tuple(arguments.size), direction * [PIXEL, PIXEL, STEP]))

    # nothing else is needed
    stack = open_image(path, direction=direction)
    view = itk.ShearWarpMIPView.MakeTransform(stack, itk.ShearWarpMIPViewEnums.Direction_Left, 20.0, 35.0)
    picture, direct = take_time(mip, stack, view, background=BACKGROUND)

    straight, deskewing = take_time(deskew, stack)
    grid = {
        "size": itk.size(picture),
        "output_origin": picture.GetOrigin(),
        "output_spacing": picture.GetSpacing(),
    }
    of_straight, after = take_time(mip, straight, view, background=BACKGROUND, **grid)

    shown, expected = (np.asarray(each) for each in (picture, of_straight))
    difference = np.abs(shown.astype(float) - expected).mean() / (shown.max() - BACKGROUND)
    rows, columns = shown.shape
    print(f"{columns} x {rows} pixels of {picture.GetSpacing()[0]:.3g} micrometres")
    print(f"projected as it is: {direct:.0f} ms")
    voxels = np.asarray(straight).size / np.asarray(stack).size
    print(f"deskewed: {deskewing:.0f} ms, {voxels:.1f} times the voxels; then projected: {after:.0f} ms")
    print(f"mean difference of the pictures: {100 * difference:.2f} % of the brightest light")

    edge = np.full((6, columns), 255, np.uint8)
    panels = Image.fromarray(np.vstack([to_grey(shown), edge, to_grey(expected)]))
    panels.save(arguments.folder / "pictures.png", optimize=True)


if __name__ == "__main__":
    main()

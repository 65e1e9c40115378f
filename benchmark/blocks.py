#!/usr/bin/env python3
"""Measures how much of the contrast of thin vessels remains if blocks of voxels become one voxel, by their maximum or by
their mean, as pages that hold a volume need it. Needs the package, and an angiogram:

    shear-warp-mip --write-phantom angiogram.nrrd --phantom-size 512 512 256
    benchmark/blocks.py angiogram.nrrd [PICTURE]

Vessels are at most four pixels wide in the MIP of all voxels. Their contrast is the maximum of 5 x 5 pixels less the
20th percentile of 15 x 15; the program prints the median of its quotients. PICTURE is a PNG of a part of the MIPs: of
all voxels, of maxima and of means of blocks of 4 x 4 x 3.
"""

import sys
from collections.abc import Callable
from typing import Any

import itk
import numpy as np
from itk_shearwarpmip import mip
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

LEAST_CONTRAST = 60
BLOCKS = (2, 2, 1), (2, 2, 2), (4, 4, 3)


def make_blocks(image: Any, factors: tuple[int, ...], combine: Callable[..., Any]) -> Any:
    array = itk.array_view_from_image(image)
    steps = factors[::-1]
    padded = np.pad(array, [(0, -n % step) for n, step in zip(array.shape, steps, strict=True)], mode="edge")
    shape = [length for n, step in zip(padded.shape, steps, strict=True) for length in (n // step, step)]
    blocks = itk.image_from_array(np.rint(combine(padded.reshape(shape), axis=(1, 3, 5))).astype(array.dtype))
    spacing = np.array(image.GetSpacing())
    middle = itk.array_from_matrix(image.GetDirection()) @ (spacing * (np.array(factors) - 1) / 2)
    blocks.SetOrigin(image.GetOrigin() + middle)
    blocks.SetSpacing(spacing * factors)
    blocks.SetDirection(image.GetDirection())
    return blocks


def look_around(picture: NDArray[Any], size: int) -> NDArray[Any]:
    return sliding_window_view(np.pad(picture, size // 2, mode="edge"), (size, size))


def measure_contrast(picture: NDArray[Any]) -> NDArray[Any]:
    background = np.percentile(look_around(picture, 15).reshape(*picture.shape, -1), 20, axis=2)
    return look_around(picture, 5).max((2, 3)) - background


def find_thin(picture: NDArray[Any]) -> NDArray[np.bool_]:
    """The brightest pixels of what an opening by 5 x 5 pixels takes away."""
    opened = look_around(look_around(picture, 5).min((2, 3)), 5).max((2, 3))
    return (picture - opened > LEAST_CONTRAST) & (picture == look_around(picture, 3).max((2, 3)))


def main(path: str, output: str | None = None) -> None:
    image = itk.imread(path)
    whole = mip(image, azimuth=20, output_spacing=min(image.GetSpacing()))
    grid = {
        "view": np.reshape(whole["FrameTransforms"], (4, 4)),
        "output_spacing": list(whole.GetSpacing()),
        "size": list(itk.size(whole)),
        "output_origin": list(whole.GetOrigin()),
    }
    pictures = [itk.array_from_image(whole).astype(float)]
    thin = find_thin(pictures[0])
    contrast = measure_contrast(pictures[0])[thin]
    print(f"{np.count_nonzero(thin)} pixels of thin vessels\nblocks     maximum  mean")
    for factors in BLOCKS:
        reduced = [
            itk.array_from_image(mip(make_blocks(image, factors, combine), **grid)).astype(float)
            for combine in (np.max, np.mean)
        ]
        kept = [100 * np.median(measure_contrast(picture)[thin] / contrast) for picture in reduced]
        print(f"{' x '.join(map(str, factors))}  {kept[0]:5.0f} %  {kept[1]:3.0f} %")
    if output:
        low, high = np.percentile(pictures[0][pictures[0] > 0], [1, 99.8])
        row = np.hstack([picture[20:320, 60:460] for picture in pictures + reduced])
        grey = np.clip((row - low) / (high - low) * 255, 0, 255).astype(np.uint8)
        itk.imwrite(itk.image_from_array(grey), output)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3) or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    main(*sys.argv[1:])

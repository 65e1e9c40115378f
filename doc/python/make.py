#!/usr/bin/env python3
"""Makes the pictures of doc/python.md, from the program's phantom: make.py angiogram.nrrd (shear-warp-mip --write-phantom)."""

import sys
from pathlib import Path

import itk
import numpy as np
from itk_shearwarpmip import mip, open_image, save_png, turn

folder = Path(__file__).parent
head = open_image(sys.argv[1])


def write(name: str, picture: itk.Image) -> None:
    """As a notebook shows it."""
    (folder / f"{name}.png").write_bytes(picture._repr_png_())


save_png(mip(head, view="anterior", azimuth=30), folder / "labels.png", annotate=True)
write("mip", mip(head, view="anterior", azimuth=30))
write("slab", mip(head, view="superior", slab=(-20, 20)))
write("fading", mip(head, view="left", attenuation=0.02))
series = turn(head, frames=6, output_spacing=1.2)
row = itk.image_from_array(np.concatenate(np.asarray(series.frames), axis=1))
low, high = map(int, series.window)
picture_type = itk.Image[itk.UC, 2]
grey = itk.intensity_windowing_image_filter(
    row, window_minimum=low, window_maximum=high, ttype=(type(row), picture_type)
)
itk.imwrite(grey, folder / "turn.png")

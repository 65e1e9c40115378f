"""What all peers share: the image, the views, the grid of the picture, and what a peer has to do."""

from __future__ import annotations

import argparse
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np


class Volume:
    """A 3D image: voxels (z, y, x); spacing (x, y, z) in mm; direction cosines as columns. Its center is at (0, 0, 0).

    And the picture of it: `width` x `width` pixels of `step` mm. The first one's center is at (`first`, `first`) mm in
    u and v, so that the picture's is at (0, 0).
    """

    def __init__(self, voxels: np.ndarray, spacing: np.ndarray, direction: np.ndarray, name: str) -> None:
        self.voxels, self.spacing, self.direction, self.name = voxels, spacing, direction, name
        self.size = np.array(voxels.shape[::-1])  # along x, y and z
        self.center = (self.size - 1) / 2  # in voxels
        self.origin = -direction @ (self.center * spacing)  # of the first voxel, in mm
        self.diagonal = float(np.linalg.norm(self.size * spacing))  # in mm
        self.range = float(voxels.max()) - float(voxels.min())
        self.width = int(max(self.size[:2]))
        self.step = float(spacing.min())
        self.first = -(self.width - 1) / 2 * self.step


@dataclass(frozen=True)
class View:
    """Columns of `rotation` are the physical directions of u (right), v (down) and w (the rays)."""

    name: str
    rotation: np.ndarray

    @classmethod
    def parse(cls, text: str) -> View:
        """`y60+x20` is the rotation about y by 60 degrees times that about x by 20."""
        rotation = np.eye(3)
        for part in text.split("+"):
            match = re.fullmatch(r"([xyz])(-?\d+(?:\.\d*)?)", part)
            if not match:
                raise argparse.ArgumentTypeError(f"{text!r} is not a view such as y30 or y60+x20")
            axis, angle = "xyz".index(match[1]), math.radians(float(match[2]))
            cosine, sine = math.cos(angle), math.sin(angle)
            about_x = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
            rotation = rotation @ np.roll(about_x, axis, (0, 1))
        return cls(text, rotation)

    def to_index(self, volume: Volume) -> np.ndarray:
        """3 x 3 matrix from view space, in mm, to voxels (x, y, z) relative to the image's center."""
        return np.diag(1 / volume.spacing) @ volume.direction.T @ self.rotation

    def half_depth(self, volume: Volume) -> int:
        """How many steps reach from the center to the image's end along the rays."""
        along = np.abs(volume.direction.T @ self.rotation[:, 2])
        return math.ceil(along @ (volume.size * volume.spacing) / 2 / volume.step)


class Peer(ABC):
    """One way to a maximum intensity projection. Making a peer, from a volume and threads, hands it the image."""

    note = ""  # what belongs to the version

    def __init__(self, volume: Volume) -> None:
        self.volume = volume
        self.background = volume.voxels.min().item()

    @abstractmethod
    def project(self, view: View) -> None:
        """All that a new view needs; this is timed."""

    @abstractmethod
    def picture(self) -> np.ndarray:
        """The pixels, rows from the top down (v), columns from left to right (u)."""


def make_head(size: tuple[int, int, int]) -> Volume:
    """The synthetic angiogram that `shear-warp-mip --write-phantom` makes, with voxels of 1 mm."""
    program = shutil.which("shear-warp-mip", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if not program:
        raise ValueError("the program shear-warp-mip is not installed: give an image instead")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "head.mha"
        subprocess.run([program, "--write-phantom", file, "--phantom-size", *map(str, size)], check=True)
        return Volume(read_image(file).voxels, np.ones(3), np.eye(3), "x".join(map(str, size)))


def read_image(path: Path) -> Volume:
    """Any 3D scalar image that ITK reads; pixel types that our filter lacks become float."""
    import itk

    if not path.is_file():
        raise ValueError(f"{path} does not exist")
    try:
        image = itk.imread(str(path))
        voxels = itk.array_from_image(image)
    except (RuntimeError, KeyError, itk.TemplateTypeError):
        raise ValueError(f"{path} is not an image that ITK can read") from None
    if voxels.ndim != 3 or image.GetImageDimension() != 3:
        raise ValueError(f"{path} is not a scalar image of 3 dimensions")
    if min(voxels.shape) < 8:
        raise ValueError(f"{path} has fewer than 8 voxels along an axis")
    if voxels.dtype.name not in ("uint8", "int16", "uint16", "float32", "float64"):
        voxels = voxels.astype(np.float32)
    if not np.isfinite(voxels).all() or voxels.min() == voxels.max():
        raise ValueError(f"{path} is constant or has values that are not finite")
    return Volume(voxels, np.array(list(image.GetSpacing())), itk.array_from_matrix(image.GetDirection()), path.name)

"""What all peers share: the image, the views, the grid of the picture, and what a peer has to do."""

from __future__ import annotations

import argparse
import math
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SEED = 20020547


class Volume:
    """A 3D image: voxels (z, y, x); spacing (x, y, z) in mm; direction cosines as columns. Its centre is at (0, 0, 0).

    And the picture of it: `width` x `width` pixels of `step` mm; the first one's centre is at (`first`, `first`) mm in u
    and v, so that the picture's is at (0, 0).
    """

    def __init__(self, voxels: np.ndarray, spacing: np.ndarray, direction: np.ndarray, name: str) -> None:
        self.voxels, self.spacing, self.direction, self.name = voxels, spacing, direction, name
        self.size = np.array(voxels.shape[::-1])  # along x, y and z
        self.centre = (self.size - 1) / 2  # in voxels
        self.origin = -direction @ (self.centre * spacing)  # of the first voxel, in mm
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
            a, b = (axis + 1) % 3, (axis + 2) % 3
            turn = np.eye(3)
            turn[a, a] = turn[b, b] = math.cos(angle)
            turn[a, b], turn[b, a] = -math.sin(angle), math.sin(angle)
            rotation = rotation @ turn
        return cls(text, rotation)

    def to_index(self, volume: Volume) -> np.ndarray:
        """3 x 3 matrix from view space, in mm, to voxels (x, y, z) relative to the image's centre."""
        return np.diag(1 / volume.spacing) @ volume.direction.T @ self.rotation

    def half_depth(self, volume: Volume) -> int:
        """How many steps reach from the centre to the image's end along the rays."""
        along = np.abs(volume.direction.T @ self.rotation[:, 2])
        return math.ceil(along @ (volume.size * volume.spacing) / 2 / volume.step)


class Peer(ABC):
    """One way to a maximum intensity projection. Making a peer hands it the image."""

    note = ""  # what belongs to the version

    def __init__(self, volume: Volume, threads: int) -> None:
        self.volume, self.threads = volume, threads
        self.background = volume.voxels.min().item()

    @abstractmethod
    def project(self, view: View) -> None:
        """All that a new view needs; this is timed."""

    @abstractmethod
    def picture(self) -> np.ndarray:
        """The pixels, rows from the top down (v), columns from left to right (u)."""


def curves(random: np.random.Generator, start: np.ndarray, steps: int, wander: float) -> np.ndarray:
    """steps x count x 3 points, half a voxel apart, of smooth curves that begin at count x 3 points."""

    def unit(vectors: np.ndarray) -> np.ndarray:
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

    heading, position, points = unit(random.standard_normal(start.shape)), start.copy(), []
    for _ in range(steps):
        points.append(position)
        heading = unit(heading + wander * random.standard_normal(start.shape))
        position = position + 0.5 * heading
    return np.array(points)


def draw_tube(voxels: np.ndarray, points: np.ndarray, radius: float, value: float) -> None:
    """Raises the voxels within `radius` voxels of the points (x, y, z) to `value`, with soft edges."""
    reach = math.ceil(radius + 0.5)
    cube = np.indices((2 * reach + 1,) * 3).reshape(3, -1).T - reach
    index = np.rint(points).astype(int)[:, np.newaxis] + cube[np.linalg.norm(cube, axis=1) <= radius + 1.4]
    distance = np.linalg.norm(index - points[:, np.newaxis], axis=-1)
    painted = value * np.clip(radius + 0.5 - distance, 0, 1)
    inside = ((index >= 0) & (index < voxels.shape[::-1])).all(axis=-1)
    np.maximum.at(voxels, tuple(index[inside].T[::-1]), painted[inside].astype(voxels.dtype))


def angiogram(size: tuple[int, int, int]) -> Volume:
    """A synthetic angiogram of 12 bits and 1 mm, always the same: vessels in noisy tissue."""
    random = np.random.default_rng(SEED)
    voxels, width = np.zeros(size[::-1], np.uint16), max(size[:2])
    centre, radii = (np.array(size) - 1) / 2, np.array(size) * (0.43, 0.46, 0.62)

    trunks = curves(random, centre + radii * random.uniform(-0.6, 0.6, (8, 3)), 3 * width, 0.03)
    roots = trunks[random.integers(0, 2 * width, 48), random.integers(0, 8, 48)]
    for points, thickest in ((trunks, 0.014), (curves(random, roots, width, 0.06), 0.006)):
        within = (((points - centre) / radii) ** 2).sum(axis=-1) < 0.9
        for tube in range(points.shape[1]):
            radius = max(0.7, width * thickest * random.uniform(0.5, 1))
            draw_tube(voxels, points[within[:, tube], tube], radius, random.uniform(1200, 3000))

    x, y, z = (((np.arange(n) - c) / r) ** 2 for n, c, r in zip(size, centre, radii))
    for depth, plane in zip(z, voxels):
        tissue = np.where(x + y[:, np.newaxis] + depth < 1, 300, 40)
        noise = 40 * random.standard_normal(plane.shape, dtype=np.float32)
        plane[:] = np.clip(np.maximum(plane, tissue) + noise, 0, 4095)
    return Volume(voxels, np.ones(3), np.eye(3), "x".join(map(str, size)))


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

#!/usr/bin/env python3
"""The same image and the same views through other packages' maximum intensity projections.

Every peer projects one image onto the same grid: square, as wide as the larger of the image's x and
y, centred on the image's centre, at the image's smallest spacing (1 mm for the made image). Times
are those of what has to be run for each new view; imports, making the image and handing it to the
library are not counted. Each peer runs in a process of its own, so that one that crashes, hangs or
is not installed is a line of the table and no more.

Two checks, and exit status 1 if one fails:

  rule     The pixels of 1000 random rays against the peer's own sampling, computed here in NumPy.
           The largest difference may be a grey level and 1/8192 of the data's range. Only VTK's ray
           caster has a wider bound: 2 % of the range, for 99 % of the rays.
  picture  The difference from our picture, over all pixels whose rays cross the image. Its median
           may be 1 % of the data's range, its 99th percentile half of what our picture differs from
           itself when it is moved by a pixel. With --image it is told but not judged, because it
           depends on how rough the image is.

    pip install -r benchmark/peers-requirements.txt
    peers.py --output results
    peers.py --image head.nrrd --views y30 y90+x10 --peers ours itk --pictures --output results
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import importlib.metadata
import importlib.util
import json
import math
import multiprocessing
import os
import platform
import re
import signal
import statistics
import sys
import tempfile
import time
import traceback
from abc import ABC, abstractmethod
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from enum import Enum, auto
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

SEED = 20020547
RAYS = 1000
PHASES = 8  # of a peer's samples that are tried where they are not known
BUSY = 0.3  # cores that other programs use when times are not worth much
MEDIAN_BOUND = 0.01  # of a picture's difference from ours, as a part of the data's range
P99_BOUND = 0.5  # of it, as a part of what a move by one pixel makes


# ---------------------------------------------------------------------------------------- geometry


@dataclass(frozen=True)
class Volume:
    """A 3D image: voxels (z, y, x); spacing (x, y, z) in mm; direction cosines as columns."""

    voxels: np.ndarray
    spacing: np.ndarray
    direction: np.ndarray
    name: str

    @property
    def size(self) -> np.ndarray:
        """Voxels along x, y and z."""
        return np.array(self.voxels.shape[::-1])

    @property
    def origin(self) -> np.ndarray:
        """Position of the first voxel in mm, which puts the image's centre at (0, 0, 0)."""
        return -self.direction @ ((self.size - 1) / 2 * self.spacing)


@dataclass(frozen=True)
class View:
    """Columns of `rotation` are the physical directions of u (right), v (down) and w (the rays)."""

    name: str
    rotation: np.ndarray


@dataclass(frozen=True)
class Grid:
    """The output: size x size pixels of `spacing` mm, centred on (0, 0) of the view plane."""

    size: int
    spacing: float

    @property
    def first(self) -> float:
        """Position of the first pixel's centre, in mm, along u and along v."""
        return -(self.size - 1) / 2 * self.spacing


def parse_view(text: str) -> View:
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
    return View(text, rotation)


def view_to_index(volume: Volume, view: View) -> np.ndarray:
    """3 x 3 matrix from view space, in mm, to voxels relative to the centre."""
    return np.diag(1 / volume.spacing) @ volume.direction.T @ view.rotation


def half_depth(volume: Volume, view: View, step: float) -> int:
    """How many steps of `step` mm reach from the centre to the image's end along the rays."""
    along = np.abs(volume.direction.T @ view.rotation[:, 2])
    return math.ceil(along @ (volume.size * volume.spacing) / 2 / step)


# -------------------------------------------------------------------------------------------- data


def smooth_curves(random: np.random.Generator, start: np.ndarray, steps: int, wander: float) -> np.ndarray:
    """steps x count x 3 points, half a voxel apart, of curves that begin at count x 3 points."""

    def unit(vectors: np.ndarray) -> np.ndarray:
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

    heading = unit(random.standard_normal(start.shape))
    points = np.empty((steps, *start.shape))
    position = start.astype(float)
    for step in range(steps):
        points[step] = position
        heading = unit(heading + wander * random.standard_normal(start.shape))
        position = position + 0.5 * heading
    return points


def draw_tube(voxels: np.ndarray, points: np.ndarray, radius: float, value: float) -> None:
    """Raises the voxels within `radius` voxels of the points (x, y, z) to `value`, softly edged."""
    reach = math.ceil(radius + 0.5)
    cube = np.mgrid[-reach : reach + 1, -reach : reach + 1, -reach : reach + 1].reshape(3, -1)
    offsets = cube.T[np.linalg.norm(cube, axis=0) <= radius + 1.4]
    limit = np.array(voxels.shape[::-1])
    nearest = np.rint(points).astype(int)
    index = nearest[:, np.newaxis] + offsets
    distance = np.linalg.norm(index - points[:, np.newaxis], axis=-1)
    painted = value * np.clip(radius + 0.5 - distance, 0, 1)
    inside = ((index >= 0) & (index < limit)).all(axis=-1) & (painted > 0)
    x, y, z = index[inside].T
    flat = (z * limit[1] + y) * limit[0] + x
    np.maximum.at(voxels.reshape(-1), flat, painted[inside].astype(voxels.dtype))


def angiogram(size: tuple[int, int, int]) -> Volume:
    """A synthetic angiogram of 12 bits, always the same: vessels in noisy tissue."""
    random = np.random.default_rng(SEED)
    extent = np.array(size)
    voxels = np.zeros(size[::-1], np.uint16)
    width = max(size[:2])
    centre, radii = (extent - 1) / 2, extent * (0.43, 0.46, 0.62)

    trunks = centre + radii * random.uniform(-0.6, 0.6, (8, 3))
    trunk_points = smooth_curves(random, trunks, 3 * width, 0.03)
    roots = trunk_points[random.integers(0, 2 * width, 48), random.integers(0, 8, 48)]
    branch_points = smooth_curves(random, roots, width, 0.06)
    for points, thickest in ((trunk_points, 0.014), (branch_points, 0.006)):
        for tube in range(points.shape[1]):
            line = points[:, tube]
            line = line[(((line - centre) / radii) ** 2).sum(axis=1) < 0.9]
            radius = width * thickest * random.uniform(0.5, 1)
            draw_tube(voxels, line, max(0.7, radius), random.uniform(1200, 3000))

    x, y, z = (np.arange(n, dtype=np.float32) for n in size)
    flat = ((x - centre[0]) / radii[0]) ** 2 + (((y - centre[1]) / radii[1]) ** 2)[:, np.newaxis]
    for k, slice_ in enumerate(voxels):
        tissue = np.where(flat + ((z[k] - centre[2]) / radii[2]) ** 2 < 1, 300, 40)
        noise = 40 * random.standard_normal(slice_.shape, dtype=np.float32)
        slice_[:] = np.clip(np.maximum(slice_, tissue) + noise, 0, 4095)
    return Volume(voxels, np.ones(3), np.eye(3), "x".join(map(str, size)))


def read_image(path: Path) -> Volume:
    """Any 3D scalar image that ITK reads; pixel types that our filter lacks become float."""
    try:
        import itk
    except ImportError:
        sys.exit("error: --image needs the package itk")
    if not path.is_file():
        sys.exit(f"error: {path} does not exist")
    try:
        image = itk.imread(str(path))
        voxels = itk.array_from_image(image)
    except (RuntimeError, KeyError, itk.TemplateTypeError):
        sys.exit(f"error: {path} is not an image that ITK can read")
    if voxels.ndim != 3 or image.GetImageDimension() != 3:
        sys.exit(f"error: {path} is not a scalar image of 3 dimensions")
    if min(voxels.shape) < 8:
        sys.exit(f"error: {path} has fewer than 8 voxels along an axis")
    if voxels.dtype.name not in ("uint8", "int16", "uint16", "float32", "float64"):
        voxels = voxels.astype(np.float32)
    if not np.isfinite(voxels).all() or voxels.min() == voxels.max():
        sys.exit(f"error: {path} is constant or has values that are not finite")
    direction = itk.array_from_matrix(image.GetDirection())
    return Volume(voxels, np.array(list(image.GetSpacing())), direction, path.name)


# --------------------------------------------------------------------------------------- reference


class Sampling(Enum):
    """Where along a ray a peer samples, always interpolating linearly between voxels."""

    STEPS = auto()  # at whole multiples of the output's spacing from the view plane's centre
    DRAWN_STEPS = auto()  # at such steps from an unknown start; then drawn (see Drawing)
    SLICES = auto()  # once in every slice across the ray's principal axis
    SHEAR_WARP = auto()  # as SLICES, on four rays around it, which are then interpolated


@dataclass(frozen=True)
class Rays:
    """Random rays of one view: pixel columns and rows, and their (u, v) in mm."""

    columns: np.ndarray
    rows: np.ndarray
    u: np.ndarray
    v: np.ndarray


@dataclass(frozen=True)
class Drawing:
    """How VTK draws an image of rays, whose first column is `left`, whose lowest row is `bottom`.

    The middles of its first and last pixels are drawn at the edges of the area that it fills,
    with linear interpolation: the picture is wider than it should be by one pixel.
    """

    left: int
    bottom: int
    width: int
    height: int

    def columns(self, columns: np.ndarray) -> np.ndarray:
        """The columns of rays, as fractions, that are seen in columns of the picture."""
        return self.left + (columns - self.left + 0.5) * (self.width - 1) / self.width

    def rows(self, rows: np.ndarray, size: int) -> np.ndarray:
        """The same for rows, from the top, of a picture that has `size` rows."""
        above = size - 1 - rows - self.bottom + 0.5
        return size - 1 - self.bottom - above * (self.height - 1) / self.height


def covered(volume: Volume, view: View, grid: Grid) -> np.ndarray:
    """Which pixels' rays run two pixels or more within the image, less a voxel on every side."""
    matrix = view_to_index(volume, view)
    half = (volume.size - 1) / 2 - 1
    u = grid.first + grid.spacing * np.arange(grid.size)
    near = np.full((grid.size, grid.size), -np.inf)
    far = np.full((grid.size, grid.size), np.inf)
    for (a, b, c), reach in zip(matrix, half):
        position = a * u + b * u[:, np.newaxis]
        if abs(c) < 1e-12:
            far[np.abs(position) > reach] = -np.inf
            continue
        ends = np.sort([(-reach - position) / c, (reach - position) / c], axis=0)
        near, far = np.maximum(near, ends[0]), np.minimum(far, ends[1])
    return far - near >= 2 * grid.spacing


def rays_of(columns: np.ndarray, rows: np.ndarray, grid: Grid) -> Rays:
    """Rays of pixels."""
    u, v = grid.first + grid.spacing * columns, grid.first + grid.spacing * rows
    return Rays(columns, rows, u, v)


def random_rays(mask: np.ndarray, grid: Grid) -> Rays:
    """Rays of the pixels in the mask, the same ones every time."""
    rows, columns = np.nonzero(mask)
    chosen = np.random.default_rng(SEED).permutation(rows.size)[:RAYS]
    rows, columns = rows[chosen], columns[chosen]
    return rays_of(columns, rows, grid)


def sample(voxels: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear interpolation at positions (..., 3) in voxels (x, y, z): inside, and at the border.

    Samples in the outermost layer of cells or beyond are -inf in the first, the others in the
    second.
    """
    limit = np.array(voxels.shape[::-1])
    within = ((index >= -0.5) & (index <= limit - 0.5)).all(axis=-1)
    border = ((index < 1) | (index > limit - 2)).any(axis=-1)
    position = np.clip(index, 0, limit - 1)
    low = np.minimum(position.astype(int), np.maximum(limit - 2, 0))
    weight = position - low
    high = np.minimum(low + 1, limit - 1)
    values = np.zeros(index.shape[:-1])
    for corner in range(8):
        part = np.ones(index.shape[:-1])
        at = []
        for axis in range(3):
            upper = corner >> axis & 1
            at.append((high if upper else low)[..., axis])
            part *= weight[..., axis] if upper else 1 - weight[..., axis]
        values += part * voxels[at[2], at[1], at[0]]
    return (
        np.where(within & ~border, values, -np.inf),
        np.where(within & border, values, -np.inf),
    )


def stepped_maximum(volume: Volume, view: View, grid: Grid, rays: Rays, phases: int) -> tuple[np.ndarray, np.ndarray]:
    """Maxima (rays x phases) of samples a spacing apart; and of those at the image's border (rays).

    Phase p is displaced along the rays by p / phases of a step.
    """
    matrix = view_to_index(volume, view)
    count = half_depth(volume, view, grid.spacing)
    w = grid.spacing / phases * np.arange(-count * phases, (count + 1) * phases)
    inside = np.empty((rays.u.size, phases))
    border = np.empty(rays.u.size)
    for some in np.array_split(np.arange(rays.u.size), max(1, rays.u.size * w.size // 400_000)):
        across = matrix[:, :2] @ [rays.u[some], rays.v[some]]
        index = across.T[:, np.newaxis] + w[:, np.newaxis] * matrix[:, 2]
        values, edges = sample(volume.voxels, index + (volume.size - 1) / 2)
        inside[some] = values.reshape(some.size, -1, phases).max(axis=1)
        border[some] = edges.max(axis=1)
    return inside, border


def slice_maximum(volume: Volume, direction: np.ndarray, axis: int, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Maxima of one sample per slice, inside and at the border, of rays that start in slice 0.

    `start` (rays x 3) and `direction` are in voxels (x, y, z); the direction's `axis` is 1.
    """
    slices = np.arange(volume.size[axis])[:, np.newaxis]
    inside, border = np.empty(len(start)), np.empty(len(start))
    for some in np.array_split(np.arange(len(start)), max(1, len(start) * slices.size // 400_000)):
        values, edges = sample(volume.voxels, start[some][:, np.newaxis] + slices * direction)
        inside[some], border[some] = values.max(axis=1), edges.max(axis=1)
    return inside, border


def principal_rays(volume: Volume, view: View, rays: Rays) -> tuple[int, np.ndarray, np.ndarray]:
    """Principal axis, direction (that axis is 1) and where the rays meet slice 0, in voxels."""
    matrix = view_to_index(volume, view)
    axis = max((2, 1, 0), key=lambda n: abs(matrix[n, 2]))
    direction = matrix[:, 2] / matrix[axis, 2]
    point = (matrix[:, :2] @ [rays.u, rays.v]).T + (volume.size - 1) / 2
    return axis, direction, point - point[:, [axis]] * direction


def shear_warp_maximum(volume: Volume, view: View, rays: Rays) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear mean of the maxima along the four rays around each ray that meet the sheared grid.

    Along an axis of the sheared grid, its nodes are the voxels of the first slice where the
    slices move to higher positions, and those of the last slice where they move to lower ones.
    """
    axis, direction, start = principal_rays(volume, view, rays)
    phase = np.where(direction > 0, direction * (volume.size[axis] - 1), 0.0)
    phase[axis] = 0.0
    position = start + phase
    node = np.floor(position)
    weight = position - node
    node[:, axis] = weight[:, axis] = 0.0
    inside, border = np.zeros(len(start)), np.full(len(start), -np.inf)
    others = [n for n in range(3) if n != axis]
    for corner in np.ndindex(2, 2):
        step = np.zeros(3)
        step[others] = corner
        part = np.prod(np.where(step, weight, 1 - weight)[:, others], axis=1)
        values, edges = slice_maximum(volume, direction, axis, node + step - phase)
        inside += np.multiply(part, values, out=np.zeros_like(part), where=part > 0)
        # of a node whose own maximum is at the border the mean is not known
        border[(part > 0) & (edges >= values)] = np.inf
    return inside, border


def drawn_bounds(
    volume: Volume, view: View, grid: Grid, rays: Rays, drawing: Drawing
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least and greatest maxima of samples that start anywhere, as drawn; those at the border."""
    columns, rows = drawing.columns(rays.columns), drawing.rows(rays.rows, grid.size)
    low, high = np.zeros(columns.size), np.zeros(columns.size)
    border = np.full(columns.size, -np.inf)
    for right, down in np.ndindex(2, 2):
        column, row = np.floor(columns) + right, np.floor(rows) + down
        part = (1 - abs(columns - column)) * (1 - abs(rows - row))
        inside, edges = stepped_maximum(volume, view, grid, rays_of(column, row, grid), PHASES)
        least, greatest = inside.min(axis=1), inside.max(axis=1)
        low += np.multiply(part, least, out=np.zeros_like(low), where=part > 0)
        high += np.multiply(part, greatest, out=np.zeros_like(high), where=part > 0)
        border[(part > 0) & (edges >= least)] = np.inf
    return low, high, border


def reference(
    sampling: Sampling,
    volume: Volume,
    view: View,
    grid: Grid,
    rays: Rays,
    drawing: Drawing | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the pixels of the rays are at least and at most, and for which of them this is known.

    The outermost voxels are treated differently by all, so that a maximum found there decides
    nothing.
    """
    if sampling is Sampling.DRAWN_STEPS:
        assert drawing
        low, high, border = drawn_bounds(volume, view, grid, rays, drawing)
        return low, high, border < low
    if sampling is Sampling.STEPS:
        inside, border = stepped_maximum(volume, view, grid, rays, 1)
        values = inside[:, 0]
    elif sampling is Sampling.SLICES:
        axis, direction, start = principal_rays(volume, view, rays)
        values, border = slice_maximum(volume, direction, axis, start)
    else:
        values, border = shear_warp_maximum(volume, view, rays)
    return values, values, border < values


# ------------------------------------------------------------------------------------------- peers


@dataclass(frozen=True)
class Bound:
    """The most that a percentile of the rays may differ from the peer's own sampling.

    Grey levels of an integer type, and in addition a part of the data's range.
    """

    grey: float = 1.0
    part: float = 1 / 8192
    percentile: float = 100.0


class Peer(ABC):
    """One way to a maximum intensity projection.

    Making a peer imports its library and hands it the image. `start` drops what earlier views left;
    `project` is all that a new view needs, and is timed; `picture` fetches the pixels.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    package: ClassVar[str]
    sampling: ClassVar[Sampling] = Sampling.STEPS
    bound: ClassVar[Bound] = Bound()
    lowest: ClassVar[float] = -math.inf  # smaller maxima are lost, and come out as this

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        self.volume, self.grid, self.threads = volume, grid, threads
        self.background = volume.voxels.min().item()

    @abstractmethod
    def start(self) -> None: ...

    @abstractmethod
    def project(self, view: View) -> None: ...

    @abstractmethod
    def picture(self) -> np.ndarray:
        """Rows from the top down (v), columns from left to right (u)."""

    def notes(self) -> dict[str, Any]:
        """What is worth knowing of the last projection."""
        return {}


class ItkPeer(Peer):
    """What the peers that run on ITK share."""

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        import itk

        self.itk = itk
        itk.MultiThreaderBase.SetGlobalMaximumNumberOfThreads(threads)
        itk.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(threads)

    def image(self, voxels: np.ndarray) -> Any:
        """The voxels, which must outlive it, as an image that has the volume's geometry."""
        image = self.itk.image_view_from_array(voxels)
        image.SetSpacing(self.volume.spacing.tolist())
        image.SetOrigin(self.volume.origin.tolist())
        image.SetDirection(self.itk.matrix_from_array(np.ascontiguousarray(self.volume.direction)))
        return image

    def transform(self, view: View) -> Any:
        """View space to physical space."""
        transform = self.itk.AffineTransform[self.itk.D, 3].New()
        transform.SetMatrix(self.itk.matrix_from_array(np.ascontiguousarray(view.rotation)))
        return transform


class Ours(ItkPeer):
    """itk::ShearWarpMIPImageFilter: one filter, whose transform is changed."""

    key = "ours"
    title = "ShearWarpMIP"
    package = "itk-shearwarpmip"
    sampling = Sampling.SHEAR_WARP

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        self.input = self.image(volume.voxels)
        self.start()

    def start(self) -> None:
        self.filter = self.itk.ShearWarpMIPImageFilter.New(self.input)
        self.filter.SetNumberOfWorkUnits(self.threads)
        self.filter.SetSize([self.grid.size] * 2)
        self.filter.SetOutputSpacing([self.grid.spacing] * 2)
        self.filter.SetOutputOrigin([self.grid.first] * 2)
        self.filter.SetDefaultPixelValue(self.background)

    def project(self, view: View) -> None:
        self.filter.SetTransform(self.transform(view))
        self.filter.Update()

    def picture(self) -> np.ndarray:
        return self.itk.array_from_image(self.filter.GetOutput())

    def notes(self) -> dict[str, Any]:
        return {
            "instruction set": self.filter.GetInstructionSet(),
            "principal axis": "xyz"[self.filter.GetPrincipalAxis()],
            "skipped": self.filter.GetSkippedFraction(),
        }


class ResampleAndMaximum(ItkPeer):
    """The whole volume resampled onto a grid in view space, then the maximum along it."""

    key = "itk"
    title = "ITK Resample + MaximumProjection"
    package = "itk"

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        self.input = self.image(volume.voxels)
        self.start()

    def start(self) -> None:
        itk = self.itk
        volume_type = type(self.input)
        pixel_type = itk.template(volume_type)[1][0]
        self.resample = itk.ResampleImageFilter[volume_type, volume_type].New(self.input)
        interpolator = itk.LinearInterpolateImageFunction[volume_type, itk.D].New()
        self.resample.SetInterpolator(interpolator)
        self.resample.SetDefaultPixelValue(self.background)
        self.resample.SetOutputSpacing([self.grid.spacing] * 3)
        picture_type = itk.Image[pixel_type, 2]
        self.maximum = itk.MaximumProjectionImageFilter[volume_type, picture_type].New()
        self.maximum.SetInput(self.resample.GetOutput())
        self.maximum.SetProjectionDimension(2)

    def project(self, view: View) -> None:
        depth = half_depth(self.volume, view, self.grid.spacing)
        self.resample.SetSize([self.grid.size, self.grid.size, 2 * depth + 1])
        self.resample.SetOutputOrigin([self.grid.first] * 2 + [-depth * self.grid.spacing])
        self.resample.SetTransform(self.transform(view))
        self.maximum.UpdateLargestPossibleRegion()

    def picture(self) -> np.ndarray:
        return self.itk.array_from_image(self.maximum.GetOutput())


class Rtk(ItkPeer):
    """RTK's maximum intensity projector (Joseph's method) in parallel geometry.

    It starts from zero, so that negative maxima are lost, and multiplies the maximum by the
    length in mm of a ray's step from slice to slice, which is divided out again here.
    """

    key = "rtk"
    title = "RTK MaximumIntensityProjection"
    package = "itk-rtk"
    sampling = Sampling.SLICES
    lowest = 0.0

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        # the classes' own modules: itk.RTK imports most of ITK too, for 15 s
        from itk import rtkMaximumIntensityProjectionImageFilterPython as projector
        from itk import rtkThreeDCircularProjectionGeometryPython as geometry

        self.new_filter = projector.rtkMaximumIntensityProjectionImageFilterIF3IF3.New
        self.new_geometry = geometry.rtkThreeDCircularProjectionGeometry.New
        self.voxels = volume.voxels.astype(np.float32)
        self.input = self.image(self.voxels)
        self.start()

    def start(self) -> None:
        self.zeros = np.zeros((1, self.grid.size, self.grid.size), np.float32)
        detector = self.itk.image_view_from_array(self.zeros)
        detector.SetSpacing([self.grid.spacing] * 3)
        detector.SetOrigin([self.grid.first, self.grid.first, 0.0])
        self.filter = self.new_filter()
        self.filter.InPlaceOff()
        self.filter.SetInput(0, detector)
        self.filter.SetInput(1, self.input)

    def project(self, view: View) -> None:
        distance = float(np.linalg.norm(self.volume.size * self.volume.spacing))
        gantry, out_of_plane, in_plane = self.angles(view.rotation)
        geometry = self.new_geometry()
        geometry.AddProjectionInRadians(distance, 0.0, gantry, 0.0, 0.0, out_of_plane, in_plane, 0.0, 0.0)
        self.filter.SetGeometry(geometry)
        self.filter.Update()
        ray = view_to_index(self.volume, view)[:, 2]
        self.step = 1 / np.abs(ray).max()

    def picture(self) -> np.ndarray:
        return self.itk.array_from_image(self.filter.GetOutput())[0] / self.step

    @staticmethod
    def angles(rotation: np.ndarray) -> tuple[float, float, float]:
        """Radians about y, x and z, whose rotations in this order are the given one."""
        about_x = math.asin(np.clip(-rotation[1, 2], -1, 1))
        if math.cos(about_x) < 1e-9:
            return math.atan2(-rotation[2, 0], rotation[0, 0]), about_x, 0.0
        about_y = math.atan2(rotation[0, 2], rotation[2, 2])
        return about_y, about_x, math.atan2(rotation[1, 0], rotation[1, 1])


class Scipy(Peer):
    """scipy.ndimage.affine_transform of the whole volume, linear, then the maximum.

    It has no threads of its own: bands of rows are given to threads, as its user would have to do.
    """

    key = "scipy"
    title = "SciPy affine_transform + max"
    package = "scipy"

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        from scipy import ndimage

        self.ndimage = ndimage
        self.bands = np.array_split(np.arange(grid.size), threads)
        self.pool = ThreadPoolExecutor(threads)

    def start(self) -> None:
        self.result = np.empty((self.grid.size, self.grid.size), self.volume.voxels.dtype)

    def project(self, view: View) -> None:
        # indices (z, y, x) of the volume from those (w, v, u) of the rotated volume
        matrix = (view_to_index(self.volume, view) * self.grid.spacing)[::-1, ::-1]
        depth = half_depth(self.volume, view, self.grid.spacing)
        middle = np.array([depth, (self.grid.size - 1) / 2, (self.grid.size - 1) / 2])
        offset = (np.array(self.volume.voxels.shape) - 1) / 2 - matrix @ middle

        def project_band(rows: np.ndarray) -> None:
            rotated = self.ndimage.affine_transform(
                self.volume.voxels,
                matrix,
                offset + matrix[:, 1] * rows[0],
                output_shape=(2 * depth + 1, rows.size, self.grid.size),
                order=1,
                cval=self.background,
                prefilter=False,
            )
            rotated.max(axis=0, out=self.result[rows[0] : rows[-1] + 1])

        list(self.pool.map(project_band, self.bands))

    def picture(self) -> np.ndarray:
        return self.result.copy()


class VtkPeer(Peer):
    """What the peers that run on VTK share: the image, centred on 0, along the space's axes."""

    package = "vtk"

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        from vtkmodules.util.numpy_support import numpy_to_vtk
        from vtkmodules.vtkCommonCore import vtkMultiThreader, vtkSMPTools
        from vtkmodules.vtkCommonDataModel import vtkImageData

        vtkMultiThreader.SetGlobalMaximumNumberOfThreads(threads)
        vtkMultiThreader.SetGlobalDefaultNumberOfThreads(threads)
        vtkSMPTools.Initialize(threads)
        self.input = vtkImageData()
        self.input.SetDimensions(*volume.size.tolist())
        self.input.SetSpacing(*volume.spacing)
        self.input.SetOrigin(*(-(volume.size - 1) / 2 * volume.spacing))
        self.input.GetPointData().SetScalars(numpy_to_vtk(volume.voxels.reshape(-1)))

    def axes(self, view: View) -> np.ndarray:
        """Directions of u, v and w as columns, along the image's axes."""
        return self.volume.direction.T @ view.rotation


class VtkSlab(VtkPeer):
    """vtkImageSlabReslice, its slab as thick as the whole image."""

    key = "vtk-slab"
    title = "VTK ImageSlabReslice"

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        self.start()

    def start(self) -> None:
        from vtkmodules.vtkImagingGeneral import vtkImageSlabReslice

        last = self.grid.size - 1
        self.reslice = vtkImageSlabReslice()
        self.reslice.SetInputData(self.input)
        self.reslice.SetNumberOfThreads(self.threads)
        self.reslice.SetInterpolationModeToLinear()
        self.reslice.SetBlendModeToMax()
        self.reslice.SetBackgroundLevel(self.background)
        self.reslice.SetOutputDimensionality(2)
        self.reslice.SetOutputSpacing(*[self.grid.spacing] * 3)
        self.reslice.SetOutputOrigin(self.grid.first, self.grid.first, 0.0)
        self.reslice.SetOutputExtent(0, last, 0, last, 0, 0)
        self.reslice.SetSlabResolution(self.grid.spacing)

    def project(self, view: View) -> None:
        from vtkmodules.vtkCommonMath import vtkMatrix4x4

        matrix = vtkMatrix4x4()
        for (row, column), value in np.ndenumerate(self.axes(view)):
            matrix.SetElement(row, column, value)
        depth = half_depth(self.volume, view, self.grid.spacing)
        self.reslice.SetResliceAxes(matrix)
        self.reslice.SetSlabThickness(2 * depth * self.grid.spacing)
        self.reslice.Update()

    def picture(self) -> np.ndarray:
        from vtkmodules.util.numpy_support import vtk_to_numpy

        scalars = self.reslice.GetOutput().GetPointData().GetScalars()
        return vtk_to_numpy(scalars).reshape(self.grid.size, self.grid.size).copy()


class VtkRayCast(VtkPeer):
    """vtkFixedPointVolumeRayCastMapper, in an off-screen window.

    Its picture is 8 bits of grey from the least to the largest value of the image, and is drawn a
    pixel too wide (see Drawing). Where a ray's first sample lies is not known: the check is by
    how much a pixel is out of the range of what there may be.
    """

    key = "vtk-raycast"
    title = "VTK FixedPointVolumeRayCast"
    sampling = Sampling.DRAWN_STEPS
    bound = Bound(part=0.02, percentile=99.0)

    def __init__(self, volume: Volume, grid: Grid, threads: int) -> None:
        super().__init__(volume, grid, threads)
        self.low, self.high = float(volume.voxels.min()), float(volume.voxels.max())
        self.try_window()

    def try_window(self) -> None:
        """Fails, or crashes, if nothing can be drawn here."""
        import vtkmodules.vtkRenderingOpenGL2
        import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401

        self.start()
        self.renderer.RemoveAllViewProps()
        self.renderer.SetBackground(1.0, 1.0, 1.0)
        self.window.Render()
        self.read_window()
        if self.pixels.GetNumberOfValues() == 0 or self.pixels.GetValue(0) != 255:
            raise RuntimeError(f"{self.window.GetClassName()} draws nothing")

    def read_window(self) -> None:
        """Fetches the colours, from the lowest row upwards."""
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        last = self.grid.size - 1
        self.pixels = vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, last, last, 0, self.pixels, 0)

    def start(self) -> None:
        from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
        from vtkmodules.vtkRenderingCore import (
            vtkRenderer,
            vtkRenderWindow,
            vtkVolume,
            vtkVolumeProperty,
        )
        from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper

        grey, opacity = vtkPiecewiseFunction(), vtkPiecewiseFunction()
        grey.AddPoint(self.low, 0.0)
        grey.AddPoint(self.high, 1.0)
        opacity.AddPoint(self.low, 1.0)
        opacity.AddPoint(self.high, 1.0)
        properties = vtkVolumeProperty()
        properties.SetColor(grey)
        properties.SetScalarOpacity(opacity)
        properties.SetInterpolationTypeToLinear()
        properties.ShadeOff()

        mapper = vtkFixedPointVolumeRayCastMapper()
        mapper.SetInputData(self.input)
        mapper.SetNumberOfThreads(self.threads)
        mapper.SetBlendModeToMaximumIntensity()
        mapper.AutoAdjustSampleDistancesOff()
        mapper.SetImageSampleDistance(1.0)
        mapper.SetSampleDistance(self.grid.spacing)
        mapper.SetInteractiveSampleDistance(self.grid.spacing)

        self.mapper = mapper
        prop = vtkVolume()
        prop.SetMapper(mapper)
        prop.SetProperty(properties)
        self.renderer = vtkRenderer()
        self.renderer.AddVolume(prop)
        self.window = vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(self.grid.size, self.grid.size)
        self.window.AddRenderer(self.renderer)

    def project(self, view: View) -> None:
        axes = self.axes(view)
        distance = float(np.linalg.norm(self.volume.size * self.volume.spacing))
        camera = self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(0.0, 0.0, 0.0)
        camera.SetPosition(*(-distance * axes[:, 2]))
        camera.SetViewUp(*-axes[:, 1])
        camera.SetParallelScale(self.grid.size * self.grid.spacing / 2)
        camera.SetClippingRange(distance / 100, 2 * distance)
        self.window.Render()
        self.read_window()

    def picture(self) -> np.ndarray:
        from vtkmodules.util.numpy_support import vtk_to_numpy

        grey = vtk_to_numpy(self.pixels).reshape(self.grid.size, self.grid.size, 3)[::-1, :, 0]
        return self.low + grey / 255.0 * (self.high - self.low)

    def notes(self) -> dict[str, Any]:
        rays = self.mapper.GetRayCastImage()
        drawing = Drawing(*rays.GetImageOrigin(), *rays.GetImageInUseSize())
        return {"window": self.window.GetClassName(), "drawing": asdict(drawing)}


PEERS: dict[str, type[Peer]] = {peer.key: peer for peer in (Ours, Rtk, VtkRayCast, VtkSlab, ResampleAndMaximum, Scipy)}


# --------------------------------------------------------------------------------------- measuring


@dataclass
class Result:
    """One peer, one image, one view. Times in ms; differences are parts of the data's range.

    `cores` is the peer's processor time by time, `others` that of all other programs meanwhile,
    which is not known for what is over at once.
    """

    image: str
    view: str
    peer: str
    version: str
    first_ms: float
    times_ms: list[float]
    cores: float
    others: float | None
    notes: dict[str, Any]
    picture: np.ndarray = field(repr=False)
    ratio: float | None = None
    rule: float | None = None
    rule_bound: float | None = None
    rays: int = 0
    median: float | None = None
    p99: float | None = None
    passed: bool = True

    @property
    def minimum_ms(self) -> float:
        return min(self.times_ms)

    @property
    def median_ms(self) -> float:
        return statistics.median(self.times_ms)


@dataclass(frozen=True)
class Problem:
    """Why a peer gave nothing for an image: not available here, or failed (which counts)."""

    image: str
    peer: str
    reason: str
    failed: bool


@dataclass(frozen=True)
class Job:
    """What a peer's process needs to know."""

    peer: str
    voxels: Path
    log: Path
    spacing: np.ndarray
    direction: np.ndarray
    name: str
    grid: Grid
    views: list[View]
    threads: int
    repetitions: int
    budget: float


def machine_seconds() -> float | None:
    """Processor time, in s, that all programs have had; None where the system does not tell."""
    try:
        fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    except OSError:
        return None
    user, nice, system, _, _, *others = map(int, fields[1:9])
    return (user + nice + system + sum(others)) / os.sysconf("SC_CLK_TCK")


def clock(peer: Peer, view: View) -> tuple[float, float]:
    """Seconds by the clock and of all processors that one projection takes."""
    processor, start = time.process_time(), time.perf_counter()
    peer.project(view)
    return time.perf_counter() - start, time.process_time() - processor


def measure(peer: Peer, view: View, repetitions: int, budget: float) -> dict[str, Any]:
    """The first projection of a view, then others until `repetitions` or `budget` s are spent.

    A peer whose first projection alone spends the budget is timed by that one.
    """
    machine_before, own_before, before = machine_seconds(), time.process_time(), time.perf_counter()
    peer.start()
    first, first_processor = clock(peer, view)
    runs: list[tuple[float, float]] = []
    while len(runs) < repetitions and first + sum(run[0] for run in runs) < budget:
        runs.append(clock(peer, view))
    runs = runs or [(first, first_processor)]
    own, elapsed = time.process_time() - own_before, time.perf_counter() - before
    machine_after = machine_seconds()
    others = None
    # the machine's time is counted in hundredths of a second
    if machine_before is not None and machine_after is not None and elapsed > 0.3:
        others = max(0.0, (machine_after - machine_before - own) / elapsed)
    return {
        "view": view.name,
        "first_ms": 1000 * first,
        "times_ms": [1000 * run[0] for run in runs],
        "cores": sum(run[1] for run in runs) / sum(run[0] for run in runs),
        "others": others,
        "picture": peer.picture(),
        "notes": peer.notes(),
    }


def work(job: Job, connection: Connection) -> None:
    """A peer's process: sends "unavailable" or "failed" with a reason, or "view" with numbers."""
    log = os.open(job.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for stream in (1, 2):  # libraries warn from C++
        os.dup2(log, stream)
    peer_type = PEERS[job.peer]
    try:
        version = importlib.metadata.version(peer_type.package)
    except importlib.metadata.PackageNotFoundError:
        connection.send(("unavailable", f"the package {peer_type.package} is not installed"))
        return
    volume = Volume(np.load(job.voxels), job.spacing, job.direction, job.name)
    try:
        peer = peer_type(volume, job.grid, job.threads)
    except Exception as error:  # of any library, which may be broken in any way
        # ours is installed, and then has to work
        what = "failed" if job.peer == Ours.key else "unavailable"
        connection.send((what, f"{type(error).__name__}: {error}"))
        return
    connection.send(("ready", version))
    try:
        for view in job.views:
            connection.send(("view", measure(peer, view, job.repetitions, job.budget)))
    except Exception as error:
        traceback.print_exc()
        connection.send(("failed", f"{type(error).__name__}: {error}"))
    connection.send(("done", None))


def death(process: multiprocessing.process.BaseProcess, log: Path) -> str:
    """Why a process that said nothing any more is gone."""
    process.join()
    code = process.exitcode or 0
    reason = f"stopped by {signal.Signals(-code).name}" if code < 0 else f"exit status {code}"
    text = log.read_text(errors="replace") if log.exists() else ""
    lines = re.sub(r"\x1b\[[\d;]*m", "", text).splitlines()  # without colours
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f"{reason}: {last}" if last else reason


def run(job: Job, timeout: float) -> tuple[list[Result], list[Problem]]:
    """Runs a peer in a process of its own, which is stopped after `timeout` seconds of silence."""
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    print(f"{job.name}: {PEERS[job.peer].title} ...", file=sys.stderr, flush=True)
    process = context.Process(target=work, args=(job, sender), daemon=True)
    process.start()
    sender.close()
    results: list[Result] = []
    problems: list[Problem] = []
    version = ""
    ready = job.peer == Ours.key  # has to work if it is installed; the others once they have started

    def problem(reason: str, failed: bool) -> None:
        problems.append(Problem(job.name, job.peer, " ".join(reason.split())[:200], failed))

    while True:
        if not receiver.poll(timeout):
            process.kill()
            problem(f"no answer for {timeout:g} s", ready)
            break
        try:
            what, content = receiver.recv()
        except EOFError:
            problem(death(process, job.log), ready)
            break
        if what == "ready":
            ready, version = True, content
        elif what == "view":
            results.append(Result(image=job.name, peer=job.peer, version=version, **content))
        else:
            if what != "done":
                problem(content, what == "failed")
            break
    process.join()
    return results, problems


# ---------------------------------------------------------------------------------------- checking


def check_rule(result: Result, volume: Volume, view: View, grid: Grid, mask: np.ndarray) -> None:
    """How far the pixels of random rays are from what the peer's own sampling gives."""
    peer = PEERS[result.peer]
    rays = random_rays(mask, grid)
    drawing = result.notes.get("drawing")
    low, high, known = reference(peer.sampling, volume, view, grid, rays, Drawing(**drawing) if drawing else None)
    low, high = np.maximum(low, peer.lowest)[known], np.maximum(high, peer.lowest)[known]
    values = result.picture[rays.rows, rays.columns].astype(float)[known]
    extent = float(volume.voxels.max()) - float(volume.voxels.min())
    grey = peer.bound.grey if volume.voxels.dtype.kind in "iu" else 0.0
    result.rays = int(known.sum())
    result.rule_bound = grey / extent + peer.bound.part
    if result.rays < RAYS / 10:
        result.passed = False
        return
    excess = np.maximum(np.maximum(low - values, values - high), 0)
    result.rule = float(np.percentile(excess, peer.bound.percentile)) / extent
    result.passed &= result.rule <= result.rule_bound


def check_picture(result: Result, ours: Result, volume: Volume, mask: np.ndarray, control: float | None) -> None:
    """How far the picture is from ours; `control` is the 99th percentile of a pixel's move."""
    extent = float(volume.voxels.max()) - float(volume.voxels.min())
    expected = np.maximum(ours.picture[mask].astype(float), PEERS[result.peer].lowest)
    difference = np.abs(result.picture[mask] - expected) / extent
    result.median, result.p99 = (float(x) for x in np.percentile(difference, (50, 99)))
    if control is not None:
        result.passed &= result.median <= MEDIAN_BOUND and result.p99 <= P99_BOUND * control
    result.ratio = result.median_ms / ours.median_ms


def moved(ours: Result, volume: Volume, mask: np.ndarray) -> float:
    """99th percentile of what our picture, moved by a pixel right and down, differs from itself."""
    extent = float(volume.voxels.max()) - float(volume.voxels.min())
    both = mask[1:, 1:] & mask[:-1, :-1]
    picture = ours.picture.astype(float)
    difference = np.abs(picture[1:, 1:] - picture[:-1, :-1])[both] / extent
    return float(np.percentile(difference, 99))


def compare(results: list[Result], volume: Volume, views: list[View], grid: Grid, judge: bool) -> list[str]:
    """Makes both checks for all results of an image; returns the pictures' bounds, in words."""
    remarks = []
    for view in views:
        mask = covered(volume, view, grid)
        of_view = [result for result in results if result.view == view.name]
        ours = next((result for result in of_view if result.peer == Ours.key), None)
        control = moved(ours, volume, mask) if ours else None
        for result in of_view:
            check_rule(result, volume, view, grid, mask)
            if ours:
                check_picture(result, ours, volume, mask, control if judge else None)
        if control is not None:
            bound = 100 * P99_BOUND * control
            remarks.append(
                f"{volume.name}, {view.name}: a pixel's move makes p99 {100 * control:.1f} %; the "
                f"bounds are {bound:.1f} % and, on med, {100 * MEDIAN_BOUND:.1f} %"
                + ("." if judge else ", not judged here.")
            )
    return remarks


# ------------------------------------------------------------------------------------------ report


def percent(part: float | None) -> str:
    """A part in percent, or a dash."""
    return "-" if part is None else f"{100 * part:.3f}"


def verdict(problem: Problem) -> str:
    """What is wrong, in words."""
    return f"{'FAILED' if problem.failed else 'not available here'}: {problem.reason}"


def table(results: list[Result], problems: list[Problem]) -> str:
    """Every measurement as a line of text, and every peer that gave none."""
    head = "image view peer first min median n ratio cores others rule% bound% med% p99%".split()
    head.append("pictures")
    rows = [
        [
            r.image,
            r.view,
            r.peer,
            f"{r.first_ms:.1f}",
            f"{r.minimum_ms:.1f}",
            f"{r.median_ms:.1f}",
            str(len(r.times_ms)),
            f"{r.ratio:.1f}" if r.ratio else "-",
            f"{r.cores:.2f}",
            "-" if r.others is None else f"{r.others:.2f}",
            *map(percent, (r.rule, r.rule_bound, r.median, r.p99)),
            "agree" if r.passed else "DISAGREE",
        ]
        for r in results
    ]
    widths = [max(map(len, column)) for column in zip(head, *rows)]
    lines = []
    for row in [head, *rows]:
        names = [text.ljust(width) for text, width in zip(row[:3], widths)]
        numbers = [text.rjust(width) for text, width in zip(row[3:], widths[3:])]
        lines.append("  ".join(names + numbers))
    lines += [f"{p.image}  {p.peer}  {verdict(p)}" for p in problems]
    return "\n".join(lines)


def disturbed(results: list[Result]) -> str:
    """A warning if other programs ran too."""
    most = max((r.others or 0.0 for r in results), default=0.0)
    if most < BUSY:
        return ""
    return f"Other programs used up to {most:.1f} cores meanwhile: times and ratios are not reliable."


def machine() -> str:
    """The processor and the operating system."""
    processor = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                processor = line.split(":", 1)[1].strip()
                break
    python = platform.python_version()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}, Python {python}"


def markdown(results: list[Result], problems: list[Problem], views: list[View], threads: int) -> str:
    """A table per image: median times of a prepared view, and how many times ours that is."""

    def cell(result: Result | None) -> str:
        if result is None:
            return "-"
        text = f"{result.median_ms:.1f}"
        if result.ratio and result.peer != Ours.key:
            text += f" (x{result.ratio:.1f})"
        return text if result.passed else f"{text}, picture disagrees"

    def line(*cells: str) -> str:
        return f"| {' | '.join(text.replace('|', '/') for text in cells)} |"

    names = [view.name for view in views]
    lines = [f"{machine()}; {threads} threads. Median times of a view in ms (times ours).", ""]
    if disturbed(results):
        lines += [disturbed(results), ""]
    for image in dict.fromkeys([r.image for r in results] + [p.image for p in problems]):
        lines += [line(image, "version", *names), "|---|---|" + "---:|" * len(names)]
        for key, peer in PEERS.items():
            rows = {r.view: r for r in results if (r.image, r.peer) == (image, key)}
            for r in list(rows.values())[:1]:
                instructions = r.notes.get("instruction set")
                version = f"{r.version}, {instructions}" if instructions else r.version
                lines.append(line(peer.title, version, *[cell(rows.get(n)) for n in names]))
                if key == Ours.key:
                    firsts = [f"{rows[n].first_ms:.1f}" if n in rows else "-" for n in names]
                    lines.append(line(f"{peer.title}, first view", version, *firsts))
            for p in problems:
                if (p.image, p.peer) == (image, key):
                    lines.append(line(peer.title, "", verdict(p), *[""] * (len(names) - 1)))
        lines.append("")
    return "\n".join(lines)


def save_numbers(
    output: Path,
    results: list[Result],
    problems: list[Problem],
    remarks: list[str],
    settings: dict[str, Any],
) -> None:
    """peers.csv and peers.json."""
    records = []
    for r in results:
        record = {key: value for key, value in vars(r).items() if key != "picture"}
        records.append(record | {"minimum_ms": r.minimum_ms, "median_ms": r.median_ms})
    columns = "image view peer version repetitions first_ms minimum_ms median_ms ratio".split()
    columns += "cores others rule rule_bound rays median p99 passed problem".split()
    with (output / "peers.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore")
        writer.writeheader()
        for record in records:
            writer.writerow(record | {"repetitions": len(record["times_ms"])})
        for p in problems:
            writer.writerow({"image": p.image, "peer": p.peer, "problem": p.reason})
    content = {
        "machine": machine(),
        "settings": settings,
        "results": records,
        "problems": [asdict(p) for p in problems],
        "control": remarks,
    }
    (output / "peers.json").write_text(json.dumps(content, indent=2) + "\n")


def draw_times(file: Path, results: list[Result], views: list[View], threads: int) -> None:
    """A panel per image: bars of the median times, logarithmic, one per peer and view."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    images = list(dict.fromkeys(r.image for r in results))
    keys = [key for key in PEERS if any(r.peer == key for r in results)]
    colours = dict(zip(PEERS, plt.get_cmap("tab10").colors))
    figure, panels = plt.subplots(
        1, len(images), figsize=(4 + 4.5 * len(images), 5.5), squeeze=False, layout="constrained"
    )
    width = 0.84 / len(keys)
    for panel, image in zip(panels[0], images):
        for place, key in enumerate(keys):
            for at, view in enumerate(views):
                r = next(
                    (r for r in results if (r.image, r.peer, r.view) == (image, key, view.name)),
                    None,
                )
                if r is None:
                    continue
                x = at + (place - (len(keys) - 1) / 2) * width
                panel.bar(x, r.median_ms, 0.92 * width, color=colours[key])
                text = f"{r.median_ms:.1f}" if r.median_ms < 10 else f"{r.median_ms:.0f}"
                panel.annotate(
                    text,
                    (x, r.median_ms),
                    xytext=(0, 2),
                    textcoords="offset points",
                    ha="center",
                    fontsize=7,
                )
                if key == Ours.key:
                    panel.plot([x], [r.first_ms], "_", color="black", markersize=10)
        panel.set_yscale("log")
        low, high = panel.get_ylim()
        panel.set_ylim(low / 1.5, high * 1.3)
        panel.set_xticks(range(len(views)), [view.name for view in views])
        panel.set_title(image)
        panel.set_ylabel(f"ms per view, {threads} threads")
        panel.grid(axis="y", alpha=0.3)
        panel.set_axisbelow(True)
    handles = [plt.Rectangle((0, 0), 1, 1, color=colours[key]) for key in keys]
    labels = [PEERS[key].title for key in keys]
    if Ours.key in keys:
        handles.append(plt.Line2D([], [], color="black", marker="_", linestyle="", markersize=10))
        labels.append(f"{Ours.title}, first view of an image")
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, 1 + len(images)), fontsize=8)
    figure.savefig(file, dpi=150)
    plt.close(figure)


def draw_pictures(file: Path, results: list[Result], volume: Volume, views: list[View]) -> None:
    """The pictures side by side: a row per view, a column per peer."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    keys = [key for key in PEERS if any(r.peer == key for r in results)]
    figure, panels = plt.subplots(
        len(views),
        len(keys),
        figsize=(2.6 * len(keys), 2.75 * len(views)),
        squeeze=False,
        facecolor="black",
        layout="constrained",
    )
    sample_ = volume.voxels.reshape(-1)[:: max(1, volume.voxels.size // 1_000_000)]
    low, high = float(sample_.min()), float(np.percentile(sample_, 99.9))
    for line, view in zip(panels, views):
        for panel, key in zip(line, keys):
            panel.set_axis_off()
            for r in results:
                if (r.peer, r.view) == (key, view.name):
                    panel.imshow(r.picture, cmap="gray", vmin=low, vmax=high)
                    panel.set_title(f"{key}, {view.name}", color="white", fontsize=9)
    figure.savefig(file, dpi=150)
    plt.close(figure)


# -------------------------------------------------------------------------------------------- main


def parse_size(text: str) -> tuple[int, int, int]:
    """Voxels along x, y and z."""
    match = re.fullmatch(r"(\d+)x(\d+)x(\d+)", text)
    size = tuple(int(n) for n in match.groups()) if match else ()
    if len(size) != 3 or min(size) < 16:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 256x256x64, 16 or more each")
    return size


def positive(text: str) -> int:
    """A whole number from 1."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number")
    return int(text)


def parse_arguments() -> argparse.Namespace:
    """The command line; sizes are the default ones if neither they nor an image are given."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="peers:\n" + "\n".join(f"  {key:<12} {peer.title} ({peer.package})" for key, peer in PEERS.items()),
    )
    image = parser.add_mutually_exclusive_group()
    image.add_argument(
        "--size",
        type=parse_size,
        nargs="+",
        metavar="NXxNYxNZ",
        help="sizes of the made angiogram [256x256x64 512x512x512]",
    )
    image.add_argument("--image", type=Path, metavar="FILE", help="a 3D image that ITK reads")
    parser.add_argument(
        "--views",
        type=parse_view,
        nargs="+",
        default=[parse_view(text) for text in ("y30", "x40", "y60+x20")],
        metavar="VIEW",
        help="rotations by degrees about the axes, of which + makes products [y30 x40 y60+x20]",
    )
    parser.add_argument("--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help="which [all]")
    parser.add_argument("--repetitions", type=positive, default=10, help="of each view [10]")
    parser.add_argument(
        "--budget",
        type=float,
        default=10.0,
        metavar="S",
        help="no repetition begins after so many seconds spent on a view [10]",
    )
    parser.add_argument(
        "--timeout",
        type=float,
        default=300.0,
        metavar="S",
        help="a peer silent for so long is stopped [300]",
    )
    parser.add_argument("--threads", type=positive, default=2, help="of every peer [2]")
    parser.add_argument("--output", type=Path, metavar="DIR", help="for peers.csv, .json, .md and .png [none]")
    parser.add_argument("--pictures", action="store_true", help="the projections side by side too, in --output")
    parser.add_argument(
        "--smoke",
        action="store_true",
        help="a quick try: small image, few repetitions, two peers at once: the times are void",
    )
    arguments = parser.parse_args()
    if arguments.pictures and not arguments.output:
        parser.error("--pictures needs --output")
    if arguments.smoke:
        arguments.size = None if arguments.image else [(64, 64, 32)]
        arguments.repetitions = min(2, arguments.repetitions)
    elif not arguments.size and not arguments.image:
        arguments.size = [(256, 256, 64), (512, 512, 512)]
    return arguments


def limit_threads(threads: int) -> None:
    """What the peers' processes inherit, for the libraries that have no call for it."""
    for name in (
        "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS",
        "LP_NUM_THREADS",  # Mesa's software renderer
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "VTK_SMP_MAX_THREADS",
    ):
        os.environ[name] = str(threads)


def measure_image(
    volume: Volume, views: list[View], arguments: argparse.Namespace
) -> tuple[list[Result], list[Problem], list[str]]:
    """Every peer's results for an image, checked; what went wrong; the pictures' bounds."""
    grid = Grid(int(max(volume.size[:2])), float(volume.spacing.min()))
    results: list[Result] = []
    problems: list[Problem] = []
    with tempfile.TemporaryDirectory(prefix="peers-") as folder:
        voxels = Path(folder, "voxels.npy")
        np.save(voxels, volume.voxels)
        jobs = [
            Job(
                peer=key,
                voxels=voxels,
                log=Path(folder, f"{key}.log"),
                spacing=volume.spacing,
                direction=volume.direction,
                name=volume.name,
                grid=grid,
                views=views,
                threads=arguments.threads,
                repetitions=arguments.repetitions,
                budget=arguments.budget,
            )
            for key in dict.fromkeys(arguments.peers)
        ]
        with ThreadPoolExecutor(2 if arguments.smoke else 1) as pool:
            for done, troubles in pool.map(lambda job: run(job, arguments.timeout), jobs):
                results += done
                problems += troubles
    remarks = compare(results, volume, views, grid, judge=not arguments.image)
    return results, problems, remarks


def main() -> None:
    """Runs everything; the exit status tells whether pictures agree and no peer failed."""
    arguments = parse_arguments()
    limit_threads(arguments.threads)
    output: Path | None = arguments.output
    drawing = importlib.util.find_spec("matplotlib") is not None
    if output:
        output.mkdir(parents=True, exist_ok=True)
        if not drawing:
            print("no peers.png: the package matplotlib is not installed", file=sys.stderr)
    views = list({view.name: view for view in arguments.views}.values())

    results: list[Result] = []
    problems: list[Problem] = []
    remarks: list[str] = []
    for source in [arguments.image] if arguments.image else arguments.size:
        volume = read_image(source) if arguments.image else angiogram(source)
        done, troubles, bounds = measure_image(volume, views, arguments)
        results += done
        problems += troubles
        remarks += bounds
        if output and arguments.pictures and drawing and done:
            name = re.sub(r"[^\w.-]", "_", volume.name)
            draw_pictures(output / f"pictures-{name}.png", done, volume, views)

    print(table(results, problems))
    print(
        "\nTimes in ms; ratio: median by that of ours; cores: processor time by time, of the peer"
        "\nand of others meanwhile; rule, med, p99: percent of the data's range, see --help."
    )
    print("\n".join(remarks))
    if disturbed(results):
        print(f"warning: {disturbed(results)}", file=sys.stderr)
    if output:
        settings = {
            "threads": arguments.threads,
            "repetitions": arguments.repetitions,
            "budget_s": arguments.budget,
            "views": [view.name for view in views],
        }
        save_numbers(output, results, problems, remarks, settings)
        text = markdown(results, problems, views, arguments.threads)
        (output / "peers.md").write_text(text)
        if drawing and results:
            draw_times(output / "peers.png", results, views, arguments.threads)

    if not results:
        sys.exit("error: no peer could be measured")
    if any(p.failed for p in problems):
        sys.exit("error: a peer failed")
    if not all(r.passed for r in results):
        sys.exit("error: pictures disagree")


if __name__ == "__main__":
    main()

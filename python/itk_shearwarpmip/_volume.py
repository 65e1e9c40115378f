"""Volumes in chunks: arrays, images and OME-Zarr, with their geometry."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import dask.array
import itk
import numpy as np

from itk_shearwarpmip._inputs import (
    UNITS,
    Placed,
    find_pixel_types,
    is_of,
    make_count,
    make_region,
    make_view,
    place,
    place_affine,
    take,
)


@dataclass(frozen=True, eq=False)
class Volume:
    """A 3D array in chunks, and its geometry. Spacing and origin have the order x, y, z.

    A volume equals only itself.
    """

    array: dask.array.Array
    """Axes z, y, x."""
    spacing: tuple[float, ...]
    origin: tuple[float, ...]
    direction: np.ndarray
    """3 x 3: its columns are the directions of the axes x, y, z in physical space."""
    unit: str | None = None
    """The unit of spacing and origin, the unit of the x axis in OME-Zarr."""
    has_direction: bool = True
    """Whether the direction defines the patient's sides."""

    @property
    def placed(self) -> Placed:
        return Placed(self.array, self.spacing, self.origin, self.direction, self.has_direction, self.unit)

    def persist(self) -> "Volume":
        """Returns the volume with its voxels in the memory of Dask's workers, for several views."""
        return replace(self, array=self.array.persist())

    @property
    def region(self) -> Any:
        """The itk.ImageRegion of all voxels."""
        return make_region((0, 0, 0), self.array.shape)

    def make_image(self) -> itk.Image:
        """Returns an itk.Image with this geometry and without voxels."""
        image = itk.Image[_find_pixel_type(self.array.dtype), 3].New()
        image.SetLargestPossibleRegion(self.region)
        return self._place(image)

    def make_part(self, voxels: np.ndarray, first: Sequence[int]) -> itk.Image:
        """Returns the part `voxels`, which begins at voxel `first` (z, y, x), as an itk.Image that shares its memory."""
        return self._place(make_view(voxels, first))

    def _place(self, image: itk.Image) -> itk.Image:
        place(image, self.placed)
        return image


def open_volume(
    volume: Any,
    *,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: Any = None,
    level: int | None = None,
    output_spacing: Any = None,
    time: int = 0,
    channel: int = 0,
) -> Volume:
    """Opens a volume without reading its voxels.

    volume: a dask.array.Array with the axes z, y, x; an OME-Zarr image of version 0.4 or 0.5 by its path, its URL or
        as a zarr.Group; a Volume; or an array or image in memory. For other files, see open_image().
    spacing, origin: x, y, z, instead of the volume's own; the defaults for arrays are 1 and 0.
    direction: 3 x 3, its columns of length 1, instead of the volume's own; the default for arrays is the identity.
    level: the resolution of an OME-Zarr image; 0 is the finest. By default the coarsest level that is at least as fine
        as output_spacing, or the finest level without output_spacing.
    time, channel: the time point and the channel, for an OME-Zarr image with several.

    Raises ValueError for an unsuitable volume, TypeError for objects and voxels of unsupported types, ImportError for a
    URL that needs another package, and OSError for a file that cannot be read.

    >>> volume = open_volume(dask.array.zeros((40, 50, 60), dtype=np.uint8, chunks=20), spacing=(0.4, 0.4, 0.8))
    >>> volume.array.numblocks, volume.spacing
    ((2, 3, 3), (0.4, 0.4, 0.8))
    """
    level = None if level is None else make_count("level", level, 0)
    time, channel = make_count("time", time, 0), make_count("channel", channel, 0)
    if isinstance(volume, str | os.PathLike) or is_of(volume, "zarr", "Group"):
        image = _OmeZarr(volume)
        own = image.read_level(image.choose_level(output_spacing) if level is None else level, time, channel)
    else:
        if level is not None or time != 0 or channel != 0:
            raise ValueError("an array has no levels, times and channels: only an OME-Zarr has")
        own = volume if isinstance(volume, Volume) else _chunk(take(volume))
    array = own.array
    if array.ndim != 3:
        raise ValueError(f"a volume has the axes z, y, x, but this one has the shape {array.shape}")
    if np.isnan(array.shape).any():
        raise ValueError("the sizes of a volume's chunks must be known: see dask.array.Array.compute_chunk_sizes()")
    if 0 in array.shape:
        raise ValueError(f"a volume must not be empty, but this one has the shape {array.shape}")
    _find_pixel_type(array.dtype)
    filled = tuple(tuple(length for length in lengths if length) for lengths in array.chunks)
    placed = own.placed.replace(spacing, origin, direction)
    return Volume(
        array.rechunk(filled) if filled != array.chunks else array,
        tuple(placed.spacing),
        tuple(placed.origin),
        placed.direction,
        placed.unit,
        placed.has_direction,
    )


def read_volume(source: Any, level: int | None, time: int, channel: int) -> Volume:
    """Opens an OME-Zarr image to read all voxels. The caller chooses the level: the finest may be too large."""
    image = _OmeZarr(source)
    if level is None and len(image.levels) > 1:
        raise ValueError(f"{source} has the levels 0, the finest, to {len(image.levels) - 1}: give one, as level=1")
    return image.read_level(level or 0, time, channel)


def _chunk(placed: Placed) -> Volume:
    direction = np.eye(3) if placed.direction is None else placed.direction
    array = dask.array.asarray(placed.array)
    return Volume(array, tuple(placed.spacing), tuple(placed.origin), direction, placed.unit, placed.has_direction)


def _find_pixel_type(dtype: np.dtype) -> Any:
    native = dtype.newbyteorder("=")
    if native not in find_pixel_types():
        names = ", ".join(sorted(map(str, find_pixel_types())))
        raise TypeError(f"voxels must be one of {names}, but they are {dtype}; use astype()")
    return find_pixel_types()[native]


class _OmeZarr:
    """A multiscale image: https://ngff.openmicroscopy.org, versions 0.4 and 0.5."""

    def __init__(self, source: Any) -> None:
        try:
            import zarr
        except ImportError as error:
            raise ImportError("an OME-Zarr needs zarr: install the wheel with its extra [distributed]") from error

        self._name = str(source)
        try:
            self._group = source if isinstance(source, zarr.Group) else zarr.open_group(source, mode="r")
        except (FileNotFoundError, zarr.errors.GroupNotFoundError) as error:
            raise ValueError(f"{self._name} is no OME-Zarr: {error}") from error
        except ImportError:
            raise
        except Exception as error:
            raise OSError(f"{self._name} cannot be opened: {error}") from error
        with self._parsing():
            attributes = self._group.attrs.asdict()
            images = attributes.get("ome", attributes).get("multiscales", [])
            axes = images[0].get("axes", []) if images else []
            self._axes: list[Any] = [axis["name"] if isinstance(axis, dict) else None for axis in axes]
        if not set("xyz") <= set(self._axes):
            raise ValueError(f"{self._name} is no OME-Zarr 0.4 or 0.5 image with the axes z, y, x")
        self._space = [self._axes.index(name) for name in "xyz"]
        with self._parsing():
            places = [(dataset["path"], self._find_place(dataset, images[0])) for dataset in images[0]["datasets"]]
            if not places:
                raise ValueError("there are no datasets")
        units = [axes[axis].get("unit") for axis in self._space]
        if any(unit != units[0] for unit in units) and not set(units) <= set(UNITS):
            raise ValueError(f"{self._name} has axes x, y, z with the units {units}, which cannot be compared")
        self._unit = units[0]
        factors = [1.0 if unit == units[0] else float(UNITS[unit] / UNITS[units[0]]) for unit in units]
        self.levels = [(path, np.diag([*factors, 1.0]) @ matrix) for path, matrix in places]

    @contextmanager
    def _parsing(self) -> Iterator[None]:
        try:
            yield
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{self._name} has broken metadata: {type(error).__name__}: {error}") from error

    def _find_place(self, dataset: dict[str, Any], image: dict[str, Any]) -> np.ndarray:
        """The 4 x 4 matrix from indices of a level to places, along x, y, z."""
        matrix = np.eye(len(self._axes) + 1)
        for owner in (dataset, image):
            for step in owner.get("coordinateTransformations", []):
                matrix = self._make_matrix(step) @ matrix
        chosen = [*self._space, -1]
        others = [axis for axis, name in enumerate(self._axes) if name not in "xyz"]
        if matrix[np.ix_(self._space, others)].any():
            raise OSError(f"{self._name} has other places for other points in time or channels, which cannot be read")
        return matrix[np.ix_(chosen, chosen)]

    def _make_matrix(self, step: dict[str, Any]) -> np.ndarray:
        """What a transformation of all axes does, in homogeneous coordinates."""
        matrix = np.eye(len(self._axes) + 1)
        kind = step["type"]
        if kind == "sequence":
            for part in step["transformations"]:
                matrix = self._make_matrix(part) @ matrix
        elif kind == "scale":
            matrix[:-1, :-1] = np.diag(step["scale"])
        elif kind == "translation":
            matrix[:-1, -1] = step["translation"]
        elif kind == "rotation":
            matrix[:-1, :-1] = step["rotation"]
        elif kind == "affine":
            matrix[:-1] = step["affine"]
        elif kind != "identity":
            raise OSError(f"{self._name} has a transformation of type {kind!r}, which cannot be read")
        return matrix

    def choose_level(self, output_spacing: Any) -> int:
        if output_spacing is None:
            return 0
        wanted = float(np.min(output_spacing)) * (1 + 1e-6)
        fine = [
            n for n, (_, matrix) in enumerate(self.levels) if np.linalg.norm(matrix[:3, :3], axis=0).min() <= wanted
        ]
        return max(fine, default=0)

    def read_level(self, level: int, time: int, channel: int) -> Volume:
        """Returns the array (z, y, x) of a level at these indices of the other axes."""
        levels = len(self.levels)
        if not 0 <= level < levels:
            raise ValueError(f"{self._name} has the levels 0 to {levels - 1}, but not {level}")
        others = {"t": time, "c": channel}
        for name, number in others.items():
            if number != 0 and name not in self._axes:
                raise ValueError(f"{self._name} has no axis {name}, and number {number} of it was asked for")
        path, matrix = self.levels[level]
        with self._parsing():
            array = self._group[path]
            lengths = dict(zip(self._axes, array.shape, strict=True))
        index: list[int | slice] = []
        for name, length in lengths.items():
            chosen: int | slice = slice(None) if name in "xyz" else others.get(name, 0)
            if not isinstance(chosen, slice) and not 0 <= chosen < length:
                raise ValueError(f"{self._name} has {length} along the axis {name}, but not number {chosen}")
            index.append(chosen)
        # chunks are read in groups of about Dask's array.chunk-size
        voxels = dask.array.from_array(
            _Reader(array, tuple(index)), chunks="auto", meta=np.empty((0,) * 3, array.dtype)
        )
        space = [name for name in self._axes if name in "xyz"]
        placed = place_affine(voxels.transpose([space.index(name) for name in "zyx"]), matrix)
        return replace(_chunk(placed), unit=self._unit, has_direction=False)


class _Reader:
    """The space axes of an array, at an index of the other axes. Its errors name the voxels that cannot be read."""

    def __init__(self, array: Any, index: tuple[int | slice, ...]) -> None:
        self._array = array
        self._index = index
        space = [axis for axis, chosen in enumerate(index) if isinstance(chosen, slice)]
        self.shape = tuple(array.shape[axis] for axis in space)
        self.chunks = tuple(array.chunks[axis] for axis in space)
        self.dtype = array.dtype
        self.ndim = len(space)

    def __getitem__(self, region: tuple[slice, ...]) -> np.ndarray:
        regions = iter(region)
        index = tuple(next(regions) if isinstance(chosen, slice) else chosen for chosen in self._index)
        try:
            return np.asarray(self._array[index])
        except Exception as error:
            voxels = ", ".join(f"{each.start}:{each.stop}" if isinstance(each, slice) else str(each) for each in index)
            raise OSError(f"voxels [{voxels}] of {self._array.store_path} cannot be read: {error}") from error

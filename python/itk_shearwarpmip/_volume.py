"""Chunked volumes: Dask arrays and OME-Zarr images, with their place in physical space."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import dask.array
import itk
import numpy as np

_WRAPPED = [itk.template(image) for (image,) in itk.ShearWarpMIPPartImageFilter.keys()]
_PIXEL_TYPES = {np.dtype(pixel_type.dtype): pixel_type for _, (pixel_type, _) in _WRAPPED}


@dataclass(frozen=True)
class Volume:
    """A 3D array in chunks, and where its voxels lie. Spacing and origin are in the order x, y, z."""

    array: dask.array.Array
    """Axes z, y, x."""
    spacing: tuple[float, ...]
    origin: tuple[float, ...]
    direction: np.ndarray
    """3 x 3: its columns are the directions of the axes x, y, z in physical space."""
    unit: str | None = None
    """Of spacing and origin, as OME-Zarr names it."""

    def persist(self) -> "Volume":
        """The same, with its voxels in the memory of Dask's workers: for several views."""
        return replace(self, array=self.array.persist())

    @property
    def region(self) -> Any:
        """The itk.ImageRegion of all voxels."""
        return _make_region((0, 0, 0), self.array.shape)

    def make_image(self) -> itk.Image:
        """An itk.Image with this geometry, and without voxels."""
        image = itk.Image[_find_pixel_type(self.array.dtype), 3].New()
        image.SetLargestPossibleRegion(self.region)
        return self._place(image)

    def make_part(self, voxels: np.ndarray, first: Sequence[int]) -> itk.Image:
        """The part `voxels`, from voxel `first` (z, y, x) on, as an itk.Image that shares their memory."""
        image = itk.image_view_from_array(voxels)
        image.SetRegions(_make_region(first, voxels.shape))
        return self._place(image)

    def _place(self, image: itk.Image) -> itk.Image:
        image.SetSpacing(self.spacing)
        image.SetOrigin(self.origin)
        image.SetDirection(itk.matrix_from_array(self.direction))
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
    """Opens a volume; its voxels are not read yet.

    volume: a dask.array.Array (or what dask.array.asarray takes) with the axes z, y, x; or an OME-Zarr image of version
        0.4 or 0.5: its path, its URL or a zarr.Group; or a Volume.
    spacing, origin: x, y, z, instead of the file's or 1 and 0.
    direction: 3 x 3, instead of the identity.
    level: of an OME-Zarr's resolutions, 0 is the finest. By default the coarsest one that is not coarser than
        output_spacing, or the finest one without that.
    time, channel: which one of an OME-Zarr that has several.

    Raises ValueError for what is no such volume, TypeError for voxels of a type that is not wrapped.
    """
    unit = None
    own_spacing, own_origin, own_direction = [1.0, 1.0, 1.0], [0.0, 0.0, 0.0], np.eye(3)
    if isinstance(volume, str | os.PathLike) or type(volume).__module__.startswith("zarr."):
        image = _OmeZarr(volume)
        if level is None:
            level = image.choose_level(output_spacing)
        array, own_spacing, own_origin = image.read_level(level, {"t": time, "c": channel})
        unit = image.unit
    else:
        if level is not None:
            raise ValueError("an array has no levels")
        if isinstance(volume, Volume):
            array, own_spacing, own_origin = volume.array, volume.spacing, volume.origin
            own_direction, unit = volume.direction, volume.unit
        else:
            array = dask.array.asarray(volume)
    if array.ndim != 3:
        raise ValueError(f"a volume has the axes z, y, x, but this one has the shape {array.shape}")
    if np.isnan(array.shape).any():
        raise ValueError("the sizes of a volume's chunks must be known: see dask.array.Array.compute_chunk_sizes()")
    if 0 in array.shape:
        raise ValueError(f"a volume must not be empty, but this one has the shape {array.shape}")
    _find_pixel_type(array.dtype)
    filled = tuple(tuple(length for length in lengths if length) for lengths in array.chunks)
    return Volume(
        array.rechunk(filled) if filled != array.chunks else array,
        _make_tuple("spacing", own_spacing if spacing is None else spacing),
        _make_tuple("origin", own_origin if origin is None else origin),
        own_direction if direction is None else np.asarray(direction, dtype=float).reshape(3, 3),
        unit,
    )


def _make_tuple(name: str, values: Sequence[float]) -> tuple[float, ...]:
    if len(values) != 3:
        raise ValueError(f"{name} must be three numbers, x, y, z, but it is {values}")
    return tuple(float(value) for value in values)


def _make_region(first: Sequence[int], shape: Sequence[int]) -> Any:
    region = itk.ImageRegion[3]()
    region.SetIndex([int(index) for index in reversed(first)])
    region.SetSize([int(length) for length in reversed(shape)])
    return region


def _find_pixel_type(dtype: np.dtype) -> Any:
    native = dtype.newbyteorder("=")
    if native not in _PIXEL_TYPES:
        names = ", ".join(sorted(map(str, _PIXEL_TYPES)))
        raise TypeError(f"voxels must be one of {names}, but they are {dtype}; use astype()")
    return _PIXEL_TYPES[native]


class _OmeZarr:
    """A multiscale image: https://ngff.openmicroscopy.org, versions 0.4 and 0.5."""

    def __init__(self, source: Any) -> None:
        import zarr

        self._name = str(source)
        try:
            self._group = source if isinstance(source, zarr.Group) else zarr.open_group(source, mode="r")
        except (FileNotFoundError, zarr.errors.GroupNotFoundError) as error:
            raise ValueError(f"{self._name} is no OME-Zarr: {error}") from error
        attributes = self._group.attrs.asdict()
        images = attributes.get("ome", attributes).get("multiscales", [])
        axes = images[0].get("axes", []) if images else []
        if not all(isinstance(axis, dict) for axis in axes) or not {"z", "y", "x"} <= {axis["name"] for axis in axes}:
            raise ValueError(f"{self._name} is no OME-Zarr 0.4 or 0.5 image with the axes z, y, x")
        self._image = images[0]
        self._axes = [axis["name"] for axis in axes]
        self.unit = next(axis.get("unit") for axis in axes if axis["name"] == "x")

    def _find_place(self, level: int) -> tuple[list[float], list[float]]:
        """Spacing and origin of a level, of x, y, z."""
        scale, offset = np.ones(len(self._axes)), np.zeros(len(self._axes))
        for owner in (self._image["datasets"][level], self._image):
            for step in owner.get("coordinateTransformations", []):
                if step["type"] == "scale":
                    scale, offset = scale * step["scale"], offset * step["scale"]
                elif step["type"] == "translation":
                    offset = offset + step["translation"]
        order = [self._axes.index(name) for name in "xyz"]
        return [float(scale[axis]) for axis in order], [float(offset[axis]) for axis in order]

    def choose_level(self, output_spacing: Any) -> int:
        if output_spacing is None:
            return 0
        wanted = float(np.min(output_spacing)) * (1 + 1e-6)
        fine = [n for n in range(len(self._image["datasets"])) if min(self._find_place(n)[0]) <= wanted]
        return max(fine, default=0)

    def read_level(self, level: int, others: dict[str, int]) -> tuple[dask.array.Array, list[float], list[float]]:
        """The array, z, y, x, at this index of the other axes; spacing and origin."""
        levels = len(self._image["datasets"])
        if not 0 <= level < levels:
            raise ValueError(f"{self._name} has the levels 0 to {levels - 1}, but not {level}")
        for name, chosen in others.items():
            if chosen != 0 and name not in self._axes:
                raise ValueError(f"{self._name} has no axis {name}, and number {chosen} of it was asked for")
        array = self._group[self._image["datasets"][level]["path"]]
        index = []
        for name, length in zip(self._axes, array.shape, strict=True):
            chosen = slice(None) if name in "xyz" else others.get(name, 0)
            if not isinstance(chosen, slice) and not 0 <= chosen < length:
                raise ValueError(f"{self._name} has {length} along the axis {name}, but not number {chosen}")
            index.append(chosen)
        # chunks are read in groups of about Dask's array.chunk-size
        voxels = dask.array.from_array(
            _Reader(array, tuple(index)), chunks="auto", meta=np.empty((0,) * 3, array.dtype)
        )
        space = [name for name in self._axes if name in "xyz"]
        return voxels.transpose([space.index(name) for name in "zyx"]), *self._find_place(level)


class _Reader:
    """The space axes of an array, at an index of the others; says which voxels cannot be read."""

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

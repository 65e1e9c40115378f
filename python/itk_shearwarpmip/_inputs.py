"""Opens files, images of other packages and arrays as a 3D itk.Image, with their geometry."""

import os
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any, SupportsFloat

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip import _entries


@dataclass(frozen=True, eq=False)
class Placed:
    """Voxels with the axes z, y, x, and their geometry: spacing and origin have the order x, y, z."""

    array: Any
    spacing: Sequence[float] = (1.0, 1.0, 1.0)
    origin: Sequence[float] = (0.0, 0.0, 0.0)
    direction: Any = None
    """3 x 3: its columns are the directions of the axes x, y, z in physical space; the identity by default."""
    has_direction: bool = False
    """Whether the direction defines the patient's sides."""
    unit: str | None = None
    """The unit of spacing and origin; None is mm."""

    def replace(self, spacing: Any, origin: Any, direction: Any) -> "Placed":
        """The same voxels with another geometry: arguments that are not None replace the present values."""
        axes = _make_direction(self.direction if direction is None else direction)
        if direction is not None:
            _require_unit_columns(axes)
        return Placed(
            self.array,
            make_numbers("spacing", self.spacing if spacing is None else spacing, 3),
            make_numbers("origin", self.origin if origin is None else origin, 3),
            axes,
            self.has_direction or direction is not None,
            self.unit if spacing is None else None,
        )


def open_image(
    source: Any,
    *,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: Any = None,
    series: str | int | None = None,
    volume: str | int | None = None,
    suv: bool = False,
    level: int | None = None,
    time: int | None = None,
    channel: int = 0,
) -> Any:
    """Opens a volume as a 3D itk.Image, with its geometry in physical space (LPS, mm).

    source: one of
        - a path: an image file, a DICOM folder or its DICOMDIR, which the program shear-warp-mip reads
        - an itk.Image, which is returned itself if it needs no change
        - a SimpleITK.Image, or an image of nibabel or a MetaTensor of MONAI, whose space (RAS) is converted to LPS
        - an xarray.DataArray with the dimensions z, y, x, and coordinates in equal steps; if coordinates descend, the
          axis points against x, y or z
        - an array of NumPy, PyTorch or another package with `__array__` or `__dlpack__`, in the computer's memory, with
          the axes z, y, x
        - a Dask array, an OME-Zarr image or a result of open_volume(), which is read into memory as a whole
    spacing, origin: x, y, z, in mm, instead of the source's own; the defaults for arrays are 1 and 0.
    direction: 3 x 3, its columns, of length 1, are the directions of x, y, z, instead of the source's own; the default
        for arrays is the identity.
    series: for a DICOM folder with several series: the number in the list of the error, a part of the description, or
        the Series Instance UID.
    volume: for a DICOM series or file with several volumes, such as echoes: the number in the list of the error. For
        other files, like time, but from 1 on.
    suv: True for the values of a DICOM PET series as SUV by body weight.
    level, channel: for an OME-Zarr image. If it has several levels, level is required; 0 is the finest.
    time: the number of the point in time; 0 is the first. If a file has several, time or volume is required; the default
        of an OME-Zarr image is 0.

    The image has voxels of uint8, int16, uint16, float32 or float64. Other voxels are converted by one rule: bool to
    uint8, int8 to int16, float16 to float32; other integers to int16 or, without a sign, to uint16 if each value fits,
    else to float64. If possible, the image shares its voxels with the source.

    Entries of the image's dictionary are texts. HasOrientation is "0" if nobody stated how the image lies in the
    patient, and pictures of it have no letters. IsInverted is "1" if low values are to be shown white (MONOCHROME1).
    IsSuv is "1" if values are SUV by body weight. Unit is the unit of lengths if it is not mm. DICOM attributes of the
    first slice have ITK's names, as "0008|0060".
    Pickles and copies keep the entries. ITK's filters and itk.image_duplicator() do not: what they return lies in LPS, in
    mm, until its entries are set.

    Raises TypeError for objects and voxels of unsupported types, ValueError if the source does not define one volume,
    and OSError for files that cannot be read. What the program refuses is both an OSError and a ValueError.

    >>> import numpy as np
    >>> image = open_image(np.zeros((3, 4, 5), np.int16), spacing=(0.4, 0.4, 0.8))
    >>> image.shape, list(image.GetSpacing()), image["HasOrientation"]
    ((3, 4, 5), [0.4, 0.4, 0.8], '0')
    """
    entries: dict[str, str] = {}
    is_file = isinstance(source, str | os.PathLike) and not is_ome_zarr(source)
    make_flag("suv", suv)
    time, channel = None if time is None else make_count("time", time, 0), make_count("channel", channel, 0)
    level = None if level is None else make_count("level", level, 0)
    if not is_file:
        _require_none(series=series, volume=volume, suv=suv or None)
    if is_ome_zarr(source):
        # says what is missing
        from itk_shearwarpmip import open_volume  # noqa: F401
        from itk_shearwarpmip._volume import read_volume

        source = read_volume(source, level, time or 0, channel)
    elif level is not None or channel != 0 or (not is_file and time):
        raise ValueError("only an OME-Zarr has levels, times and channels, and a 4D file times")
    _bring_up_to_date(source)
    if isinstance(source, itk.Object) and type(source) in _find_image_types():
        _view_image(source)  # refuses an empty image
        _entries.keep(source)
        if spacing is None and origin is None and direction is None:
            return source
    if is_file:
        placed, entries = _read_time(os.fspath(source), series, volume, suv, time)
    else:
        placed, entries = take(source), _find_texts(source)
    array = np.asarray(placed.array)
    if array.ndim != 3:
        raise ValueError(
            f"a volume has the axes z, y, x, but this one has the shape {array.shape}: give a part of 3 dimensions, such "
            "as array[0] of several volumes, array[..., 0] of colours, array[np.newaxis] of a slice"
        )
    if not array.size:
        raise ValueError(f"a volume must not be empty, but this one has the shape {array.shape}")
    image = make_view(np.ascontiguousarray(narrow(array)))
    if isinstance(source, itk.Object):
        image.SetMetaDataDictionary(source.GetMetaDataDictionary())
    for key, value in entries.items():
        _entries.put(image, key, value)
    place(image, placed.replace(spacing, origin, direction))
    if is_of(source, "nibabel", "SpatialImage") and source.get_filename():
        _entries.put_source_files(image, [os.path.abspath(source.get_filename())])
    return image


def _find_texts(source: Any) -> dict[str, str]:
    """The entries that conversions from an itk.Image and readers of files keep in images of other packages."""
    attributes: Any = {}
    if is_of(source, "xarray", "DataArray"):
        attributes = source.attrs
    elif is_of(source, "SimpleITK", "Image"):
        attributes = {key: source.GetMetaData(key) for key in source.GetMetaDataKeys()}
    return {key: str(attributes[key]) for key in ("HasOrientation", "IsInverted", "IsSuv", "Unit") if key in attributes}


def _require_none(**keywords: Any) -> None:
    for name, value in keywords.items():
        if value is not None:
            raise ValueError(f"{name} is for a DICOM folder or file")


def open_grid(path: str, series: Any = None, volume: Any = None) -> Any:
    """An image with the geometry of a file or folder, which may have colours and several points in time. Its voxels are
    0."""
    placed, entries = _read(path, series, volume, False)
    image = make_view(np.zeros(placed.array.shape[1:4], np.uint8))
    for key, value in entries.items():
        _entries.put(image, key, value)
    place(image, placed.replace(None, None, None))
    return image


def _read(path: str, series: Any, volume: Any, suv: bool) -> tuple["Placed", dict[str, str]]:
    """Reads a file or folder by the program: voxels t, z, y, x, and behind these the components if there are several."""
    from itk_shearwarpmip import _files

    if path == "":
        raise ValueError("the path of a volume must not be empty")
    options = ["--suv"] if suv else []
    options += [f"--{name}={value}" for name, value in (("series", series), ("volume", volume)) if value is not None]
    voxels, entries = _files.read(os.fsdecode(path), *options)
    spacing, origin, direction = (
        [float(number) for number in entries.pop(key).split()] for key in ("Spacing", "Origin", "Direction")
    )
    has_direction = entries.get("HasOrientation") != "0"
    return Placed(voxels, spacing, origin, np.reshape(direction, (3, 3)), has_direction), entries


def _read_time(path: str, series: Any, volume: Any, suv: bool, time: int | None) -> tuple["Placed", dict[str, str]]:
    """Reads one point in time of a file or folder."""
    placed, entries = _read(path, series, volume, suv)
    voxels = placed.array
    if voxels.ndim == 5:
        raise ValueError(f"'{path}' has {voxels.shape[-1]} components{_ONE_COMPONENT}")
    if len(voxels) == 1:
        time = time or 0
    if time is None:
        raise ValueError(f"'{path}' has {len(voxels)} points in time: give the number of one, as time=0")
    if time >= len(voxels):
        raise ValueError(f"time must be a whole number from 0 to {len(voxels) - 1} for '{path}', but it is {time!r}")
    # a part of the mapping would keep it all
    chosen = voxels[time].copy() if len(voxels) > 1 else voxels[time]
    return replace(placed, array=chosen), entries


def _bring_up_to_date(source: Any) -> None:
    """Updates an image that a filter makes."""
    if isinstance(source, itk.DataObject) and (made_by := source.GetSource()):
        # one at a time: pipelines may share filters
        with _UPDATES:
            try:
                made_by.UpdateLargestPossibleRegion()
            except RuntimeError as error:
                raise ValueError(f"the pipeline that makes this image fails: {describe(error)}") from error


_UPDATES = threading.RLock()


def get_shape(image: Any) -> tuple[int, ...]:
    """The lengths along z, y, x, which ITK's own attribute has in another order where two are 1."""
    return tuple(int(length) for length in reversed(list(image.GetLargestPossibleRegion().GetSize())))


def make_view(array: NDArray[Any], first: Sequence[int] = (0, 0, 0)) -> Any:
    """Returns an itk.Image that shares the memory of an array, and keeps the array. It begins at the pixel `first`, in
    the order of the array's axes."""
    image = itk.image_view_from_array(array)
    # ITK takes one column for one row
    image.SetRegions(make_region(first, array.shape))
    return image


def make_region(first: Sequence[int], shape: Sequence[int]) -> Any:
    region = itk.ImageRegion[len(shape)]()
    region.SetIndex([int(index) for index in reversed(first[: len(shape)])])
    region.SetSize([int(length) for length in reversed(shape)])
    return region


def place(image: Any, placed: Placed) -> None:
    """Sets the geometry of an image."""
    try:
        image.SetSpacing(placed.spacing)
        image.SetDirection(itk.matrix_from_array(placed.direction))
    except RuntimeError as error:
        raise ValueError(describe(error)) from None
    image.SetOrigin(placed.origin)
    _entries.put_place(image, placed.has_direction, placed.unit)


_METRIC = (
    ("yocto", -24), ("zepto", -21), ("atto", -18), ("femto", -15), ("pico", -12), ("nano", -9), ("micro", -6),
    ("milli", -3), ("centi", -2), ("deci", -1), ("", 0), ("hecto", 2), ("kilo", 3), ("mega", 6), ("giga", 9),
    ("tera", 12), ("peta", 15), ("exa", 18), ("zetta", 21), ("yotta", 24),
)  # fmt: skip
_OTHERS = {
    "angstrom": "1e-10", "inch": "0.0254", "foot": "0.3048", "yard": "0.9144", "mile": "1609.344",
    "parsec": "30856775814913673",
}  # fmt: skip
UNITS = {f"{prefix}meter": Fraction(10) ** power for prefix, power in _METRIC} | {
    name: Fraction(metres) for name, metres in _OTHERS.items()
}
"""Of OME-Zarr, in metres."""
_SHORT = {
    "m": "meter", "cm": "centimeter", "mm": "millimeter", "um": "micrometer", "µm": "micrometer", "μm": "micrometer",
    "micron": "micrometer", "nm": "nanometer",
}  # fmt: skip


def find_millimetres(unit: Any) -> float:
    """The millimetres of a unit; 1 for an unknown unit."""
    metres = UNITS.get(_SHORT.get(str(unit), str(unit)))
    return 1.0 if metres is None else float(1000 * metres)


def take(source: Any) -> Placed:
    """The voxels of a source that is no path, with its geometry: an array of Dask, or an array that NumPy can share."""
    if is_of(source, "xarray", "DataArray"):
        return _take_data_array(source)
    if isinstance(source, itk.ImageBase[3]):
        _bring_up_to_date(source)
        first = source.TransformIndexToPhysicalPoint(source.GetBufferedRegion().GetIndex())
        direction = itk.array_from_matrix(source.GetDirection())
        has_direction, unit = _entries.has_direction(source), _entries.get_unit(source)
        voxels = _share(source, _view_image(source))
        return Placed(voxels, source.GetSpacing(), first, direction, has_direction, unit)
    if is_of(source, "SimpleITK", "Image"):
        return _take_simple_itk(source)
    if is_of(source, "nibabel", "SpatialImage"):
        return _take_nibabel(source)
    if is_of(source, "monai", "MetaTensor"):
        return _take_meta_tensor(source)
    if is_of(source, "itk_shearwarpmip", "Volume"):
        placed: Placed = source.placed
        return placed
    if isinstance(getattr(source, "_meta", source), np.ma.MaskedArray):
        raise TypeError(
            "a masked array loses its mask: fill it, with its method filled() or dask.array.ma.filled(), or give its "
            "data, and mask=~np.ma.getmaskarray(array)"
        )
    if type(source) is np.ndarray or is_of(source, "dask", "Array"):
        return Placed(source)
    if isinstance(source, itk.DataObject) and hasattr(source, "GetImageDimension") and source.GetImageDimension() != 3:
        raise TypeError(
            f"a volume has 3 dimensions, but this itk.Image has {source.GetImageDimension()}: give a part of its array, "
            "with spacing, origin and direction"
        )
    if lost := [name for name in _GEOMETRY if not isinstance(source, type) and hasattr(source, name)]:
        raise TypeError(
            f"a {type(source).__module__}.{type(source).__qualname__} has a geometry of its own ({', '.join(lost)}), which "
            "is not known here: give numpy.asarray() of it, with spacing, origin and direction"
        )
    # other objects of ITK may have an array too
    is_array = hasattr(source, "__array__") or hasattr(source, "__dlpack__")
    is_array &= not is_of(source, "itk_shearwarpmip", "Turn")
    if isinstance(source, itk.Object) or is_of(source, "zarr", "Array") or isinstance(source, type) or not is_array:
        what = "None" if source is None else f"a {type(source).__module__}.{type(source).__qualname__}"
        hint = ": give an array of its voxels, with spacing, origin and direction" if source is not None else ""
        if isinstance(source, itk.ProcessObject):
            hint = ": give its output, GetOutput()"
        raise TypeError(
            "a volume is the path of an image, a 3D itk.Image of scalars, a SimpleITK.Image, an image of nibabel, an "
            f"xarray.DataArray, an array of Dask, NumPy or PyTorch, or an OME-Zarr, but this is {what}{hint}"
        )
    try:
        return Placed(np.asarray(source) if hasattr(source, "__array__") else np.from_dlpack(source))
    except (TypeError, RuntimeError, BufferError, ValueError) as error:
        raise TypeError(f"NumPy cannot take this array, which must be in the computer's memory: {error}") from error


_GEOMETRY = ("affine", "meta", "spacing")
"""Names by which arrays of other packages have a geometry."""


def is_ome_zarr(source: Any) -> bool:
    """Whether a source is an OME-Zarr image, as every URL must be."""
    if not isinstance(source, str | os.PathLike):
        return is_of(source, "zarr", "Group")
    path = Path(source)
    names = (".zgroup", ".zattrs", "zarr.json")
    return (
        "://" in str(source)
        or ".zarr" in path.suffixes
        or path.suffix == ".zip"
        or any((path / name).exists() for name in names)
    )


def is_chunked(source: Any) -> bool:
    """Whether Dask projects a source."""
    if is_of(source, "xarray", "DataArray"):
        source = source.variable._data
    return is_ome_zarr(source) or is_of(source, "dask", "Array") or is_of(source, "itk_shearwarpmip", "Volume")


def is_of(instance: Any, package: str, name: str) -> bool:
    """Whether an object has a class of a package, which may be missing."""
    return any(
        each.__name__ == name and each.__module__.partition(".")[0] == package for each in type(instance).__mro__
    )


def is_plain_array(source: Any) -> bool:
    """Whether an array has no geometry."""
    placed = (
        ("xarray", "DataArray"),
        ("SimpleITK", "Image"),
        ("nibabel", "SpatialImage"),
        ("monai", "MetaTensor"),
        ("itk_shearwarpmip", "Volume"),
    )
    return not (
        isinstance(source, str | os.PathLike | itk.Object)
        or is_ome_zarr(source)
        or any(is_of(source, *each) for each in placed)
    )


def describe(error: Exception) -> str:
    """An error's message in one line, without the places in ITK's sources."""
    text = str(error).rpartition("ITK ERROR: ")[2]
    words = text.split()
    if words and words[0].endswith("):"):
        del words[0]
    return " ".join(words) or type(error).__name__


def make_numbers(
    name: str, values: Any, count: int, is_whole: bool = False, is_finite: bool = True, parts: str = ""
) -> list[Any]:
    """Converts a keyword's value to a list of `count` numbers, two `parts` or three of "x, y, z"."""
    try:
        numbers = [] if isinstance(values, str) else [float(value) for value in values if is_number(value)]
    except (TypeError, ValueError):
        numbers = []
    is_right = all(number.is_integer() if is_whole else not is_finite or isfinite(number) for number in numbers)
    if len(numbers) != count or not is_right:
        kind = "whole" if is_whole else "finite" if is_finite else ""
        words = ["two" if count == 2 else "three", kind, "numbers"]
        named = parts or ("x, y, z" if count == 3 else "")
        what = " ".join(filter(None, words)) + (f", {named}" if named else "")
        raise ValueError(f"{name} must be {what}, but it is {show_value(values)}")
    return [int(number) for number in numbers] if is_whole else numbers


def show_value(value: Any) -> str:
    """A value in an error; it is not printed if it is long."""
    text = repr(value)
    if len(text) <= 200 and (not hasattr(value, "shape") or "\n" not in text):
        return text
    return f"an array of the shape {tuple(value.shape)}" if hasattr(value, "shape") else f"{text[:200]}..."


def make_count(name: str, value: Any, least: int = 1) -> int:
    count = np.asarray(value).tolist()
    if not isinstance(count, int) or isinstance(count, bool) or count < least:
        raise ValueError(f"{name} must be a whole number of at least {least}, but it is {show_value(value)}")
    return count


def is_number(value: Any) -> bool:
    """True and False are none."""
    return np.ndim(value) == 0 and isinstance(value, SupportsFloat) and not isinstance(value, bool | np.bool_)


def make_flag(name: str, value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} must be True or False, but it is {show_value(value)}")
    return bool(value)


def _make_direction(values: Any) -> NDArray[np.float64]:
    try:
        direction = np.eye(3) if values is None else np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        direction = np.empty(0)
    if direction.size != 9 or not np.isfinite(direction).all():
        raise ValueError(f"direction must be 3 x 3 finite numbers, but it is {show_value(values)}")
    return direction.reshape(3, 3)


def _require_unit_columns(direction: NDArray[np.float64]) -> None:
    lengths = np.linalg.norm(direction, axis=0)
    # zeros are ITK's to refuse
    if not np.all((np.abs(lengths - 1.0) < 1e-3) | (lengths == 0.0)):
        raise ValueError(
            f"direction must have columns of length 1, but their lengths are {lengths.tolist()}: see spacing"
        )


@cache
def _find_image_types() -> frozenset[Any]:
    return frozenset(image for (image,) in itk.ShearWarpMIPPartsImageFilter.keys())


@cache
def find_pixel_types() -> dict[np.dtype[Any], Any]:
    """ITK's types for the voxels that the filters take."""
    pixel_types = [itk.template(image)[1][0] for image in _find_image_types()]
    return {np.dtype(pixel_type.dtype): pixel_type for pixel_type in pixel_types}


def narrow(array: NDArray[Any]) -> NDArray[Any]:
    """Converts values to one of the types that the filters take."""
    native = array.dtype.newbyteorder("=")
    if native in find_pixel_types():
        return array.astype(native, copy=False)
    if native == np.float16:
        return array.astype(np.float32)
    if native.kind in "biu":
        small: Any = np.dtype({"b": np.uint8, "i": np.int16, "u": np.uint16}[native.kind])
        low, high = int(array.min()), int(array.max())
        if np.iinfo(small).min <= low and high <= np.iinfo(small).max:
            return array.astype(small)
        if max(-low, high) <= 1 << 53:
            return array.astype(np.float64)
    names = ", ".join(sorted(map(str, find_pixel_types())))
    raise TypeError(f"voxels must be one of {names}, or integers up to 2^53, but they are {native}; use astype()")


class _Voxels:
    """The voxels of an image. The image lives as long as arrays of its voxels."""

    def __init__(self, owner: Any, array: NDArray[Any]):
        self._owner = owner
        self.__array_interface__ = array.__array_interface__


def _share(owner: Any, array: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(_Voxels(owner, array))


def _view_image(image: Any) -> NDArray[Any]:
    if image.GetNumberOfComponentsPerPixel() != 1:
        raise TypeError(f"a {type(image).__name__} has several components{_ONE_COMPONENT}")
    array: NDArray[Any] | None = itk.array_view_from_image(image)
    if array is None:
        raise ValueError("a volume must not be empty, but this itk.Image has no voxels in memory")
    return array


def _take_data_array(source: Any) -> Placed:
    if set(source.dims) != set("xyz"):
        raise ValueError(
            f"a DataArray must have the dimensions z, y, x, but this one has {source.dims}: see its methods rename() and isel()"
        )
    units = {str(source.coords[name].attrs.get("units", "")) for name in "xyz" if name in source.coords}
    if len(units) > 1:
        raise ValueError("the coordinates of a DataArray must have the same units: convert them")
    steps, origin = [], []
    for name in "xyz":
        places = np.asarray(source.coords[name] if name in source.coords else range(source.sizes[name]))
        if places.dtype.kind not in "iuf":
            raise TypeError(
                f"the coordinates of a DataArray must be numbers, but the coordinates of {name} are {places.dtype}"
            )
        places = places.astype(float)
        if not places.size:
            raise ValueError(f"a volume must not be empty, but this one has the shape {source.shape}")
        step = (places[-1] - places[0]) / (places.size - 1) if places.size > 1 else 1.0
        # a hundredth of a voxel is rounding
        even = places[0] + step * np.arange(places.size)
        if not (step != 0 and np.allclose(places, even, 0, abs(step) / 100)):
            raise ValueError(
                f"the coordinates of a DataArray must go in equal steps, but the coordinates of {name} do not: "
                "see its method interp()"
            )
        steps.append(step)
        origin.append(places[0])
    placed = take(source.transpose(*"zyx").data)
    spacing, direction = np.abs(steps), source.attrs.get("direction")
    has_direction = direction is not None
    if has_direction:
        # ITK's conversion keeps it for z, y, x
        direction = np.flip(_make_direction(direction))
    if min(steps) < 0:
        if has_direction and not np.array_equal(direction, np.eye(3)):
            raise ValueError(
                "the coordinates of a DataArray with a direction must ascend, but some descend: see its method sortby()"
            )
        direction = np.diag(np.sign(steps))
    texts = _find_texts(source)
    has_direction = has_direction and texts.get("HasOrientation") != "0"
    unit = "".join(units) or texts.get("Unit")
    return Placed(placed.array, spacing.tolist(), origin, direction, has_direction, unit)


def _take_simple_itk(source: Any) -> Placed:
    if source.GetDimension() != 3 or source.GetNumberOfComponentsPerPixel() != 1:
        raise ValueError(
            f"a SimpleITK.Image must have 3 dimensions and 1 component, but this one has {source.GetDimension()} and "
            f"{source.GetNumberOfComponentsPerPixel()}: give image[..., 0] of a 4D one, and one component, as by "
            "SimpleITK.VectorIndexSelectionCast()"
        )
    simple = sys.modules["SimpleITK"]
    # it would end the process
    if source.GetPixelIDValue() >= simple.sitkLabelUInt8:
        raise TypeError("a SimpleITK.Image must have voxels of numbers, but this is a label map: convert it")
    array = simple.GetArrayViewFromImage(source)
    texts = _find_texts(source)
    has_direction, unit = texts.get("HasOrientation") != "0", texts.get("Unit")
    return Placed(
        _share(source, array), source.GetSpacing(), source.GetOrigin(), source.GetDirection(), has_direction, unit
    )


_ONE_COMPONENT = ", as a colour image has, but a volume has 1: give one of them, as by itk.vector_index_selection_cast_image_filter()"


def _take_nibabel(source: Any) -> Placed:
    shape = source.shape
    while len(shape) > 3 and shape[-1] == 1:
        shape = shape[:-1]
    if len(shape) != 3:
        raise ValueError(
            f"an image of nibabel must have 3 dimensions, but this one has the shape {source.shape}: give one of a 4D "
            "image, as image.slicer[..., 0]"
        )
    if source.affine is None:
        raise ValueError("this image of nibabel has no affine: give its array, with spacing, origin and direction")
    get_units = getattr(source.header, "get_xyzt_units", None)
    scale = find_millimetres(get_units()[0]) if get_units else 1.0
    to_lps = np.diag([-scale, -scale, scale, 1.0])
    return place_affine(np.asanyarray(source.dataobj).reshape(shape).T, to_lps @ source.affine)


def place_affine(array: Any, affine: NDArray[np.float64]) -> Placed:
    """An array with the 4 x 4 matrix from its indices x, y, z to places."""
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    with np.errstate(invalid="ignore"):
        # what is sheared remains so
        direction = affine[:3, :3] / spacing
    return Placed(array, spacing.tolist(), affine[:3, 3].tolist(), direction, True)


def _take_meta_tensor(source: Any) -> Placed:
    """A tensor of MONAI has the axes x, y, z, perhaps behind one channel, and an affine into RAS or LPS."""
    array = np.asarray(source.as_tensor())
    if array.ndim == 4 and len(array) == 1:
        array = array[0]
    if array.ndim != 3:
        raise ValueError(
            "a MetaTensor must have the axes x, y, z, or one channel before them, but this one has the shape "
            f"{array.shape}: give a part of it"
        )
    space = str(getattr(source.meta.get("space", "RAS"), "value", source.meta.get("space", "RAS")))
    if space not in ("RAS", "LPS"):
        raise ValueError(f"a MetaTensor must be in the space RAS or LPS, but this one is in {space}")
    to_lps = np.diag([-1.0, -1.0, 1.0, 1.0] if space == "RAS" else np.ones(4))
    return place_affine(array.T, to_lps @ np.asarray(source.affine, dtype=float))

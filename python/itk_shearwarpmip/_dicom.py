"""DICOM series, by the rules of the program shear-warp-mip: each slice lies where it says."""

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._inputs import Placed, describe, make_view, narrow, place

_SERIES, _POSITION, _ORIENTATION = "0020|000e", "0020|0032", "0020|0037"
_SPACING, _THICKNESSES = "0028|0030", ("0018|0088", "0018|0050")
_PHOTOMETRIC = "0028|0004"


class _Slice(NamedTuple):
    path: Path
    io: Any
    origin: NDArray[np.float64]
    directions: NDArray[np.float64]
    """Of rows, of columns, and the normal."""
    spacing: NDArray[np.float64]
    """Of columns and rows."""


def read_folder(folder: Path, series: str | None) -> Any:
    """The one series of a folder, or that of an instance UID, as an itk.Image with the first slice's dictionary."""
    found: dict[str, list[tuple[Path, Any]]] = {}
    others = []
    for path in sorted(folder.iterdir()):
        if path.is_dir() or path.name.startswith("."):
            continue
        if not path.is_file():
            raise OSError(f"'{path}' is no file or a link to nothing; a slice may be missing")
        io = _open(path)
        if io is not None:
            found.setdefault(_get(io, _SERIES), []).append((path, io))
        elif not _has_preamble(path):
            others.append(path)
        elif path.name != "DICOMDIR":
            warnings.warn(f"'{path}' has no image and is left out", stacklevel=6)
    if not found:
        raise ValueError(f"no DICOM series in the folder '{folder}'")
    extensions = {".dcm"} | {path.suffix for files in found.values() for path, _ in files}
    for path in others:
        if path.suffix in extensions and not _is_text(path):
            raise OSError(f"'{path}' is damaged or incomplete: it does not begin as DICOM does")
        if not _is_text(path):
            warnings.warn(f"'{path}' is not DICOM and left out", stacklevel=6)
    present = ", ".join(f"{uid} ({len(files)} files)" for uid, files in sorted(found.items()))
    if series is None and len(found) > 1:
        raise ValueError(f"'{folder}' has several DICOM series, choose one by series=: {present}")
    if series is not None and series not in found:
        raise ValueError(f"series {series} is not in '{folder}', which has {present}")
    return _read(found[series] if series is not None else next(iter(found.values())), folder)


def read_file(path: Path) -> Any:
    """The slice of a DICOM file as an itk.Image."""
    io = _open(path)
    if io is None:
        raise OSError(f"'{path}' is not a DICOM image")
    return _read([(path, io)], path)


def _open(path: Path) -> Any:
    """The reader of a DICOM image, with its header; None for what is no image."""
    io = itk.GDCMImageIO.New()
    reason = "it is damaged or incomplete"
    if io.CanReadFile(str(path)):
        io.SetFileName(str(path))
        try:
            io.ReadImageInformation()
            return io
        except RuntimeError as error:
            reason = describe(error)
    # a directory or a report has no rows
    if _has_preamble(path) and b"\x28\x00\x10\x00" in path.read_bytes():
        raise OSError(f"'{path}' cannot be read: {reason}")
    return None


def _has_preamble(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(132)[128:] == b"DICM"


def _is_text(path: Path) -> bool:
    with path.open("rb") as file:
        start = file.read(512)
    return bool(start) and all(code >= 32 or 9 <= code <= 13 for code in start)


def _get(io: Any, tag: str) -> str:
    dictionary = io.GetMetaDataDictionary()
    return str(dictionary[tag]).strip(" \0") if dictionary.HasKey(tag) else ""


def _get_numbers(io: Any, tag: str) -> NDArray[np.float64]:
    """As many finite numbers as there are, or none."""
    try:
        numbers = np.array([float(part) for part in _get(io, tag).split("\\")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def _make_slice(path: Path, io: Any) -> _Slice:
    def require(tag: str, count: int, name: str) -> NDArray[np.float64]:
        numbers = _get_numbers(io, tag)
        if numbers.size != count:
            raise ValueError(f"'{path}' has no valid {name}")
        return numbers

    if io.GetDimensions(2) > 1:
        raise ValueError(
            f"'{path}' has {io.GetDimensions(2)} frames, and ITK does not tell where each of them lies: if they are "
            "slices at equal distances in their order, give itk.imread() of it"
        )
    if io.GetNumberOfComponents() != 1:
        raise ValueError(f"'{path}' has {io.GetNumberOfComponents()} components, but a volume has 1")
    if _get(io, _PHOTOMETRIC) == "MONOCHROME1":
        raise ValueError(f"'{path}' is MONOCHROME1, whose values ITK inverts: give an image of its values")
    orientation = require(_ORIENTATION, 6, "orientation")
    position = require(_POSITION, 3, "position")
    spacing = require(_SPACING, 2, "pixel spacing")
    lengths = np.linalg.norm(orientation.reshape(2, 3), axis=1)
    # 3 decimals are not exact
    if not (np.abs(lengths - 1.0) < 1e-2).all():
        raise ValueError(f"'{path}' has no valid orientation: its rows and columns are not of length 1")
    row, column = orientation.reshape(2, 3) / lengths[:, np.newaxis]
    if not abs(row @ column) < 2e-3:
        raise ValueError(f"'{path}' has no valid orientation: its rows and columns are not at right angles")
    if not spacing.min() > 0:
        raise ValueError(f"'{path}' has no valid pixel spacing: it is not positive")
    normal = np.cross(row, column)
    normal /= np.linalg.norm(normal)
    row = np.cross(column, normal)
    row /= np.linalg.norm(row)
    return _Slice(path, io, position, np.array([row, np.cross(normal, row), normal]), spacing[::-1])


def _require_likeness(each: _Slice, first: _Slice) -> None:
    def are_like(what: str, is_like: Any) -> None:
        if not is_like:
            raise ValueError(f"'{each.path}' and '{first.path}' are of one series, but differ in {what}")

    are_like("orientation", (np.linalg.norm(each.directions - first.directions, axis=1) < 1e-3).all())
    are_like("size", [each.io.GetDimensions(n) for n in range(2)] == [first.io.GetDimensions(n) for n in range(2)])
    are_like("pixel spacing", (np.abs(each.spacing - first.spacing) < 1e-3 * first.spacing).all())


def _find_step(slices: list[_Slice]) -> NDArray[np.float64]:
    """From slice to slice, in mm; slices are sorted."""
    positions = np.array([each.origin @ slices[0].directions[2] for each in slices])
    gaps = np.diff(positions)
    closest, farthest = int(gaps.argmin()), int(gaps.argmax())
    if not gaps[closest] > 0.01 * gaps[farthest]:
        raise ValueError(f"two slices lie at one position: '{slices[closest].path}' and '{slices[closest + 1].path}'")
    if gaps[farthest] > 1.5 * gaps[closest]:
        raise ValueError(
            f"a slice is missing between '{slices[farthest].path}' at {positions[farthest]:g} mm and "
            f"'{slices[farthest + 1].path}' at {positions[farthest + 1]:g} mm; others are {gaps[closest]:g} mm apart"
        )
    origins = np.array([each.origin for each in slices])
    step: NDArray[np.float64] = (origins[-1] - origins[0]) / (len(slices) - 1)
    deviation = np.linalg.norm(origins - (origins[0] + np.arange(len(slices))[:, np.newaxis] * step), axis=1).max()
    message = f"the slices are not evenly spaced: one is {deviation:g} mm away from where it should be"
    if deviation > 0.5 * np.linalg.norm(step):
        raise ValueError(f"{message}, more than half of their distance")
    if deviation > 1e-3 * np.linalg.norm(step):
        warnings.warn(message, stacklevel=7)
    return step


def _read(files: list[tuple[Path, Any]], source: Path) -> Any:
    slices = [_make_slice(path, io) for path, io in files]
    first = slices[0]
    for each in slices:
        _require_likeness(each, first)
    slices.sort(key=lambda each: float(each.origin @ first.directions[2]))
    if len(slices) > 1:
        step = _find_step(slices)
    else:
        thicknesses = [abs(n) for tag in _THICKNESSES for n in _get_numbers(first.io, tag)[:1] if n != 0]
        if not thicknesses:
            raise ValueError(f"'{first.path}' has no valid slice thickness")
        step = thicknesses[0] * first.directions[2]
        hint = "" if source.is_dir() else "; for a whole series give its folder"
        warnings.warn(f"'{source}' has only one slice{hint}", stacklevel=6)
    try:
        arrays = [itk.array_from_image(itk.imread(str(each.path), imageio=each.io))[0] for each in slices]
    except (RuntimeError, KeyError) as error:
        raise OSError(f"the pixels of '{source}' cannot be read: {describe(error)}") from error
    is_one_type = len({array.dtype for array in arrays}) == 1
    voxels = narrow(np.stack(arrays, dtype=None if is_one_type else np.float64))
    image = make_view(voxels)
    # the slices of a tilted gantry make a sheared image
    distance = float(np.linalg.norm(step))
    direction = np.column_stack([*first.directions[:2], step / distance])
    place(image, Placed(voxels, [*first.spacing.tolist(), distance], slices[0].origin.tolist(), direction))
    image.SetMetaDataDictionary(slices[0].io.GetMetaDataDictionary())
    image.source_files = [each.path for each in slices]
    return image

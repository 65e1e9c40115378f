"""DICOM series, by the rules of the program shear-warp-mip: each slice lies at its own position."""

import filecmp
import mmap
import os
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._inputs import Placed, describe, make_view, narrow, place

_SERIES, _POSITION, _ORIENTATION = "0020|000e", "0020|0032", "0020|0037"
_SPACING, _THICKNESSES = "0028|0030", ("0018|0088", "0018|0050")
_PHOTOMETRIC, _FRAMES, _BITS = "0028|0004", "0028|0008", "0028|0100"
_TYPE, _PET_TYPE, _CLASS, _INSTANCE = "0008|0008", "0054|1000", "0008|0016", "0008|0018"
_DESCRIPTION, _MODALITY, _DATES, _NUMBER = "0008|103e", "0008|0060", ("0008|0021", "0008|0020"), "0020|0011"

_Files = list[tuple[Path, Any]]
"""Of a series, each with its reader."""
_SEGMENTATION = "1.2.840.10008.5.1.4.1.1.66.4"


class Slice(NamedTuple):
    path: Path
    name: str
    """Of the file, and of the frame if it has several."""
    size: tuple[int, int]
    """Columns and rows."""
    photometric: str
    origin: NDArray[np.float64]
    directions: NDArray[np.float64]
    """Of rows, of columns, and the normal."""
    spacing: NDArray[np.float64]
    """Of columns and rows."""
    thickness: float
    """0 if it is not known."""
    read: Callable[[], NDArray[Any]]
    """Its pixels, in rows."""


def read_folder(folder: Path, series: str | int | None) -> Any:
    """Reads the only or the chosen series of a folder and the folders in it, as an itk.Image with the first slice's
    dictionary."""
    found, left_out = _find_all_series(folder)
    files = next(iter(found.values())) if series is None and len(found) == 1 else _choose(found, series, folder)
    localizers = [path for path, io in files if "\\LOCALIZER" in _get(io, _TYPE)]
    if len(localizers) < len(files):
        left_out["localizer"] = localizers
        files = [(path, io) for path, io in files if "\\LOCALIZER" not in _get(io, _TYPE)]
    for kind, paths in left_out.items():
        if paths:
            more = f" and {len(paths) - 1} more" if len(paths) > 1 else ""
            warnings.warn(f"left out: '{paths[0]}'{more} ({kind})", stacklevel=5)
    return _read(files, folder)


def _find_all_series(folder: Path) -> tuple[dict[str, _Files], dict[str, list[Path]]]:
    """Returns all series, in the order of date, number and UID, and the files that are left out, by reason. A file
    that may be an image, but cannot be read, is an error."""
    found: dict[str, _Files] = {}
    instances: dict[str, Path] = {}
    others = []
    left_out: dict[str, list[Path]] = {"the same as another file": [], "no image": [], "not DICOM": []}
    for path in _list_files(folder, set()):
        if not path.is_file():
            raise OSError(f"'{path}' is no file or a link to nothing; a slice may be missing")
        io = _open(path)
        if io is not None:
            first = instances.setdefault(_get(io, _INSTANCE), path)
            if path != first and filecmp.cmp(path, first, shallow=False):
                left_out["the same as another file"].append(path)
            else:
                found.setdefault(_get(io, _SERIES), []).append((path, io))
        elif not _has_preamble(path):
            others.append(path)
        elif path.name.lower() != "dicomdir":
            left_out["no image"].append(path)
    if not found:
        raise ValueError(f"no DICOM series in the folder '{folder}'")
    extensions = {(path.parent, path.suffix) for files in found.values() for path, _ in files}
    for path in others:
        if _is_text(path):
            continue
        if path.suffix == ".dcm" or (path.parent, path.suffix) in extensions:
            raise OSError(f"'{path}' is damaged or incomplete: it does not begin as DICOM does")
        left_out["not DICOM"].append(path)
    order = sorted(found.items(), key=lambda each: (_find_date(each[1]), _get_count(each[1][0][1], _NUMBER), each[0]))
    return dict(order), left_out


def _list_files(folder: Path, known: set[str]) -> Iterator[Path]:
    """Lists the files of a folder and the folders in it, each folder once, without hidden files."""
    if (place := os.path.realpath(folder)) in known:
        return
    known.add(place)
    for path in sorted(folder.iterdir()):
        if not path.name.startswith("."):
            yield from _list_files(path, known) if path.is_dir() else [path]


def _choose(found: dict[str, _Files], series: str | int | None, folder: Path) -> _Files:
    """Chooses a series by UID, by the number in the list or by a part of the description."""
    wanted = "" if series is None else str(series)
    if wanted in found:
        return found[wanted]
    fitting = []
    for number, files in enumerate(found.values(), 1):
        if str(number) == wanted if wanted.isdigit() else wanted.lower() in _get(files[0][1], _DESCRIPTION).lower():
            fitting.append(files)
    if len(fitting) == 1:
        return fitting[0]
    present = "; ".join(_describe(n, uid, files) for n, (uid, files) in enumerate(found.items(), 1))
    if series is None:
        raise ValueError(
            f"'{folder}' has several DICOM series, choose one by its number or UID, as series=1 here or in open_image(): "
            f"{present}"
        )
    raise ValueError(f"series {series} {'fits several' if fitting else 'is not'} in '{folder}', which has {present}")


def _describe(number: int, uid: str, files: _Files) -> str:
    """Describes a series, such as "2: Thorax, CT, 2024-01-31, 40 images, 1.2.840.1"."""
    date, io = _find_date(files), files[0][1]
    if len(date) == 8:
        date = f"{date[:4]}-{date[4:6]}-{date[6:]}"
    count = sum(max(1, _get_count(each, _FRAMES)) for _, each in files)
    kind = "projection" if any(_is_projection(each) for _, each in files) else "image"
    words = [_get(io, _DESCRIPTION), _get(io, _MODALITY), date, f"{count} {kind}{'s' if count > 1 else ''}", uid]
    return f"{number}: {', '.join(filter(None, words))}"


def _find_date(files: _Files) -> str:
    """The date of the series, or of the study."""
    return next(filter(None, (_get(files[0][1], tag) for tag in _DATES)), "")


def _is_projection(io: Any) -> bool:
    terms = f"\\{_get(io, _TYPE)}\\"
    return any(f"\\{term}\\" in terms for term in ("PROJECTION IMAGE", "MAX_IP", "MIN_IP")) or "REPROJECTION" in _get(
        io, _PET_TYPE
    )


def read_file(path: Path) -> Any:
    """Reads the slice of a DICOM file as an itk.Image."""
    io = _open(path)
    if io is None:
        raise OSError(f"'{path}' is not a DICOM image")
    return _read([(path, io)], path)


def _open(path: Path) -> Any:
    """Returns the reader of a DICOM image, with its header, or None if the file is no image."""
    io = itk.GDCMImageIO.New()
    reason = "it is damaged or incomplete"
    try:
        if io.CanReadFile(str(path)):
            io.SetFileName(str(path))
            io.ReadImageInformation()
            if _has_all_pixels(path, io):
                return io
            reason = "it has fewer pixels than its size says"
    except RuntimeError as error:
        reason = describe(error)
    # a directory or a report has no rows
    if _has_preamble(path) and re.search(rb"\x28\x00\x10\x00|\x00\x28\x00\x10", path.read_bytes()):
        raise OSError(f"'{path}' cannot be read: {reason}")
    return None


_PIXEL_DATA = re.compile(rb"\xe0\x7f\x10\x00(?:(?:OB|OW|UN)..)?(.{4})|\x7f\xe0\x00\x10(?:OB|OW|UN)..(.{4})", re.DOTALL)
"""Matches the element of all transfer syntaxes except the deflated one, with its length (PS3.5 7.1). Compressed pixels
have the largest length."""


def _has_all_pixels(path: Path, io: Any) -> bool:
    """Whether a file has all its pixels. ITK would give missing pixels arbitrary values."""
    bits = io.GetDimensions(0) * io.GetDimensions(1) * io.GetDimensions(2) * int(_get(io, _BITS) or 0)
    with path.open("rb") as file:
        whole = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    found = None
    for found in _PIXEL_DATA.finditer(whole):
        if 8 * int.from_bytes(found[1] or found[2], "little" if found[1] else "big") >= bits:
            return True
    return found is None


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


def _get_count(io: Any, tag: str) -> int:
    text = _get(io, tag)
    return int(text) if text.isdigit() else 0


def _get_numbers(io: Any, tag: str) -> NDArray[np.float64]:
    """Returns the numbers of an attribute, or none if one is not finite."""
    try:
        numbers = np.array([float(part) for part in _get(io, tag).split("\\")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def _make_slices(path: Path, io: Any) -> list[Slice]:
    if io.GetNumberOfComponents() != 1:
        raise ValueError(f"'{path}' has colours, but a volume has one value for each voxel: give other images")
    # ITK does not tell where frames lie, and inverts MONOCHROME1
    if _get(io, _FRAMES) or _get(io, _PHOTOMETRIC) == "MONOCHROME1":
        try:
            from itk_shearwarpmip import _dicom_frames
        except ImportError as error:
            raise ImportError(
                f"'{path}' is multi-frame or MONOCHROME1, which needs pydicom: pip install itk-shearwarpmip[dicom]"
            ) from error
        return _dicom_frames.make_slices(path, (io.GetDimensions(0), io.GetDimensions(1)), io.GetDimensions(2))
    return [
        make_slice(
            path,
            f"'{path}'",
            (io.GetDimensions(0), io.GetDimensions(1)),
            _get(io, _PHOTOMETRIC),
            _get_numbers(io, _ORIENTATION),
            _get_numbers(io, _POSITION),
            _get_numbers(io, _SPACING),
            np.concatenate([_get_numbers(io, tag) for tag in _THICKNESSES]),
            lambda: itk.array_from_image(itk.imread(str(path), imageio=io))[0],
        )
    ]


def make_slice(
    path: Path,
    name: str,
    size: tuple[int, int],
    photometric: str,
    orientation: NDArray[np.float64],
    position: NDArray[np.float64],
    spacing: NDArray[np.float64],
    thicknesses: NDArray[np.float64],
    read: Callable[[], NDArray[Any]],
) -> Slice:
    """Makes a slice from the attributes of DICOM, which may be missing. `spacing` is that of rows, then of columns."""
    for what, numbers, count in (
        ("orientation", orientation, 6),
        ("position", position, 3),
        ("pixel spacing", spacing, 2),
    ):
        if numbers.size != count or not np.isfinite(numbers).all():
            raise ValueError(f"{name} has no valid {what}")
    lengths = np.linalg.norm(orientation.reshape(2, 3), axis=1)
    # 3 decimals are not exact
    if not (np.abs(lengths - 1.0) < 1e-2).all():
        raise ValueError(f"{name} has no valid orientation: its rows and columns are not of length 1")
    row, column = orientation.reshape(2, 3) / lengths[:, np.newaxis]
    if not abs(row @ column) < 2e-3:
        raise ValueError(f"{name} has no valid orientation: its rows and columns are not at right angles")
    if not spacing.min() > 0:
        raise ValueError(f"{name} has no valid pixel spacing: it is not positive")
    normal = np.cross(row, column)
    normal /= np.linalg.norm(normal)
    row = np.cross(column, normal)
    row /= np.linalg.norm(row)
    directions = np.array([row, np.cross(normal, row), normal])
    thickness = next((abs(float(each)) for each in thicknesses if each != 0), 0.0)
    return Slice(path, name, size, photometric, position, directions, spacing[::-1], thickness, read)


def _require_likeness(each: Slice, first: Slice) -> None:
    def are_like(what: str, is_like: Any) -> None:
        if not is_like:
            raise ValueError(f"{each.name} and {first.name} are of one series, but differ in {what}")

    are_like("orientation", (np.linalg.norm(each.directions - first.directions, axis=1) < 1e-3).all())
    are_like("size", each.size == first.size)
    are_like("pixel spacing", (np.abs(each.spacing - first.spacing) < 1e-3 * first.spacing).all())
    are_like("photometric interpretation", each.photometric == first.photometric)


def _find_step(slices: list[Slice]) -> NDArray[np.float64]:
    """Finds the step from slice to slice, in mm. The slices must be sorted."""
    origins = np.array([each.origin for each in slices])
    positions = origins @ slices[0].directions[2]
    gaps = np.abs(np.diff(positions))
    closest, farthest = int(gaps.argmin()), int(gaps.argmax())
    if not gaps[closest] > 0.01 * gaps[farthest]:
        raise ValueError(f"two slices lie at one position: {slices[closest].name} and {slices[closest + 1].name}")
    if gaps[farthest] > 1.5 * gaps[closest]:
        raise ValueError(
            f"a slice is missing between {slices[farthest].name} at {positions[farthest]:g} mm and "
            f"{slices[farthest + 1].name} at {positions[farthest + 1]:g} mm; others are {gaps[closest]:g} mm apart"
        )
    step: NDArray[np.float64] = (origins[-1] - origins[0]) / (len(slices) - 1)
    deviation = np.linalg.norm(origins - (origins[0] + np.arange(len(slices))[:, np.newaxis] * step), axis=1).max()
    message = f"the slices are not evenly spaced: one is {deviation:g} mm away from where it should be"
    if deviation > 0.5 * np.linalg.norm(step):
        raise ValueError(f"{message}, more than half of their distance")
    if deviation > 1e-3 * np.linalg.norm(step):
        warnings.warn(message, stacklevel=7)
    return step


def _read(files: _Files, source: Path) -> Any:
    for path, io in files:
        if _get(io, _CLASS) == _SEGMENTATION:
            raise ValueError(f"'{path}' is a DICOM segmentation: convert it to an image of labels, as by highdicom")
        if _is_projection(io):
            raise ValueError(f"'{path}' is a projection, not a part of a volume: give the series that it was made from")
    slices = [each for path, io in files for each in _make_slices(path, io)]
    first = slices[0]
    for each in slices:
        _require_likeness(each, first)
    positions = [float(each.origin @ first.directions[2]) for each in slices]
    # the frames of one file keep their order
    is_backward = len(files) == 1 and positions[-1] < positions[0]
    slices = [slices[n] for n in np.argsort(np.negative(positions) if is_backward else positions, kind="stable")]
    if len(slices) > 1:
        step = _find_step(slices)
    else:
        if not first.thickness:
            raise ValueError(f"{first.name} has no valid slice thickness")
        step = first.thickness * first.directions[2]
        hint = "" if source.is_dir() else "; for a whole series give its folder"
        warnings.warn(f"'{source}' has only one slice{hint}", stacklevel=6)
    try:
        arrays = [each.read() for each in slices]
    except (RuntimeError, KeyError) as error:
        raise OSError(f"the pixels of '{source}' cannot be read: {describe(error)}") from error
    is_one_type = len({array.dtype for array in arrays}) == 1
    voxels = narrow(np.stack(arrays, dtype=None if is_one_type else np.float64))
    image = make_view(voxels)
    # the slices of a tilted gantry make a sheared image
    distance = float(np.linalg.norm(step))
    direction = np.column_stack([*first.directions[:2], step / distance])
    place(image, Placed(voxels, [*first.spacing.tolist(), distance], slices[0].origin.tolist(), direction, True))
    image.SetMetaDataDictionary(dict(files)[slices[0].path].GetMetaDataDictionary())
    image.source_files = list(dict.fromkeys(each.path for each in slices))
    image.is_inverted = first.photometric == "MONOCHROME1"
    return image

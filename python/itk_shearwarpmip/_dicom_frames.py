"""The slices of DICOM files that ITK's Python does not read correctly: multi-frame and MONOCHROME1."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import itk
import numpy as np
import pydicom
from numpy.typing import NDArray
from pydicom.dataset import Dataset

from itk_shearwarpmip._dicom import Slice, make_slice
from itk_shearwarpmip._inputs import describe

_PIXELS = (
    "SamplesPerPixel", "PhotometricInterpretation", "NumberOfFrames", "Rows", "Columns", "BitsAllocated", "BitsStored",
    "HighBit", "PixelRepresentation", "PixelData",
)  # fmt: skip


def make_slices(path: Path, size: tuple[int, int], frames: int) -> list[Slice]:
    """Returns the slices of one file; `size` is columns and rows. Attributes are in the functional groups of the frame
    or of all frames (PS3.3 C.7.6.16), in the file itself, or with the detector."""
    header = pydicom.dcmread(path, stop_before_pixels=True, force=True)
    groups = header.get("PerFrameFunctionalGroupsSequence")
    if groups and len(groups) != frames:
        raise ValueError(f"'{path}' has {frames} frames, but describes {len(groups)}")
    stored = cache(partial(_read_stored, path))
    return [_make_slice(path, header, size, frame, frames, stored) for frame in range(frames)]


def _make_slice(
    path: Path, header: Dataset, size: tuple[int, int], frame: int, frames: int, stored: Callable[[], NDArray[Any]]
) -> Slice:
    own = _get_item(header.get("PerFrameFunctionalGroupsSequence"), frame)
    shared = _get_item(header.get("SharedFunctionalGroupsSequence"))
    detector = _get_item(header.get("DetectorInformationSequence"))

    def find(group: str, name: str) -> NDArray[np.float64]:
        scopes = (_get_item(own.get(group)), _get_item(shared.get(group)), header, detector)
        return next((numbers for scope in scopes if (numbers := _get_numbers(scope, name)).size), np.empty(0))

    name = f"frame {frame + 1} of '{path}'" if frames > 1 else f"'{path}'"
    slope, intercept = (find("PixelValueTransformationSequence", f"Rescale{each}") for each in ("Slope", "Intercept"))
    if "DoseGridScaling" in header:
        slope, intercept = _get_numbers(header, "DoseGridScaling"), np.zeros(1)
    elif not slope.size and not intercept.size:
        slope, intercept = np.ones(1), np.zeros(1)
    if slope.size != 1 or slope[0] == 0 or intercept.size != 1:
        raise ValueError(f"{name} has no valid rescale slope and intercept")

    made = make_slice(
        path,
        name,
        size,
        header.get("PhotometricInterpretation", ""),
        find("PlaneOrientationSequence", "ImageOrientationPatient"),
        find("PlanePositionSequence", "ImagePositionPatient"),
        find("PixelMeasuresSequence", "PixelSpacing"),
        np.concatenate([find("PixelMeasuresSequence", each) for each in ("SpacingBetweenSlices", "SliceThickness")]),
        lambda: _rescale(stored()[frame], slope[0], intercept[0], header, name),
    )
    return made._replace(origin=made.origin + _find_offset(header, frame, frames, made))


def _get_item(items: Sequence[Dataset] | None, number: int = 0) -> Dataset:
    """Returns an item of a sequence, or an empty one if there is none."""
    return items[number] if items and number < len(items) else Dataset()


def _get_numbers(dataset: Dataset, name: str) -> NDArray[np.float64]:
    """Returns the numbers of an attribute, or none if it has no valid numbers."""
    try:
        value = dataset.get(name)
        return np.atleast_1d(np.array([] if value in (None, "") else value, float))
    except (TypeError, ValueError):
        return np.empty(0)


def _find_offset(header: Dataset, frame: int, frames: int, made: Slice) -> NDArray[np.float64]:
    """Finds the offset of a frame from the position in the file, for dose and nuclear medicine (PS3.3 C.8.8.3.2 and
    C.8.4.15)."""
    superior, normal = np.array([0.0, 0.0, 1.0]), made.directions[2]
    offsets = _get_numbers(header, "GridFrameOffsetVector")
    if offsets.size == frames:
        return np.asarray((offsets[frame] - offsets[0]) * (normal if offsets[0] == 0 else superior), float)
    distance = _get_numbers(header, "SpacingBetweenSlices")
    if header.get("FrameIncrementPointer") != 0x00540080 or distance.size != 1:
        return np.zeros(3)
    order = _get_numbers(header, "SliceVector")
    if order.size and (frame >= order.size or order[frame] != frame + 1):
        raise ValueError(f"{made.name} is not in the order of the slices")
    return np.asarray(frame * distance[0] * normal, float)


def _read_stored(path: Path) -> NDArray[Any]:
    """Reads the stored pixels of all frames. ITK decodes them from a file that contains only the pixels."""
    plain = pydicom.dcmread(path, force=True, specific_tags=list(_PIXELS))
    plain.PhotometricInterpretation = "MONOCHROME2"
    plain.SOPClassUID = pydicom.uid.SecondaryCaptureImageStorage
    plain.SOPInstanceUID = plain.file_meta.MediaStorageSOPInstanceUID = "1.2"
    plain.file_meta.MediaStorageSOPClassUID = plain.SOPClassUID
    with TemporaryDirectory(prefix="shear-warp-mip-") as folder:
        made = Path(folder, "pixels.dcm")
        plain.save_as(made)
        try:
            pixels: NDArray[Any] = itk.array_from_image(itk.imread(str(made), imageio=itk.GDCMImageIO.New()))
            return pixels
        except (RuntimeError, KeyError) as error:
            raise OSError(f"the pixels of '{path}' cannot be read: {describe(error)}") from error


def _rescale(stored: NDArray[Any], slope: float, intercept: float, header: Dataset, name: str) -> NDArray[Any]:
    """Rescales to the type that ITK chooses: the least integer type for all values of the stored bits, or float64."""
    if slope == 1 and intercept == 0:
        return stored
    bits, is_signed = int(header.BitsStored), bool(header.PixelRepresentation)
    ends = slope * np.array([-(2 ** (bits - 1)), 2 ** (bits - 1) - 1] if is_signed else [0, 2**bits - 1]) + intercept
    values = slope * stored.astype(np.float64) + intercept
    kinds = ("u1", "u2", "u4") if ends[0] >= 0 else ("i1", "i2", "i4")
    fitting = [each for each in kinds if np.iinfo(each).min <= ends[0] and ends[1] <= np.iinfo(each).max]
    if not fitting or slope < 0 or not float(slope).is_integer() or not float(intercept).is_integer():
        return values
    if not ends[0] <= values.min() <= values.max() <= ends[1]:
        raise ValueError(f"{name} has values beyond its stored bits")
    return values.astype(fitting[0])

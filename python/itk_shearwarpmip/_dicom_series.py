"""DICOM series of the frames of a turn. apps/DicomSeries.h gives the reasons for the attributes."""

import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
from numpy.typing import NDArray
from pydicom.dataset import Dataset
from pydicom.misc import is_dicom
from pydicom.uid import (
    CTImageStorage,
    ExplicitVRLittleEndian,
    MRImageStorage,
    SecondaryCaptureImageStorage,
    generate_uid,
)
from pydicom.valuerep import format_number_as_ds

from itk_shearwarpmip import _entries


def _tags(text: str) -> list[int]:
    return [int(tag, 16) for tag in text.split()]


# PS3.3 C.7.1.1, C.7.2.1, C.7.2.2
_PATIENT_AND_STUDY = _tags(
    """00080005 00080020 00080030 00080050 00080090 00081030 00081080 00100010 00100020 00100021 00100030 00100032
    00100040 00101000 00101001 00101010 00101020 00101030 00102160 00102180 001021b0 00104000 00120062 00120063
    00120064 0020000d 00200010"""
)
# PS3.3 C.7.3.1, C.7.4.1, C.7.10.1, and lossy compression of C.7.6.1
_SERIES_AND_ACQUISITION = _tags(
    """00080022 0008002a 00080032 00180015 00181030 00185100 00200012 00200052 00200060 00201040 00282110 00282112
    00282114"""
)
# PS3.3 C.7.6.4
_CONTRAST = _tags("00180010 00181040 00181041 00181042 00181043 00181044 00181046 00181047 00181048 00181049")
# PS3.3 C.8.2.1, C.8.3.1
_IMAGE = {
    CTImageStorage: _tags("00180060 00200012"),
    MRImageStorage: _tags(
        """00180020 00180021 00180022 00180023 00180024 00180025 00180080 00180081 00180082 00180084 00180085 00180087
        00180091 00181060 00181314"""
    ),
}
# PS3.3 C.7.5.1
_EQUIPMENT = _tags("00080070 00080080 00081010 00081090 00181000 00181020")
# PS3.3 C.11.2
_WINDOW = _tags("00281050 00281051 00281055 00281056")
# type 2: there without a value if the source has none
_EMPTY = set(
    _tags(
        """00080020 00080030 00080050 00080090 00100010 00100020 00100030 00100040 00180022 00180023 00180060 00180081
        00180091 00200010 00200012 00201040"""
    )
)


def write_series(turn: Any, folder: Path, window: tuple[float, float] | None) -> None:
    """Writes each frame as a file into a new folder. See save_turn()."""
    pixels = np.asarray(turn.frames)
    rescale = _Rescale(pixels)
    # a source may have values that break the standard's rules
    with pydicom.config.disable_value_validation():
        header = _make_header(turn, rescale, window)
        folder.mkdir()
        angles = dict(turn.frames).get("FrameAngles", [None] * len(pixels))
        width = max(3, len(str(len(pixels))))
        for number, (frame, transform, angle) in enumerate(zip(pixels, turn.transforms, angles, strict=True), 1):
            dataset = Dataset()
            dataset.update(header)
            dataset.update(_make_plane(turn, transform, number))
            dataset.SOPInstanceUID = generate_uid()
            dataset.InstanceNumber = number
            if angle is not None:
                dataset.ImageComments = f"Turned by {angle + 0.0:.15g} degrees"
            dataset.add_new("PixelData", "OW", rescale.apply(frame).tobytes())
            dataset.ensure_file_meta()
            dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
            pydicom.dcmwrite(folder / f"frame-{number:0{width}}.dcm", dataset, enforce_file_format=True)


class _Rescale:
    """The conversion of values to numbers from 0 to 65535, or from -32768 to 32767 with a sign."""

    def __init__(self, pixels: NDArray[Any]) -> None:
        self.slope, self.intercept, self.is_signed = 1.0, 0.0, False
        self.lowest, self.highest = float(pixels.min()), float(pixels.max())
        if not np.isfinite(self.highest - self.lowest):
            raise ValueError("frames have pixels that are not finite, which DICOM cannot hold")
        are_whole = pixels.dtype.kind in "iu" or bool((pixels == np.rint(pixels)).all())
        if are_whole and self.lowest >= -32768.0 and self.highest <= 32767.0:
            self.is_signed = self.lowest < 0.0
        elif not are_whole or self.lowest < 0.0 or self.highest > 65535.0:
            # as a reader finds them
            self.intercept = float(format_number_as_ds(self.lowest))
            extent = self.highest - self.intercept
            is_exact = are_whole and extent <= 65535.0 and self.intercept == self.lowest
            if extent > 0.0 and not is_exact:
                self.slope = float(format_number_as_ds(extent / 65535.0))

    def is_identity(self) -> bool:
        return self.slope == 1.0 and self.intercept == 0.0

    def apply(self, pixels: NDArray[Any]) -> NDArray[np.integer[Any]]:
        least = -32768 if self.is_signed else 0
        numbers = np.floor((pixels.astype(np.float64) - self.intercept) / self.slope + 0.5)
        return np.clip(numbers, least, least + 65535).astype("<i2" if self.is_signed else "<u2")


def _read_sources(turn: Any) -> Iterator[Dataset]:
    for path in turn.source_files:
        if Path(path).is_file() and is_dicom(path):
            yield pydicom.dcmread(path, stop_before_pixels=True)


def _convert(source_metadata: Mapping[str, Any]) -> Dataset:
    """Converts the attributes of text that ITK found in a DICOM file, as "gggg|eeee"."""
    dataset = Dataset()
    for key, value in source_metadata.items():
        if re.fullmatch("[0-9a-f]{4}\\|[0-9a-f]{4}", key) and isinstance(value, str):
            tag = int(key.replace("|", ""), 16)
            if pydicom.datadict.dictionary_has_tag(tag):
                vr = pydicom.datadict.dictionary_VR(tag)
                if vr in pydicom.valuerep.STR_VR:
                    dataset.add_new(tag, vr, value.rstrip(" \0"))
    return dataset


def _copy(source: Dataset, target: Dataset, tags: Iterable[int]) -> None:
    for tag in tags:
        if tag in source:
            target[tag] = source[tag]
        elif tag in _EMPTY:
            target.add_new(tag, pydicom.datadict.dictionary_VR(tag), None)


def _make_code(value: str, meaning: str) -> Dataset:
    """A code of PS3.16."""
    code = Dataset()
    code.CodeValue, code.CodingSchemeDesignator, code.CodeMeaning = value, "DCM", meaning
    return code


def _make_header(turn: Any, rescale: _Rescale, window: tuple[float, float] | None) -> Dataset:
    """Makes the attributes that all frames have."""
    sources = list(_read_sources(turn))
    source = sources[0] if sources else _convert(turn.source_metadata)
    sop_class = source.get("SOPClassUID")
    # these two are type 1; an MR image has no rescaling
    is_mr = bool(source.get("ScanningSequence") and source.get("SequenceVariant")) and rescale.is_identity()
    if sop_class != CTImageStorage and not (sop_class == MRImageStorage and is_mr):
        sop_class = SecondaryCaptureImageStorage

    header = Dataset()
    _copy(source, header, [*_PATIENT_AND_STUDY, *_SERIES_AND_ACQUISITION])
    for name in ("StudyInstanceUID", "FrameOfReferenceUID"):
        if not header.get(name):
            setattr(header, name, generate_uid())
    # required of a paired body part, forbidden of others (PS3.3 C.7.3.1)
    if not source.get("BodyPartExamined") and "Laterality" not in header:
        header.Laterality = None
    now = datetime.now()
    for name in ("InstanceCreation", "Series", "Content"):
        setattr(header, f"{name}Date", f"{now:%Y%m%d}")
        setattr(header, f"{name}Time", f"{now:%H%M%S.%f}")

    is_minimum = turn.mode == "minimum"
    short, what = ("MinIP", "Minimum intensity projection") if is_minimum else ("MIP", "Maximum intensity projection")
    description = f"{short} {source.get('SeriesDescription') or ''}".strip()
    header.SeriesDescription = description if len(description) <= 64 else short
    header.SeriesInstanceUID = generate_uid()
    header.SeriesNumber = min(int(source.get("SeriesNumber") or 0), 1000000) + 1000
    header.SOPClassUID = sop_class
    header.Manufacturer = ""
    header.ManufacturerModelName = "itk-shearwarpmip"
    header.SoftwareVersions = metadata.version("itk-shearwarpmip")
    if source.get("Manufacturer"):
        item = Dataset()
        _copy(source, item, _EQUIPMENT)
        item.PurposeOfReferenceCodeSequence = [_make_code("109101", "Acquisition Equipment")]
        header.ContributingEquipmentSequence = [item]
    header.ImageType = ["DERIVED", "SECONDARY", "PROJECTION IMAGE", "MIN_IP" if is_minimum else "MAX_IP"]
    header.DerivationDescription = what + (" of absolute values" if turn.mode == "absolute_maximum" else "")
    header.DerivationCodeSequence = [_make_code("113079" if is_minimum else "113078", what)]
    if sources:
        header.SourceImageSequence = [_make_reference(each) for each in sources]
    header.BurnedInAnnotation = "YES" if source.get("BurnedInAnnotation") == "YES" else "NO"

    header.Modality = source.get("Modality") or "OT"
    if sop_class == SecondaryCaptureImageStorage:
        header.ConversionType = "WSD"
    else:
        header.Modality = "CT" if sop_class == CTImageStorage else "MR"
        _copy(source, header, [*_CONTRAST, *_IMAGE[sop_class]])
    if sop_class != MRImageStorage:
        header.RescaleIntercept = format_number_as_ds(rescale.intercept)
        header.RescaleSlope = format_number_as_ds(rescale.slope)
        unit = source.get("RescaleType") or "US"
        header.RescaleType = "HU" if unit == "US" and header.Modality == "CT" else unit
    _set_window(header, source, rescale, window)

    is_inverted = _entries.is_inverted(turn.frames)
    header.PhotometricInterpretation = "MONOCHROME1" if is_inverted else "MONOCHROME2"
    header.Columns, header.Rows, _ = (int(length) for length in turn.frames.GetLargestPossibleRegion().GetSize())
    header.SamplesPerPixel = 1
    header.BitsAllocated = header.BitsStored = 16
    header.HighBit = 15
    header.PixelRepresentation = int(rescale.is_signed)
    return header


def _make_reference(source: Dataset) -> Dataset:
    item = Dataset()
    item.ReferencedSOPClassUID, item.ReferencedSOPInstanceUID = source.SOPClassUID, source.SOPInstanceUID
    item.PurposeOfReferenceCodeSequence = [_make_code("121322", "Source image for image processing operation")]
    return item


def _set_window(header: Dataset, source: Dataset, rescale: _Rescale, window: tuple[float, float] | None) -> None:
    if window is None and all(source.get(name) not in (None, "") for name in ("WindowCenter", "WindowWidth")):
        _copy(source, header, _WINDOW)
        return
    low, high = window or (rescale.lowest, rescale.highest)
    # the default function counts whole numbers, its width is at least 1 (PS3.3 C.11.2.1.2.1 and C.11.2.1.3.2)
    is_exact = rescale.slope != 1.0 and high > low
    more = 0.0 if is_exact else 1.0
    header.WindowCenter = format_number_as_ds(0.5 * (low + high + more))
    header.WindowWidth = format_number_as_ds(high - low + more)
    if is_exact:
        header.VOILUTFunction = "LINEAR_EXACT"


def _make_plane(turn: Any, transform: Any, number: int) -> Dataset:
    """The plane of a frame: in the middle of the slab, or through the image's center."""
    start = np.array(transform.TransformPoint([0.0, 0.0, 0.0]))
    axes = np.array([transform.TransformPoint(list(axis)) for axis in np.eye(3)]) - start
    near, far = turn.slab or (-np.inf, np.inf)
    if np.isfinite(far - near):
        depth = 0.5 * (near + far)
    else:
        depth = 0.0 if turn.center is None else np.linalg.solve(axes.T, np.array(turn.center) - start)[2]
    lengths = np.linalg.norm(axes[:2], axis=1)
    right, down = axes[:2] / lengths[:, np.newaxis]
    if abs(right @ down) >= 1e-5:
        raise ValueError(f"the view of frame {number} is sheared: rows and columns of DICOM must be at right angles")
    spacing = np.array(turn.frames.GetSpacing())[:2] * lengths
    position = start + np.array([*list(turn.frames.GetOrigin())[:2], depth]) @ axes
    thickness = (far - near) * abs(axes[2] @ np.cross(right, down))

    plane = Dataset()
    plane.SliceThickness = format_number_as_ds(float(thickness)) if np.isfinite(thickness) else None
    plane.PixelSpacing = _format(spacing[::-1])
    plane.ImagePositionPatient = _format(position)
    plane.ImageOrientationPatient = _format([*right, *down])
    plane.PatientOrientation = [_name_direction(right), _name_direction(down)]
    return plane


def _format(numbers: Iterable[float]) -> list[str]:
    return [format_number_as_ds(float(number) + 0.0) for number in numbers]


def _name_direction(direction: NDArray[np.float64]) -> str:
    """One or two letters for a direction, as by ComputeEdgeLetters() in apps/Orientation.h."""
    first, second = np.argsort(-abs(direction), kind="stable")[:2]
    axes = [first, second] if abs(direction[second]) >= np.sin(np.pi / 8) else [first]
    return "".join(("RL", "AP", "FH")[axis][int(direction[axis] > 0.0)] for axis in axes)

#!/usr/bin/env python3
"""Writes a small synthetic DICOM study, as a disc from a hospital has it: DICOMDIR and nested folders.

All series show the same body with two bright spots, each on a grid of its own:

    CT thorax            axial, and one localizer in the same series
    CT tilted            gantry tilted by 20 degrees
    CT enhanced          one multi-frame file, frames in no order
    CT incomplete        a slice is missing
    MR T1                sagittal
    PET attenuation      axial, a rescale slope for each slice

    make_study.py study
"""

import argparse
from pathlib import Path

try:
    import numpy as np
    from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
    from pydicom.fileset import FileSet
    from pydicom.uid import ExplicitVRLittleEndian, generate_uid
except ImportError as error:
    raise SystemExit(
        f"make_study.py needs NumPy and pydicom, such as by 'pip install numpy pydicom': {error}"
    ) from error

CT = "1.2.840.10008.5.1.4.1.1.2"
ENHANCED_CT = "1.2.840.10008.5.1.4.1.1.2.1"
MR = "1.2.840.10008.5.1.4.1.1.4"
PET = "1.2.840.10008.5.1.4.1.1.128"

# center of the brightest spot in the patient's space, mm: at the left, anterior, superior
SPOT = (30.0, -20.0, 25.0)
FAINT_SPOT = (-25.0, 10.0, -20.0)
WIDTH = 6.0  # standard deviation of a spot, mm
AXIAL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
SAGITTAL = ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0))


def uid(*names):
    """The same for the same names."""
    return generate_uid(entropy_srcs=["synthetic study", *map(str, names)])


def sample(position, axes, spacing, shape):
    """Whether each pixel of a slice is in the body, and the brightness of the spots, at most 1."""
    rows, columns = np.indices(shape)
    points = np.array(position, float)[:, None, None] + sum(
        np.array(axis)[:, None, None] * distance * number
        for axis, distance, number in zip(axes, spacing[::-1], (columns, rows))
    )
    in_body = ((points[0] / 55.0) ** 2 + (points[1] / 40.0) ** 2 < 1.0) & (abs(points[2]) < 45.0)
    spots = 0.0
    for center, brightness in ((SPOT, 1.0), (FAINT_SPOT, 0.5)):
        distances = ((points - np.array(center)[:, None, None]) ** 2).sum(axis=0)
        spots = np.maximum(spots, brightness * np.exp(-0.5 * distances / WIDTH**2))
    return in_body, spots


def group(**attributes):
    """A sequence of one item."""
    item = Dataset()
    for name, value in attributes.items():
        setattr(item, name, value)
    return [item]


def code(value, meaning):
    """Of SNOMED CT, as a sequence of one item."""
    return group(CodeValue=value, CodingSchemeDesignator="SCT", CodeMeaning=meaning)


def new_image(sop_class, modality, number, description, instance):
    """What images of all modalities have: patient, study, series, equipment, pixels of 16 bits."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop_class
    meta.MediaStorageSOPInstanceUID = uid(number, instance)
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    image = FileDataset("", {}, file_meta=meta, preamble=bytes(128))
    image.is_little_endian, image.is_implicit_VR = True, False
    image.SOPClassUID, image.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    image.SpecificCharacterSet = "ISO_IR 100"
    image.PatientName, image.PatientID = "Synthetic^Body", "SYN-1"
    image.PatientBirthDate, image.PatientSex = "19700101", "O"
    image.PatientWeight, image.PatientSize = "70", "1.75"
    image.StudyInstanceUID, image.StudyID = uid("study"), "1"
    image.StudyDate = image.SeriesDate = image.AcquisitionDate = image.ContentDate = "20240131"
    image.StudyTime, image.SeriesTime = "100000", f"10{number:02}00"
    image.AcquisitionTime = image.ContentTime = image.SeriesTime
    image.StudyDescription, image.AccessionNumber, image.ReferringPhysicianName = "Synthetic study", "A1", ""
    image.Modality, image.SeriesInstanceUID = modality, uid(number)
    image.SeriesNumber, image.SeriesDescription = number, description
    image.BodyPartExamined, image.PatientPosition = "CHEST", "HFS"
    image.FrameOfReferenceUID, image.PositionReferenceIndicator = uid("frame of reference"), ""
    image.Manufacturer, image.ManufacturerModelName = "Synthetic", "make_study.py"
    image.DeviceSerialNumber, image.SoftwareVersions = "1", "1"
    image.InstanceNumber, image.AcquisitionNumber = instance, 1
    image.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
    image.SamplesPerPixel, image.PhotometricInterpretation = 1, "MONOCHROME2"
    image.BitsAllocated, image.BitsStored, image.HighBit = 16, 16, 15
    return image


def set_plane(image, position, axes, spacing, thickness):
    image.ImagePositionPatient = [f"{x:.6g}" for x in position]
    image.ImageOrientationPatient = [f"{x:.6g}" for axis in axes for x in axis]
    image.PixelSpacing, image.SliceThickness = list(spacing), thickness


def set_pixels(image, pixels):
    pixels = np.asarray(pixels)
    image.PixelRepresentation = int(pixels.dtype.kind == "i")
    image.Rows, image.Columns = pixels.shape[-2:]
    image.PixelData = pixels.tobytes()
    image["PixelData"].VR = "OW"


def hounsfield(position, axes, spacing, shape):
    """Stored as CT does, 1024 higher."""
    in_body, spots = sample(position, axes, spacing, shape)
    return np.round(np.where(in_body, 40.0 + 1000.0 * spots, -1000.0) + 1024.0).astype(np.uint16)


def set_ct(image):
    image.RescaleIntercept, image.RescaleSlope, image.RescaleType = "-1024", "1", "HU"
    image.WindowCenter, image.WindowWidth = "300", "1500"
    image.KVP = "120"


def ct_slice(number, description, instance, position, axes=AXIAL, shape=(40, 52), spacing=(2.5, 2.5)):
    image = new_image(CT, "CT", number, description, instance)
    set_plane(image, position, axes, spacing, "4")
    set_pixels(image, hounsfield(position, axes, spacing, shape))
    set_ct(image)
    return image


def ct_thorax():
    slices = [ct_slice(1, "CT thorax", n + 1, (-63.75, -48.75, 4.0 * n - 46.0)) for n in range(24)]
    coronal = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    localizer = ct_slice(1, "CT thorax", 25, (-63.75, 0.0, 46.0), coronal)
    localizer.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    del localizer.RescaleType
    return [*slices, localizer]


def ct_tilted():
    """Rows are level, columns lean by the tilt; slices follow the table, along the patient's axis."""
    tilt = np.radians(20.0)
    axes = ((1.0, 0.0, 0.0), (0.0, np.cos(tilt), np.sin(tilt)))
    start = -48.75 * np.array(axes[1])
    slices = [ct_slice(2, "CT tilted", n + 1, (-63.75, start[1], start[2] + 4.0 * n - 46.0), axes) for n in range(24)]
    for image in slices:
        image.GantryDetectorTilt = "20"
    return slices


def ct_enhanced():
    image = new_image(ENHANCED_CT, "CT", 3, "CT enhanced", 1)
    order = [int(n) for n in np.random.default_rng(1).permutation(24)]
    positions = [(-63.75, -48.75, 4.0 * n - 46.0) for n in order]
    spacing, shape = (2.5, 2.5), (40, 52)
    image.ImageType = ["DERIVED", "PRIMARY", "VOLUME", "NONE"]
    image.PixelPresentation, image.VolumetricProperties = "MONOCHROME", "VOLUME"
    image.VolumeBasedCalculationTechnique = "NONE"
    image.AcquisitionDateTime, image.AcquisitionDuration = "20240131100300", 1.0
    image.ContentQualification, image.BurnedInAnnotation, image.LossyImageCompression = "RESEARCH", "NO", "00"
    image.PresentationLUTShape = "IDENTITY"
    image.AcquisitionContextSequence = []
    image.MultienergyCTAcquisition = "NO"
    organization = uid("dimensions")
    image.DimensionOrganizationSequence = group(DimensionOrganizationUID=organization)
    image.DimensionIndexSequence = group(
        DimensionIndexPointer=0x00200032, FunctionalGroupPointer=0x00209113, DimensionOrganizationUID=organization
    )
    shared = Dataset()
    shared.PixelMeasuresSequence = group(PixelSpacing=list(spacing), SliceThickness="4")
    shared.PlaneOrientationSequence = group(ImageOrientationPatient=[x for axis in AXIAL for x in axis])
    shared.PixelValueTransformationSequence = group(RescaleIntercept="-1024", RescaleSlope="1", RescaleType="HU")
    shared.FrameVOILUTSequence = group(WindowCenter="300", WindowWidth="1500")
    shared.FrameAnatomySequence = group(FrameLaterality="U", AnatomicRegionSequence=code("51185008", "Chest"))
    shared.IrradiationEventIdentificationSequence = group(IrradiationEventUID=uid("irradiation"))
    shared.CTImageFrameTypeSequence = group(
        FrameType=image.ImageType,
        PixelPresentation=image.PixelPresentation,
        VolumetricProperties=image.VolumetricProperties,
        VolumeBasedCalculationTechnique=image.VolumeBasedCalculationTechnique,
    )
    frames = []
    for n, position in zip(order, positions):
        frame = Dataset()
        frame.FrameContentSequence = group(DimensionIndexValues=n + 1, StackID="1", InStackPositionNumber=n + 1)
        frame.PlanePositionSequence = group(ImagePositionPatient=list(position))
        frames.append(frame)
    image.SharedFunctionalGroupsSequence, image.PerFrameFunctionalGroupsSequence = [shared], frames
    image.NumberOfFrames = len(frames)
    set_pixels(image, [hounsfield(position, AXIAL, spacing, shape) for position in positions])
    del image.BodyPartExamined, image.AcquisitionDate, image.AcquisitionTime
    return [image]


def ct_incomplete():
    return [ct_slice(4, "CT incomplete", n + 1, (-63.75, -48.75, 4.0 * n - 46.0)) for n in range(24) if n != 10]


def mr():
    images = []
    for n in range(26):
        position, spacing, shape = (5.0 * n - 62.5, -49.0, 48.0), (2.0, 2.0), (49, 50)
        image = new_image(MR, "MR", 5, "MR T1", n + 1)
        image.ImageType = ["ORIGINAL", "PRIMARY", "OTHER"]
        image.ScanningSequence, image.SequenceVariant, image.ScanOptions = "SE", "NONE", ""
        image.MRAcquisitionType, image.EchoTime, image.RepetitionTime = "2D", "12", "500"
        image.EchoTrainLength, image.SpacingBetweenSlices = 1, "5"
        set_plane(image, position, SAGITTAL, spacing, "4.5")
        in_body, spots = sample(position, SAGITTAL, spacing, shape)
        set_pixels(image, np.round(np.where(in_body, 100.0 + 800.0 * spots, 0.0)).astype(np.uint16))
        image.WindowCenter, image.WindowWidth = "450", "900"
        images.append(image)
    return images


def pet_slice(number, description, instance, count, position, spacing, thickness, activity):
    """One of count slices, with a rescale slope of its own."""
    image = new_image(PET, "PT", number, description, instance)
    image.ImageType = ["ORIGINAL", "PRIMARY"]
    image.Units, image.CountsSource, image.SeriesType = "BQML", "EMISSION", ["STATIC", "IMAGE"]
    image.NumberOfSlices, image.ImageIndex, image.CollimatorType = count, instance, "NONE"
    image.CorrectedImage, image.DecayCorrection = ["ATTN", "DECY"], "START"
    image.RandomsCorrectionMethod, image.ScatterCorrectionMethod = "NONE", "NONE"
    image.AttenuationCorrectionMethod, image.ReconstructionMethod = "Measured", "OSEM"
    image.FrameReferenceTime, image.ActualFrameDuration, image.DecayFactor = "0", "120000", "1"
    image.RadiopharmaceuticalInformationSequence = group(
        Radiopharmaceutical="FDG",
        RadiopharmaceuticalStartTime="090000",
        RadionuclideTotalDose="350000000",
        RadionuclideHalfLife="6586.2",
        RadionuclidePositronFraction="0.967",
        RadionuclideCodeSequence=code("77004003", "^18^Fluorine"),
        RadiopharmaceuticalCodeSequence=code("35321007", "Fluorodeoxyglucose F^18^"),
    )
    del image.PatientPosition  # the next three say it
    image.PatientOrientationCodeSequence = code("102538003", "recumbent")
    image.PatientOrientationCodeSequence[0].PatientOrientationModifierCodeSequence = code("40199007", "supine")
    image.PatientGantryRelationshipCodeSequence = code("102540008", "headfirst")
    set_plane(image, position, AXIAL, spacing, thickness)
    slope = float(f"{np.abs(activity).max() / 32767.0:.9g}") or 1.0
    image.RescaleIntercept, image.RescaleSlope = "0", slope
    set_pixels(image, np.round(activity / slope).astype(np.int16))
    return image


def pet():
    images = []
    for n in range(32):
        position, spacing, shape = (-62.0, -46.5, 3.0 * n - 46.5), (3.0, 4.0), (32, 32)
        in_body, spots = sample(position, AXIAL, spacing, shape)
        activity = np.where(in_body, 500.0 + 20000.0 * spots, 0.0)
        image = pet_slice(6, "PET attenuation", n + 1, 32, position, spacing, "3", activity)
        image.WindowCenter, image.WindowWidth = "10000", "20000"
        images.append(image)
    return images


SERIES = {
    "CT thorax": ct_thorax,
    "CT tilted": ct_tilted,
    "CT enhanced": ct_enhanced,
    "CT incomplete": ct_incomplete,
    "MR T1": mr,
    "PET attenuation": pet,
}


def make_study(folder, descriptions=tuple(SERIES)):
    """Writes the series of these descriptions into a new folder."""
    files = FileSet()
    files.ID = "SYNTHETIC"
    for description in descriptions:
        for image in SERIES[description]():
            files.add(image)
    files.write(folder)
    Path(folder, "README.TXT").write_text("A synthetic study; nobody's images.\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="a new folder")
    make_study(parser.parse_args().folder)


if __name__ == "__main__":
    main()

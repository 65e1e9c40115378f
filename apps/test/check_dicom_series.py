#!/usr/bin/env python3
"""Checks folders of DICOM series of projections by pydicom and dciodvfy (of Debian's dicom3tools).

Fails if dciodvfy finds an error; its warnings are listed. With --sample also has series written, for sources of
pydicom's test data, and compares their values, geometry, patients and studies with what they should be.
"""

import argparse
import math
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy
import pydicom
from make_study import CT, MR, PET, group
from pydicom.data import get_charset_files, get_testdata_file
from pydicom.pixel_data_handlers.util import apply_modality_lut

SECONDARY_CAPTURE = "1.2.840.10008.5.1.4.1.1.7"
PATIENT_AND_STUDY = """PatientName PatientID PatientBirthDate PatientSex StudyInstanceUID StudyDate StudyTime StudyID
    AccessionNumber ReferringPhysicianName StudyDescription SpecificCharacterSet""".split()


def require(condition, message):
    if not condition:
        sys.exit(f"FAILED: {message}")


def validate(files):
    """Runs dciodvfy, and returns its warnings with how many files have them."""
    warnings = Counter()
    for file in files:
        result = subprocess.run(["dciodvfy", str(file)], capture_output=True, check=False)
        lines = (result.stdout + result.stderr).decode("ascii", "replace").splitlines()
        errors = [line for line in lines if "Error" in line]
        require(not errors and result.returncode == 0, f"{file}: dciodvfy: {errors or result.returncode}")
        warnings.update(line for line in lines if line.startswith("Warning"))
    return warnings


def check_folder(folder, name=None):
    """Returns the series, in the order of the names."""
    files = sorted(Path(folder).iterdir())
    require(files, f"{folder}: no files")
    series = [pydicom.dcmread(file) for file in files]
    for dataset in series:
        # every element is decoded
        dataset.walk(lambda _, element: element.value)
    for keyword in ["SeriesInstanceUID", "StudyInstanceUID", "FrameOfReferenceUID", "SOPClassUID", "SeriesNumber"]:
        require(len({dataset[keyword].value for dataset in series}) == 1, f"{folder}: {keyword} differs")
    require(len({dataset.SOPInstanceUID for dataset in series}) == len(series), f"{folder}: UIDs are not unique")
    for number, dataset in enumerate(series, 1):
        require(dataset.InstanceNumber == number, f"{folder}: names do not sort as InstanceNumber")
        image_type = list(dataset.ImageType)
        made = "PRIMARY" if dataset.SOPClassUID == PET else "SECONDARY"
        require(image_type[:3] == ["DERIVED", made, "PROJECTION IMAGE"], f"{folder}: ImageType {image_type}")
        require(image_type[3] in ("MAX_IP", "MIN_IP", "MEAN"), f"{folder}: ImageType {image_type}")
        axes = numpy.array(dataset.ImageOrientationPatient, float).reshape(2, 3)
        require(numpy.allclose(axes @ axes.T, numpy.eye(2), atol=1e-9), f"{folder}: axes are not orthonormal")
        require(len(dataset.ImagePositionPatient) == 3 and min(dataset.PixelSpacing) > 0.0, f"{folder}: no geometry")
        require(dataset.BurnedInAnnotation == "NO", f"{folder}: BurnedInAnnotation")
        require(dataset.pixel_array.shape == (dataset.Rows, dataset.Columns), f"{folder}: pixels")
    print(f"{name or folder}: {len(series)} files of {series[0].SOPClassUID.name}")
    for warning, count in validate(files).items():
        print(f"  {count} x {warning}")
    return series


def check_sample(sample, kind, source, sop_class):
    """Has a ball written that turns, and checks it against what that should be."""
    size = 48
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder) / "series"
        subprocess.run([sample, kind, str(directory)] + ([str(source)] if source else []), check=True)
        series = check_folder(directory, f"{kind} values, source {Path(source).name if source else 'none'}")
    require(series[0].SOPClassUID == sop_class, f"{kind} {source}: {series[0].SOPClassUID.name}")
    lowest = -1024.0 if kind == "signed" else 0.0
    scale = 0.001 if kind == "float" else 1.0
    u, v = numpy.meshgrid(numpy.arange(size) - (size - 1) / 2, numpy.arange(size + 1) - (size - 1) / 2)
    for frame, dataset in enumerate(series):
        angle = 2.0 * math.pi * frame / len(series)
        distance = numpy.hypot(u - 12.0 * math.cos(angle), v - 5.0)
        expected = lowest + scale * numpy.floor(numpy.maximum(0.0, 100.0 * (12.0 - distance)))
        values = apply_modality_lut(dataset.pixel_array, dataset)
        # a number may be floored to either side
        tolerance = scale * 1.0001
        difference = numpy.abs(values - expected)
        require(difference.max() <= tolerance and (difference > 0.1 * scale).mean() < 0.01, f"{kind}: values")
        right = [math.cos(angle), math.sin(angle), 0.0]
        require(numpy.allclose(dataset.ImageOrientationPatient[:3], right), f"{kind}: row")
        require(numpy.allclose(numpy.abs(dataset.ImageOrientationPatient[3:]), [0.0, 0.0, 1.0]), f"{kind}: column")
        origin = numpy.array(dataset.ImageOrientationPatient, float).reshape(2, 3).sum(axis=0) * -(size - 1) / 2
        require(numpy.allclose(dataset.ImagePositionPatient, origin), f"{kind}: position")
    header = pydicom.dcmread(source, force=True) if source else pydicom.Dataset()
    inverted = header.get("PhotometricInterpretation") == "MONOCHROME1"
    photometric = "MONOCHROME1" if inverted else "MONOCHROME2"
    require(series[0].PhotometricInterpretation == photometric, f"{source}: PhotometricInterpretation")
    if source:
        for name in PATIENT_AND_STUDY:
            require(
                header.get(name) in (series[0].get(name), None) or not header.get(name),
                f"{source}: {name} is {series[0].get(name)} instead of {header.get(name)}",
            )
        if header.get("FrameOfReferenceUID"):
            require(header.FrameOfReferenceUID == series[0].FrameOfReferenceUID, f"{source}: FrameOfReferenceUID")
        methods = header.get("DeidentificationMethodCodeSequence")
        require(methods == series[0].get("DeidentificationMethodCodeSequence"), f"{source}: deidentification")
        require(header.SeriesInstanceUID != series[0].SeriesInstanceUID, f"{source}: SeriesInstanceUID")
        references = [item.ReferencedSOPInstanceUID for item in series[0].SourceImageSequence]
        require(references == [header.SOPInstanceUID], f"{source}: SourceImageSequence")


def write_deidentified(source, path, implicit):
    """As the cancer imaging archive does."""
    dataset = pydicom.dcmread(source)
    dataset.PatientIdentityRemoved = "YES"
    dataset.DeidentificationMethodCodeSequence = group(
        CodeValue="113100", CodingSchemeDesignator="DCM", CodeMeaning="Basic Application Confidentiality Profile"
    )
    dataset.BodyPartExamined = "CHEST"
    del dataset.Laterality
    if implicit:
        dataset.remove_private_tags()
        dataset.is_implicit_VR = True
        dataset.file_meta.TransferSyntaxUID = pydicom.uid.ImplicitVRLittleEndian
    dataset.save_as(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", help="folders of one series each")
    parser.add_argument("--sample", help="the program DicomSeriesSample")
    arguments = parser.parse_args()
    for folder in arguments.folders:
        check_folder(folder)
    if arguments.sample:
        ct = get_testdata_file("CT_small.dcm")
        mr = get_testdata_file("MR_small.dcm")
        check_sample(arguments.sample, "signed", ct, CT)
        check_sample(arguments.sample, "float", ct, CT)
        check_sample(arguments.sample, "unsigned", mr, MR)
        check_sample(arguments.sample, "float", mr, SECONDARY_CAPTURE)
        check_sample(arguments.sample, "unsigned", get_testdata_file("MR_small_implicit.dcm"), MR)
        check_sample(arguments.sample, "unsigned", get_testdata_file("MR_small_bigendian.dcm"), MR)
        for kind in ("signed", "unsigned", "float"):
            check_sample(arguments.sample, kind, None, SECONDARY_CAPTURE)
        with tempfile.TemporaryDirectory() as folder:
            for implicit in (False, True):
                source = Path(folder) / f"deidentified-{'implicit' if implicit else 'explicit'}.dcm"
                write_deidentified(ct, source, implicit)
                check_sample(arguments.sample, "signed", source, CT)
            for image, kind, sop_class in ((ct, "signed", CT), (mr, "unsigned", MR), (mr, "float", SECONDARY_CAPTURE)):
                dataset = pydicom.dcmread(image)
                dataset.PhotometricInterpretation = "MONOCHROME1"
                dataset.save_as(Path(folder) / "inverted.dcm")
                check_sample(arguments.sample, kind, Path(folder) / "inverted.dcm", sop_class)
        for pattern in ("chrFren.dcm", "chrGreek.dcm", "chrH31.dcm", "chrI2.dcm", "chrX1.dcm", "chrX2.dcm"):
            check_sample(arguments.sample, "unsigned", get_charset_files(pattern)[0], SECONDARY_CAPTURE)
    print("passed")


if __name__ == "__main__":
    main()

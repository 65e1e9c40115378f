"""PET series that the program SHEAR_WARP_MIP reads and writes, read by pydicom and dciodvfy (of Debian's dicom3tools)."""

import os
import shutil
import subprocess
from datetime import datetime, timedelta
from pathlib import Path

import make_study
import numpy as np
import pydicom
import pytest
from check_dicom_series import SECONDARY_CAPTURE, validate
from make_study import CT, PET

PROGRAM = os.environ["SHEAR_WARP_MIP"]
SIZE, SLICES = (20, 16), 12
SPACING = np.array([4.0, 4.0, 5.0])
ORIGIN = np.array([-30.0, -50.0, 100.0])
HOT = np.array([13, 4, 9])
NRRD_TYPES = {"u1": "uchar", "i2": "short", "u2": "ushort", "f4": "float"}
SCAN = datetime(2024, 1, 2, 10, 30)
COPIED = """PatientName PatientID PatientWeight StudyInstanceUID FrameOfReferenceUID SeriesDate SeriesTime Units CountsSource
    CorrectedImage DecayCorrection AttenuationCorrectionMethod CollimatorType RadiopharmaceuticalInformationSequence
    PatientOrientationCodeSequence PatientGantryRelationshipCodeSequence AcquisitionDate AcquisitionTime
    FrameReferenceTime DecayFactor ActualFrameDuration""".split()


def make_volume():
    """In Bq/ml, by slice, row, column: uptake everywhere, and one hot voxel."""
    volume = 900.0 + 37.25 * np.arange(SLICES)[:, None, None] + np.arange(SIZE[0]) % 3 * np.ones((SIZE[1], 1))
    volume[tuple(HOT[::-1])] = 64321.5
    return volume


def write_pet(folder, volume=None, change=lambda dataset, n: None, implicit=False):
    """A whole-body series of one slope for each slice, as some scanners write; later slices are acquired earlier."""
    folder.mkdir()
    for n, values in enumerate(make_volume() if volume is None else volume):
        position = [*ORIGIN[:2], ORIGIN[2] + n * SPACING[2]]
        dataset = make_study.pet_slice(3, "PET", n + 1, SLICES, position, SPACING[1::-1], SPACING[2], values)
        bed = 2 - n // 4
        acquired = SCAN + timedelta(minutes=3 * bed)
        dataset.SeriesDate, dataset.SeriesTime = f"{SCAN:%Y%m%d}", f"{SCAN:%H%M%S}"
        dataset.AcquisitionDate, dataset.AcquisitionTime = f"{acquired:%Y%m%d}", f"{acquired:%H%M%S}"
        dataset.SeriesType, dataset.CorrectedImage = ["WHOLE BODY", "IMAGE"], ["DECY", "ATTN", "SCAT"]
        dataset.FrameReferenceTime, dataset.ActualFrameDuration = 180000 * bed + 90000, 180000
        dataset.DecayFactor = "1.009"
        set_drug(RadionuclideTotalDose="370000000", RadiopharmaceuticalStartTime="093000.00")(dataset, n)
        change(dataset, n)
        dataset.is_implicit_VR = implicit
        dataset.save_as(folder / f"slice-{n:02}.dcm", write_like_original=False)
    return folder


def set_values(find, values):
    """A change by write_pet: of what find returns of a data set."""

    def change(dataset, n):
        for name, value in values.items():
            setattr(find(dataset), name, value)

    return change


def get_drug(dataset):
    return dataset.RadiopharmaceuticalInformationSequence[0]


def set_drug(**values):
    return set_values(get_drug, values)


def set_image(**values):
    return set_values(lambda dataset: dataset, values)


def run(*arguments, status=0):
    """What the program says."""
    result = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert result.returncode == status, result.stderr
    return result.stderr


def fail(*arguments):
    message = run(*arguments, status=1)
    assert message.count("\n") == 1, message
    return message


def write_nrrd(path, pixels, *fields):
    """With fields that follow the fields of the pixels."""
    header = ["NRRD0004", f"type: {NRRD_TYPES[pixels.dtype.str[1:]]}", f"dimension: {pixels.ndim}"]
    header += [f"sizes: {' '.join(map(str, pixels.shape[::-1]))}", "encoding: raw", "endian: little", *fields]
    path.write_bytes("\n".join([*header, "", ""]).encode() + pixels.tobytes())


def read_values(path):
    """Of an uncompressed .mha."""
    header, data = path.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
    fields = dict(line.split(" = ") for line in header.decode().splitlines())
    kind = {"MET_FLOAT": "<f4", "MET_DOUBLE": "<f8", "MET_SHORT": "<i2", "MET_USHORT": "<u2"}[fields["ElementType"]]
    return np.frombuffer(data, kind).reshape([int(n) for n in fields["DimSize"].split()][::-1])


def read_dicom(folder):
    files = sorted(Path(folder).iterdir())
    if shutil.which("dciodvfy"):
        validate(files)
    return [pydicom.dcmread(file) for file in files]


def test_source_is_valid(tmp_path):
    read_dicom(write_pet(tmp_path / "pet"))


@pytest.mark.parametrize("turn", [[], ["--angular-range", "-180"], ["--rotation-axis", "left", "--view", "superior"]])
@pytest.mark.parametrize("kind", ["positive", "negative", "implicit"])
def test_reprojection(tmp_path, kind, turn):
    volume = make_volume() - (2e6 if kind == "negative" else 0.0)
    pet = write_pet(tmp_path / "pet", volume, implicit=kind == "implicit")
    assert run(pet, tmp_path / "mip.mha", "--frames", 8, "--dicom-out", tmp_path / "turn", *turn) == ""
    values = read_values(tmp_path / "mip.mha")
    series = read_dicom(tmp_path / "turn")
    source = pydicom.dcmread(pet / f"slice-{SLICES - 1}.dcm")
    hot = ORIGIN + HOT * SPACING
    slope = float(series[0].RescaleSlope)
    assert len(series) == len(values) == 8
    assert slope == pytest.approx(np.abs(values).max() / (32768 if kind == "negative" else 65535), rel=1e-5)
    normals = []
    for n, (dataset, expected) in enumerate(zip(series, values)):
        assert dataset.SOPClassUID == PET and dataset.Modality == "PT"
        assert list(dataset.SeriesType) == ["WHOLE BODY", "REPROJECTION"]
        assert dataset.ReprojectionMethod == "MAX PIXEL"
        assert list(dataset.ImageType) == ["DERIVED", "PRIMARY", "PROJECTION IMAGE", "MAX_IP"]
        assert (dataset.NumberOfSlices, dataset.ImageIndex, dataset.InstanceNumber) == (8, n + 1, n + 1)
        assert (dataset.RescaleIntercept, dataset.RescaleSlope, dataset.BitsStored) == (0, series[0].RescaleSlope, 16)
        assert dataset.PixelSpacing == series[0].PixelSpacing
        for name in COPIED:
            assert dataset[name].value == source[name].value, name
        np.testing.assert_allclose(dataset.pixel_array * slope, expected, atol=0.5001 * slope, rtol=1e-7)
        right, down = np.array(dataset.ImageOrientationPatient, float).reshape(2, 3)
        row, column = np.unravel_index(np.argmax(dataset.pixel_array), dataset.pixel_array.shape)
        corner, spacing = np.array(dataset.ImagePositionPatient, float), np.array(dataset.PixelSpacing, float)
        pixel = corner + column * spacing[1] * right + row * spacing[0] * down
        normals.append(np.cross(right, down))
        # the hot voxel is where its pixel is seen
        assert np.linalg.norm(np.cross(hot - pixel, normals[-1])) < 0.8 * max(spacing)
        # normals through the middles meet at the image's center
        middle = corner + 0.5 * ((dataset.Columns - 1) * spacing[1] * right + (dataset.Rows - 1) * spacing[0] * down)
        center = ORIGIN + 0.5 * (np.array([*SIZE, SLICES]) - 1) * SPACING
        assert np.linalg.norm(np.cross(center - middle, normals[-1])) < 1e-6
        if not turn:
            assert set(dataset.PatientOrientation[0]) == set(("L", "LP", "P", "PR", "R", "RA", "A", "AL")[n])
            assert dataset.PatientOrientation[1] == "F"
    assert np.linalg.matrix_rank(normals, tol=1e-6) == 2


def test_patient_position(tmp_path):
    """A PET image has sequences instead, which may be empty (PS3.3 C.7.3.1 and C.8.4.6)."""

    def change(dataset, n):
        dataset.PatientPosition = "HFS"
        del dataset.PatientOrientationCodeSequence, dataset.PatientGantryRelationshipCodeSequence

    run(
        write_pet(tmp_path / "pet", change=change),
        tmp_path / "mip.mha",
        "--frames",
        2,
        "--dicom-out",
        tmp_path / "turn",
    )
    for dataset in read_dicom(tmp_path / "turn"):
        assert dataset.SOPClassUID == PET and "PatientPosition" not in dataset
        assert not dataset.PatientOrientationCodeSequence and not dataset.PatientGantryRelationshipCodeSequence


@pytest.mark.parametrize("lowest", [-1000, 0])
@pytest.mark.parametrize("highest", [0, 32767])
def test_whole_numbers_are_exact(tmp_path, lowest, highest):
    volume = np.full((SLICES, *SIZE[::-1]), float(lowest))
    volume[:, 5:8, 3:9] = highest
    run(write_pet(tmp_path / "pet", volume), tmp_path / "mip.mha", "--frames", 4, "--dicom-out", tmp_path / "turn")
    values = read_values(tmp_path / "mip.mha")
    is_whole = values.dtype == np.int16
    assert is_whole == (highest > 0 or lowest == 0)
    for dataset, expected in zip(read_dicom(tmp_path / "turn"), values):
        slope = float(dataset.RescaleSlope)
        assert slope == 1.0 or not is_whole
        np.testing.assert_allclose(dataset.pixel_array * slope, expected, atol=0.0 if is_whole else 0.5001 * slope)


@pytest.mark.parametrize(
    "options, reason",
    [
        ([], "no turn"),
        (["--sliding-slab", "20,10"], "no turn"),
        (["--frames", 6, "--mode", "minimum"], "minima"),
        (["--frames", 6, "--mode", "absolute-maximum"], "--mode"),
        (["--frames", 6, "--rocking", "--angular-range", 60], "--rocking"),
        (["--frames", 6, "--attenuation", 0.01], "--attenuation"),
        (["--frames", 6, "--local-maximum", 1000], "--local-maximum"),
        (["--frames", 6, "--slab", "10,20"], "slab"),
        (["--frames", 6, "--elevation", 20], "right angles"),
        (["--frames", 3, "--angular-range", 90, "--centre", "20,30,100"], "middles"),
        (["--frames", 6, "--angular-range", 720], "one way, once at most"),
        (["--frames", 6, "--angular-range", 0], "one way, once at most"),
    ],
)
def test_no_reprojection(tmp_path, options, reason):
    said = run(write_pet(tmp_path / "pet"), tmp_path / "mip.mha", "--dicom-out", tmp_path / "turn", *options)
    assert reason in said and said.count("\n") == 1, said
    for dataset in read_dicom(tmp_path / "turn"):
        assert dataset.SOPClassUID == SECONDARY_CAPTURE and "SeriesType" not in dataset


@pytest.mark.parametrize("name", ["Units", "CountsSource", "DecayCorrection", "FrameReferenceTime", "DecayFactor"])
def test_incomplete_source(tmp_path, name):
    pet = write_pet(tmp_path / "pet", change=lambda dataset, n: delattr(dataset, name))
    said = run(pet, tmp_path / "mip.mha", "--frames", 4, "--dicom-out", tmp_path / "turn")
    tag = pydicom.tag.Tag(name)
    assert f"({tag.group:04x},{tag.elem:04x})" in said
    assert {dataset.SOPClassUID for dataset in read_dicom(tmp_path / "turn")} == {SECONDARY_CAPTURE}


# ---- SUV


def join(*changes):
    return lambda dataset, n: [change(dataset, n) for change in changes]


def remove(name, in_drug=False):
    return lambda dataset, n: delattr(get_drug(dataset) if in_drug else dataset, name)


def set_ge_scan_time(dataset, n):
    dataset.private_block(0x0009, "GEMS_PETD_01", create=True).add_new(0x0D, "DT", "20240102102800.00")


def find_factor(tmp_path, change):
    """What SUV has been multiplied by, the same in all pixels."""
    pet = write_pet(tmp_path / "pet", change=change)
    assert run(pet, tmp_path / "plain.mha") == ""
    said = run(pet, tmp_path / "suv.mha", "--suv")
    plain, suv = (read_values(tmp_path / f"{name}.mha") for name in ("plain", "suv"))
    assert suv.dtype == np.float32
    ratios = suv.astype(float) / plain
    factor = np.median(ratios)
    np.testing.assert_allclose(ratios, factor, rtol=3e-7)
    is_suv_already = factor == pytest.approx(1.0, rel=3e-7)
    assert ("are unusual; are weight, dose" in said) == (factor > 0.05 and not is_suv_already)
    return factor


HALF_LIFE, DOSE, GRAMS = 6586.2, 370e6, 70e3
MARCH = set_image(SeriesDate="20240301", AcquisitionDate="20240301")
ONE_HOUR_EAST = set_image(TimezoneOffsetFromUTC="+0100")
PROCESSED = set_image(SeriesTime="120000")


@pytest.mark.parametrize(
    "change, seconds",
    [
        (lambda dataset, n: None, 3600),
        (set_drug(RadiopharmaceuticalStartTime="1029"), 60),
        (set_drug(RadiopharmaceuticalStartTime="103000"), 0),
        # over midnight
        (set_drug(RadiopharmaceuticalStartTime="233000"), 11 * 3600),
        (set_drug(RadiopharmaceuticalStartDateTime="20240102101500.5"), 899.5),
        (set_drug(RadiopharmaceuticalStartDateTime="20231231103000"), 2 * 86400),
        (join(ONE_HOUR_EAST, set_drug(RadiopharmaceuticalStartDateTime="20240102083000+0000")), 3600),
        (set_drug(RadiopharmaceuticalStartDateTime="20240102093000+0900"), 3600),
        (join(MARCH, set_drug(RadiopharmaceuticalStartDateTime="20240229103000")), 86400),
        (set_image(DecayCorrection="ADMIN"), None),
        # five minutes after the scan: a day before
        (set_drug(RadiopharmaceuticalStartTime="1035"), 86400 - 300),
        (join(PROCESSED, set_ge_scan_time), 3480),
    ],
)
def test_suv(tmp_path, change, seconds):
    decayed = DOSE * (1.0 if seconds is None else 0.5 ** (seconds / HALF_LIFE))
    assert find_factor(tmp_path, change) == pytest.approx(GRAMS / decayed, rel=1e-6)


@pytest.mark.parametrize("change", [set_image(PatientWeight="70000"), set_drug(RadionuclideTotalDose="370")])
def test_unusual_suv(tmp_path, change):
    pet = write_pet(tmp_path / "pet", change=join(set_image(DecayCorrection="ADMIN"), change))
    assert "are unusual; are weight, dose, half-life and times right?" in run(pet, tmp_path / "mip.mha", "--suv")


def test_window_of_suv(tmp_path):
    pet = write_pet(tmp_path / "pet")
    assert "--window pet is in SUV" in run(pet, tmp_path / "mip.png", "--window", "Pet")
    assert "SUV" not in run(pet, tmp_path / "mip.png", "--window", "pet", "--suv")


def test_suv_of_a_processed_series(tmp_path):
    """The activity has its mean at Frame Reference Time, so the scan began that much earlier."""
    times = np.linspace(0.0, 180.0, 200001)
    activity = 0.5 ** (times / HALF_LIFE)
    mean = np.trapezoid(activity, times) / 180.0 if hasattr(np, "trapezoid") else np.trapz(activity, times) / 180.0
    begin = 3600.0 - 90.0 - HALF_LIFE * np.log2(mean)
    assert find_factor(tmp_path, PROCESSED) == pytest.approx(GRAMS / (DOSE * 0.5 ** (begin / HALF_LIFE)), rel=1e-6)


def test_suv_of_suv(tmp_path):
    assert find_factor(tmp_path, set_image(Units="GML")) == pytest.approx(1.0, rel=3e-7)


@pytest.mark.parametrize(
    "change, mention",
    [
        (remove("PatientWeight"), "Patient's Weight (0010,1030) is missing"),
        (set_image(PatientWeight="0"), "Patient's Weight (0010,1030) is '0'"),
        (remove("RadionuclideTotalDose", True), "Radionuclide Total Dose (0018,1074) is missing"),
        (set_drug(RadionuclideTotalDose="-1"), "(0018,1074) is '-1'"),
        (remove("RadionuclideHalfLife", True), "Radionuclide Half Life (0018,1075)"),
        (remove("RadiopharmaceuticalStartTime", True), "Radiopharmaceutical Start Time (0018,1072)"),
        (set_drug(RadiopharmaceuticalStartTime="250000"), "(0018,1072)"),
        (set_drug(RadiopharmaceuticalStartDateTime="20240102113000"), "(0018,1078) is of no use"),
        (remove("RadiopharmaceuticalInformationSequence"), "(0054,0016) is missing"),
        (remove("SeriesTime"), "Series Time (0008,0031)"),
        (remove("AcquisitionDate"), "Acquisition Date (0008,0022)"),
        (remove("DecayCorrection"), "Decay Correction (0054,1102) is missing"),
        (set_image(DecayCorrection="NONE"), "Decay Correction (0054,1102) is NONE"),
        (set_image(CorrectedImage=["DECY"]), "Corrected Image (0028,0051)"),
        (set_image(Units="CNTS"), "Units (0054,1001) is CNTS"),
        (join(set_image(Units="GML"), set_image(SUVType="LBM")), "(0054,1006) is LBM"),
        (join(PROCESSED, remove("FrameReferenceTime")), "Frame Reference Time (0054,1300)"),
        (set_image(SOPClassUID=SECONDARY_CAPTURE), "PET Image Storage"),
    ],
)
def test_no_suv(tmp_path, change, mention):
    pet = write_pet(tmp_path / "pet", change=change)
    assert mention in fail(pet, tmp_path / "mip.mha", "--suv")
    assert not (tmp_path / "mip.mha").exists()


def test_suv_needs_dicom(tmp_path):
    run("--write-phantom", tmp_path / "head.nrrd")
    assert "PET Image Storage" in fail(tmp_path / "head.nrrd", tmp_path / "mip.mha", "--suv")


def test_suv_of_an_overlay(tmp_path):
    pet = write_pet(tmp_path / "pet")
    grid = ["space: left-posterior-superior", "space directions: ({},0,0) (0,{},0) (0,0,{})".format(*SPACING)]
    ct = tmp_path / "ct.nrrd"
    write_nrrd(ct, make_volume().astype("<f4"), *grid, "space origin: ({},{},{})".format(*ORIGIN))
    factor = GRAMS / (DOSE * 0.5 ** (3600 / HALF_LIFE))
    for name, options in {
        "plain": ["--overlay-window", 0, 20000],
        "suv": ["--overlay-window", 0, 20000 * factor, "--suv"],
        "none": ["--overlay-window", 20, 30, "--suv"],
    }.items():
        said = run(ct, tmp_path / f"{name}.png", "--overlay", pet, *options)
        assert ("nothing of" in said) == (name == "none")
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "suv.png").read_bytes()
    # in colours for the archive, of a series and of a file
    for source, overlay in ((pet, ct), (ct, pet)):
        folder = tmp_path / f"fused-{source.name}"
        run(source, f"{folder}/", "--overlay", overlay, "--frames", 2)
        for dataset, sides in zip(read_dicom(folder), (["L", "F"], ["R", "F"])):
            assert dataset.SOPClassUID == SECONDARY_CAPTURE and dataset.PhotometricInterpretation == "RGB"
            assert list(dataset.PatientOrientation) == sides
    assert "neither INPUT nor the overlay" in fail(ct, tmp_path / "mip.png", "--overlay", ct, "--suv")


def test_dicom_of_suv(tmp_path):
    pet = write_pet(tmp_path / "pet", change=set_image(WindowCenter="5000", WindowWidth="10000"))
    run(pet, tmp_path / "mip.mha", "--frames", 4, "--suv", "--dicom-out", tmp_path / "turn")
    for dataset, expected in zip(read_dicom(tmp_path / "turn"), read_values(tmp_path / "mip.mha")):
        assert (dataset.SOPClassUID, dataset.Units, dataset.SUVType) == (PET, "GML", "BW")
        slope = float(dataset.RescaleSlope)
        np.testing.assert_allclose(dataset.pixel_array * slope, expected, atol=0.5001 * slope)
        assert float(dataset.WindowWidth) < 100.0
    # as it is, it is SUV
    said = run(pet, tmp_path / "still.mha", "--suv", "--dicom-out", tmp_path / "still")
    assert "Secondary Capture" in said
    (still,) = read_dicom(tmp_path / "still")
    assert still.DerivationDescription == "Maximum intensity projection of SUV by body weight"
    assert still.RescaleType == "US"


@pytest.mark.parametrize("options", [("--frames", 4), ("--in-place",), ("--write-volume",)])
@pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
def test_files_of_suv_say_so(tmp_path, options, suffix):
    pet, values = write_pet(tmp_path / "pet"), tmp_path / f"suv{suffix}"
    run(pet, *([*options, values] if "--write-volume" in options else [values, *options]), "--suv")
    run(values, f"{tmp_path}/turn/")
    derivations = {dataset.DerivationDescription for dataset in read_dicom(tmp_path / "turn")}
    assert derivations == {"Maximum intensity projection of SUV by body weight"}


def test_slice_of_the_name_of_a_picture_is_kept(tmp_path):
    pet = write_pet(tmp_path / "pet")
    picture = (pet / "slice-03.dcm").rename(pet / "slice.png")
    before = picture.read_bytes()
    assert "this call reads it" in fail(pet, picture, "--no-labels")
    assert picture.read_bytes() == before


def test_burned_in_annotation_stays(tmp_path):
    pet = write_pet(tmp_path / "pet", change=set_image(BurnedInAnnotation="YES"))
    run(pet, tmp_path / "mip.mha", "--frames", 2, "--dicom-out", tmp_path / "turn")
    assert {dataset.BurnedInAnnotation for dataset in read_dicom(tmp_path / "turn")} == {"YES"}


# ---- multi-frame


@pytest.mark.parametrize("kind, sop_class", [("u1", "2"), ("i2", "3"), ("u2", "3"), ("f4", "3")])
def test_multi_frame(tmp_path, kind, sop_class):
    volume = np.arange(5 * 6 * 7).reshape(5, 6, 7).astype(kind) * np.array(1 if kind == "u1" else 3).astype(kind)
    volume = volume - np.array(300).astype(kind) if kind == "i2" else volume / 7 if kind == "f4" else volume
    write_nrrd(tmp_path / "in.nrrd", volume.astype(f"<{kind}"))
    options = ["--frames", 4, "--rate", 8, "--dicom-out", tmp_path / "turn", "--multi-frame"]
    assert run(tmp_path / "in.nrrd", tmp_path / "mip.nrrd", *options) == ""
    data = (tmp_path / "mip.nrrd").read_bytes().split(b"\n\n", 1)
    assert b"encoding: raw" in data[0]
    (dataset,) = read_dicom(tmp_path / "turn")
    expected = np.frombuffer(data[1], f"<{kind}").reshape(4, dataset.Rows, dataset.Columns)
    slope, intercept = float(dataset.RescaleSlope), float(dataset.RescaleIntercept)
    values = dataset.pixel_array * slope + intercept
    np.testing.assert_allclose(values, expected, atol=0.5001 * slope if kind == "f4" else 0.0)
    assert dataset.SOPClassUID == f"{SECONDARY_CAPTURE}.{sop_class}"
    assert dataset.NumberOfFrames == 4 and dataset.FrameIncrementPointer == 0x00181063
    assert (dataset.FrameTime, dataset.CineRate, dataset.RecommendedDisplayFrameRate) == (125, 8, 8)
    # rows go to other sides as it turns
    assert not dataset.PatientOrientation and "ImageOrientationPatient" not in dataset


def test_multi_frame_of_slabs_and_ct(tmp_path):
    change = set_image(SOPClassUID=CT, Modality="CT", KVP="120", AcquisitionNumber="")
    ct = write_pet(tmp_path / "ct", make_volume() - 1000.0, change=change)
    run(ct, tmp_path / "slabs.mha", "--sliding-slab", "20,10", "--dicom-out", tmp_path / "slabs", "--multi-frame")
    (dataset,) = read_dicom(tmp_path / "slabs")
    assert list(dataset.PatientOrientation) == ["L", "F"]
    assert dataset.Modality == "CT" and dataset.RescaleType == "HU" and len(dataset.SourceImageSequence) == SLICES


def test_multi_frame_refusals(tmp_path):
    pet = write_pet(tmp_path / "pet", change=set_image(PhotometricInterpretation="MONOCHROME1"))
    options = ["--dicom-out", tmp_path / "turn", "--multi-frame"]
    assert "MONOCHROME1" in fail(pet, tmp_path / "mip.mha", "--frames", 4, *options)
    assert "--dicom-out" in fail(pet, tmp_path / "mip.mha", "--frames", 4, "--multi-frame")
    assert not (tmp_path / "turn").exists() and not (tmp_path / "mip.mha").exists()

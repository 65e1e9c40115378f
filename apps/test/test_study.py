"""A study as it comes, read by the program SHEAR_WARP_MIP; STUDY_EXAMPLE is the script radiology_day.py."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import make_study
import numpy as np
import pydicom
import pytest
from PIL import Image
from pydicom.dataset import Dataset
from test_pet import PROGRAM, fail, run, write_nrrd

EXAMPLE = os.environ["STUDY_EXAMPLE"]
CLINIC = Path(__file__).parents[2] / "doc" / "clinic.md"
WHOLE = [name for name in make_study.SERIES if name != "CT incomplete"]
PEAKS = {"CT": 1040.0, "MR": 900.0, "PT": 20500.0}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("disc") / "study"
    make_study.make_study(folder)
    return folder


def project(study, folder, series):
    """Four frames of a turn, in their order."""
    run(study, f"{folder}/", "--frames", 4, "--series", series)
    return [pydicom.dcmread(file) for file in sorted(folder.iterdir())]


def values(image):
    """With the slope and intercept that all images but MR have."""
    return image.pixel_array * float(image.get("RescaleSlope", 1)) + float(image.get("RescaleIntercept", 0))


def write_series(folder, images):
    folder.mkdir()
    for number, image in enumerate(images):
        image.save_as(folder / str(number), write_like_original=False)


@pytest.mark.skipif(not shutil.which("dciodvfy"), reason="needs dciodvfy of dicom3tools")
def test_study_is_valid(study):
    for file in study.rglob("*"):
        if file.is_file() and file.name != "README.TXT":
            outcome = subprocess.run(["dciodvfy", file], capture_output=True, text=True, errors="replace", check=False)
            assert not [line for line in outcome.stderr.splitlines() if line.startswith(("Error", "Warning"))], file


def test_series_are_listed(study, tmp_path):
    images = {name: len(make()) for name, make in make_study.SERIES.items()} | {"CT enhanced": 24}
    modalities = {"CT": "CT", "MR": "MR", "PE": "PT"}
    lines = [
        f"{number}: {name}, {modalities[name[:2]]}, 2024-01-31, {images[name]} images"
        for number, name in enumerate(images, 1)
    ]
    for path in (study, study / "DICOMDIR"):
        message = fail(path, tmp_path / "mip.png")
        assert message.endswith("choose one by --series NUMBER: " + "; ".join(lines) + "\n")


def test_clinic_is_right(study, tmp_path, monkeypatch):
    page = CLINIC.read_text(encoding="utf-8")
    (tmp_path / "study").symlink_to(study)
    monkeypatch.chdir(tmp_path)
    message = fail("study", "mip.png")
    assert message.strip() in " ".join(page.split())


@pytest.mark.parametrize("name", WHOLE)
def test_spot_is_where_it_is(study, tmp_path, name):
    frames = project(study, tmp_path / "turn", name.upper())
    assert len(frames) == 4
    for frame in frames:
        pixels = values(frame)
        assert pixels.max() == pytest.approx(PEAKS[frame.Modality], rel=0.12)
        weights = np.clip(pixels - 0.7 * pixels.max(), 0.0, None)
        found = [(weights * axis).sum() / weights.sum() for axis in np.indices(pixels.shape)]
        down_to_up = np.array(frame.ImageOrientationPatient, float).reshape(2, 3)[::-1]
        offset = np.array(make_study.SPOT) - np.array(frame.ImagePositionPatient, float)
        spacing = np.array(frame.PixelSpacing, float)
        np.testing.assert_allclose(found * spacing, down_to_up @ offset, atol=0.6)  # mm; voxels are up to 5 mm


def test_order_of_frames_is_no_matter(study, tmp_path):
    slices, frames = (project(study, tmp_path / name, name) for name in ("CT thorax", "CT enhanced"))
    for one, other in zip(slices, frames):
        np.testing.assert_array_equal(values(one), values(other))
        assert one.ImagePositionPatient == other.ImagePositionPatient


def test_missing_slice_is_named(study, tmp_path):
    message = fail(study, tmp_path / "mip.png", "--series", "incomplete")
    assert "a slice is missing between '" in message
    assert "at -10 mm and '" in message and "at -2 mm; others are 4 mm apart" in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["EchoTime", "FrameReferenceTime", "TemporalPositionIdentifier"])
def test_several_volumes_in_a_series_are_listed(tmp_path, name):
    images = make_study.mr() + make_study.mr()
    for number, image in enumerate(images):
        setattr(image, name, "10" if number < len(images) / 2 else "20")
        image.SOPInstanceUID = image.file_meta.MediaStorageSOPInstanceUID = f"1.2.{number}"
    write_series(tmp_path / "images", images)
    message = fail(tmp_path / "images", tmp_path / "mip.png")
    words = "".join(f" {c}" if c.isupper() else c for c in name)
    assert f" has 2 volumes, which differ in{words} (" in message
    assert "choose one by --volume NUMBER: 1: 10; 2: 20" in message


def test_several_volumes_in_a_file_are_refused(tmp_path):
    (image,) = make_study.ct_enhanced()
    image.PerFrameFunctionalGroupsSequence = [*image.PerFrameFunctionalGroupsSequence] * 2
    image.NumberOfFrames, image.PixelData = 48, image.PixelData * 2
    write_series(tmp_path / "image", [image])
    message = fail(tmp_path / "image" / "0", tmp_path / "mip.png")
    assert "two slices lie at one position: frame 1 of '" in message and "no attribute tells them apart" in message


@pytest.mark.parametrize("space, peak", [("RGB", (160, 80, 53)), ("YBR_FULL", (59, 228, 80))])
def test_colours_are_kept(tmp_path, space, peak):
    images = make_study.ct_thorax()[:24]
    for image in images:
        grey = (np.frombuffer(image.PixelData, np.uint16) // 12).astype(np.uint8)
        image.PixelData = np.stack([grey, grey // 2, grey // 3], -1).tobytes()
        image["PixelData"].VR = "OB"
        image.SamplesPerPixel, image.PhotometricInterpretation, image.PlanarConfiguration = 3, space, 0
        image.BitsAllocated, image.BitsStored, image.HighBit = 8, 8, 7
        del image.RescaleSlope, image.RescaleIntercept
    write_series(tmp_path / "images", images)
    run(tmp_path / "images", tmp_path / "mip.mha")
    header, pixels = (tmp_path / "mip.mha").read_bytes().split(b"ElementDataFile = LOCAL\n")
    assert b"ElementNumberOfChannels = 3" in header
    np.testing.assert_allclose(np.frombuffer(pixels, np.uint8).reshape(-1, 3).max(axis=0), peak, atol=8)


@pytest.mark.skipif(not shutil.which("gdcmconv"), reason="needs gdcmconv of libgdcm-tools")
@pytest.mark.parametrize("codec", ["--jpeg", "--jpegls", "--j2k", "--rle"])
def test_compression_is_undone(study, tmp_path, codec):
    (tmp_path / "compressed").mkdir()
    for file in pydicom.fileset.FileSet(study / "DICOMDIR").find(SeriesNumber=2):
        subprocess.run(["gdcmconv", codec, file.path, tmp_path / "compressed" / Path(file.path).name], check=True)
    plain = project(study, tmp_path / "plain", "CT tilted")
    for one, other in zip(plain, project(tmp_path / "compressed", tmp_path / "turn", "1")):
        assert one.PixelData == other.PixelData


GRID = (40, 52, 24)  # rows, columns and slices of the CT
RED = [0x8AFC, 0xD1A1, 0xC6A8]  # sRGB (255, 0, 0) as CIELab
BLUE = [0x4BB1, 0xC511, 0x1006]


def make_segmentation(folder, parts, *, fractional=False):
    """A file with the parts, voxels of the CT each, in frames of no order; frames without a pixel are left out."""
    image = make_study.new_image("1.2.840.10008.5.1.4.1.1.66.4", "SEG", 9, "Segments", 1)
    image.SegmentationType = "FRACTIONAL" if fractional else "BINARY"
    frames, groups = [], []
    for number, part in parts.items():
        for n in range(GRID[2]):
            if part[..., n].any():
                (group,) = make_study.group(
                    PlanePositionSequence=make_study.group(ImagePositionPatient=[-63.75, -48.75, 4.0 * n - 46.0]),
                    SegmentIdentificationSequence=make_study.group(ReferencedSegmentNumber=number),
                )
                groups.append(group)
                frames.append(part[..., n])
    order = np.random.default_rng(2).permutation(len(frames))
    image.SharedFunctionalGroupsSequence = make_study.group(
        PixelMeasuresSequence=make_study.group(PixelSpacing=[2.5, 2.5], SliceThickness="4"),
        PlaneOrientationSequence=make_study.group(ImageOrientationPatient=[1, 0, 0, 0, 1, 0]),
    )
    image.PerFrameFunctionalGroupsSequence = [groups[n] for n in order]
    image.SegmentSequence = [Dataset() for _ in parts]
    for segment, number, label, colour in zip(image.SegmentSequence, parts, ("lesion", "whole body"), (RED, BLUE)):
        segment.SegmentNumber, segment.SegmentLabel, segment.RecommendedDisplayCIELabValue = number, label, colour
    pixels = np.stack([frames[n] for n in order])
    image.BitsAllocated = image.BitsStored = 8 if fractional else 1
    image.HighBit, image.PixelRepresentation = image.BitsStored - 1, 0
    image.NumberOfFrames, image.Rows, image.Columns = len(order), GRID[0], GRID[1]
    if fractional:
        image.MaximumFractionalValue = 200
        # 99 is less than a half
        image.PixelData = np.where(pixels, 100, 99).astype(np.uint8).tobytes()
    else:
        image.PixelData = np.packbits(pixels, bitorder="little").tobytes() + bytes(len(order) * 260 % 2)
    image["PixelData"].VR = "OB"
    folder.mkdir()
    image.save_as(folder / "segments.dcm", write_like_original=False)


@pytest.mark.parametrize("overlapping", [False, True])
@pytest.mark.parametrize("fractional", [False, True])
def test_segmentation_is_as_its_labels(study, tmp_path, fractional, overlapping):
    lesion, body = np.zeros(GRID, bool), np.zeros(GRID, bool)
    lesion[10:14, 30:36, 3:6] = lesion[20:24, 8:12, 15:18] = True
    body[5:35, 6:46, 4:20] = True
    if not overlapping:
        body &= ~lesion
    parts = {3: lesion, 7: body}
    make_segmentation(tmp_path / "seg", parts, fractional=fractional)
    # the same as labels
    fields = ["space: left-posterior-superior", "space directions: none (2.5,0,0) (0,2.5,0) (0,0,4)"]
    fields += ["kinds: vector domain domain domain", "space origin: (-63.75,-48.75,-46)"]
    for n, (name, colour) in enumerate((("lesion", "1 0 0"), ("whole body", "0 0 1"))):
        layer = [f"LabelValue:={3 + 4 * n}", f"Layer:={n}", f"Name:={name}", f"Color:={colour}"]
        fields += [f"Segment{n}_{entry}" for entry in layer]
    layers = np.stack([3 * lesion, 7 * body], -1).astype(np.uint8)
    write_nrrd(tmp_path / "labels.seg.nrrd", layers.transpose(2, 0, 1, 3), *fields)
    options = ["--series", 1, "--azimuth", 30, "--output-spacing", 1]
    pictures = []
    for segments in (tmp_path / "labels.seg.nrrd", tmp_path / "seg", tmp_path / "seg" / "segments.dcm"):
        assert ": lesion, whole body" in run(study, tmp_path / "mip.png", *options, "-v", "--segments", segments)
        pictures.append(np.asarray(Image.open(tmp_path / "mip.png")).astype(int))
    assert (pictures[0] == (255, 0, 0)).all(axis=-1).sum() > 50
    assert (pictures[0] == (0, 0, 255)).all(axis=-1).sum() > 50
    for picture in pictures[1:]:
        np.testing.assert_allclose(picture, pictures[0], atol=1)


def change_segmentation(folder, change):
    """One part, as the change leaves its file."""
    part = np.zeros(GRID, bool)
    part[10:14, 30:36, 3:9] = True
    make_segmentation(folder, {3: part})
    image = pydicom.dcmread(folder / "segments.dcm")
    change(image)
    image.save_as(folder / "segments.dcm")


@pytest.mark.parametrize(
    "change, reason",
    [
        (lambda group: group.PlanePositionSequence[0].ImagePositionPatient.__setitem__(2, "1.5"), "not on the grid"),
        (lambda group: group.PlanePositionSequence[0].ImagePositionPatient.__setitem__(0, "1.5"), "not on the grid"),
        (lambda group: group.PlanePositionSequence[0].ImagePositionPatient.__setitem__(2, "1e30"), "distance"),
        (lambda group: group.__delitem__("PlanePositionSequence"), "no valid position"),
        (lambda group: group.__delitem__("SegmentIdentificationSequence"), "no segment number"),
    ],
)
def test_segmentation_off_its_grid_is_refused(study, tmp_path, change, reason):
    change_segmentation(tmp_path / "seg", lambda image: change(image.PerFrameFunctionalGroupsSequence[2]))
    assert reason in fail(study, tmp_path / "mip.png", "--series", 2, "--segments", tmp_path / "seg")


def test_outline_is_half_a_voxel_away(tmp_path):
    labels = tmp_path / "labels.nrrd"
    voxels = np.pad(np.ones((1, 1, 1), np.uint8), 1)
    grid = ["space: left-posterior-superior", "space directions: (9,0,0) (0,9,0) (0,0,9)"]
    write_nrrd(labels, voxels, *grid, "space origin: (-9,-9,-9)")
    run(labels, tmp_path / "mip.png", "--segments", labels, "--output-spacing", 1)
    picture = np.asarray(Image.open(tmp_path / "mip.png"))
    rows, columns = (picture == (230, 159, 0)).all(axis=-1).nonzero()
    assert np.ptp(rows) == 8 and np.ptp(columns) == 8


def test_frames_may_share_the_segment_number(study, tmp_path):
    def share(image):
        for group in image.PerFrameFunctionalGroupsSequence:
            number = group.SegmentIdentificationSequence
            del group.SegmentIdentificationSequence
        image.SharedFunctionalGroupsSequence[0].SegmentIdentificationSequence = number

    change_segmentation(tmp_path / "seg", share)
    said = run(study, tmp_path / "mip.png", "--series", 2, "--segments", tmp_path / "seg", "-v")
    assert ", 1 segment: lesion:" in said


def spend_day(*arguments):
    environment = {**os.environ, "SHEARWARPMIP_PROGRAM": PROGRAM}
    command = [sys.executable, EXAMPLE, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def test_day_in_radiology(study, tmp_path):
    outcome = spend_day(study, tmp_path / "turn", "--series", "pet", "--frames", 5)
    assert outcome.returncode == 0, outcome.stderr
    assert "made 5 pictures" in outcome.stdout
    if "skipped" in outcome.stdout:
        pytest.skip("needs Orthanc")
    assert outcome.stdout.endswith("5 pictures\nfetched: all pixels are equal\n")


def test_bad_call_of_the_day_is_told(study, tmp_path):
    outcome = spend_day(study, tmp_path / "turn")
    assert outcome.returncode == 1
    assert "choose one by --series NUMBER" in outcome.stderr and outcome.stderr.count("\n") == 1
    assert not (tmp_path / "turn").exists()

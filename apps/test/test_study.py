# Copyright NumFOCUS
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#         https://www.apache.org/licenses/LICENSE-2.0.txt
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""A study as it comes, read by the program: STUDY_PROGRAM is that, STUDY_EXAMPLE the script radiology_day.py."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import make_study
import numpy as np
import pydicom
import pytest

PROGRAM = os.environ["STUDY_PROGRAM"]
EXAMPLE = os.environ["STUDY_EXAMPLE"]
WHOLE = [name for name in make_study.SERIES if name != "CT incomplete"]
PEAKS = {"CT": 1040.0, "MR": 900.0, "PT": 20500.0}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("disc") / "study"
    make_study.make_study(folder)
    return folder


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)


def project(study, folder, series):
    """Four frames of a turn, in their order."""
    outcome = run(study, f"{folder}/", "--frames", 4, "--series", series)
    assert outcome.returncode == 0, outcome.stderr
    return [pydicom.dcmread(file) for file in sorted(folder.iterdir())]


def values(image):
    """With the slope and intercept that all of these have but MR."""
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
        outcome = run(path, tmp_path / "mip.png")
        assert outcome.returncode == 1
        assert outcome.stderr.endswith("choose one by --series NUMBER: " + "; ".join(lines) + "\n")


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
    outcome = run(study, tmp_path / "mip.png", "--series", "incomplete")
    assert outcome.returncode == 1
    assert "a slice is missing between '" in outcome.stderr
    assert "at -10 mm and '" in outcome.stderr and "at -2 mm; others are 4 mm apart" in outcome.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["EchoTime", "FrameReferenceTime", "TemporalPositionIdentifier"])
def test_several_volumes_in_a_series_are_refused(tmp_path, name):
    images = make_study.mr() + make_study.mr()
    for number, image in enumerate(images):
        setattr(image, name, "10" if number < len(images) / 2 else "20")
        image.SOPInstanceUID = image.file_meta.MediaStorageSOPInstanceUID = f"1.2.{number}"
    write_series(tmp_path / "images", images)
    outcome = run(tmp_path / "images", tmp_path / "mip.png")
    assert outcome.returncode == 1
    words = "".join(f" {c}" if c.isupper() else c for c in name)
    assert f"They differ in{words}, 10 and 20: put the images of one volume into a folder" in outcome.stderr


def test_several_volumes_in_a_file_are_refused(tmp_path):
    (image,) = make_study.ct_enhanced()
    image.PerFrameFunctionalGroupsSequence = [*image.PerFrameFunctionalGroupsSequence] * 2
    image.NumberOfFrames, image.PixelData = 48, image.PixelData * 2
    write_series(tmp_path / "image", [image])
    outcome = run(tmp_path / "image" / "0", tmp_path / "mip.png")
    assert outcome.returncode == 1
    assert ". The file has several volumes, such as points in time: one is needed" in outcome.stderr


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
    outcome = run(tmp_path / "images", tmp_path / "mip.mha")
    assert outcome.returncode == 0, outcome.stderr
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

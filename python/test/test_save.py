"""Files and pages of a turn, read back by other programs."""

import base64
import io
import json
import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import itk
import itk_shearwarpmip
import numpy as np
import pydicom
import pytest
from itk_shearwarpmip import Turn, _save
from numpy.testing import assert_array_equal
from PIL import Image, ImageSequence
from program import NO_LABELS, PROGRAM
from pydicom.data import get_testdata_file

FRAMES = 6


def make_turn(image, **parameters):
    cine = itk.ShearWarpMIPCineImageFilter.New(
        image, **{"NumberOfFrames": FRAMES, "DefaultPixelValue": min(0, int(np.min(image))), **parameters}
    )
    cine.Update()
    frames = cine.GetOutput()
    transforms = [cine.GetFrameTransform(frame) for frame in range(itk.size(frames)[2])]
    return Turn(frames, transforms)


@pytest.fixture
def turn(image):
    return make_turn(image)


def expected_grey(frames, low, high):
    """Halves up, by whole numbers."""
    clamped = np.clip(np.asarray(frames).astype(int), low, high)
    return (510 * (clamped - low) + high - low) // (2 * (high - low))


def read_series(page):
    return json.loads(re.search(r'id="series">(.*?)</script>', page, re.DOTALL)[1])


def decode_png(data):
    picture = Image.open(io.BytesIO(data))
    assert picture.mode in ("L", "I;16")
    return np.asarray(picture)


def decode_frames(series):
    """The pictures in a page."""
    return np.array([decode_png(base64.b64decode(text)) for text in series["frames"]])


def decode_animation(path, shape):
    """Its pictures, by ffmpeg."""
    command = ["ffmpeg", "-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    data = subprocess.run(command, check=True, capture_output=True).stdout
    return np.frombuffer(data, np.uint8).reshape(-1, *shape)


# ---- Windows and pictures


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 2, 51, 120])
def test_window_is_that_of_sorted_values(rng, dtype, count):
    values = np.sort(rng.permutation(np.arange(1, 121))[:count])
    shuffled = rng.permutation(np.concatenate([values, np.zeros(360 - count)])).astype(dtype)
    low = values[int(0.01 * (count - 1) + 0.5)]
    high = values[int(0.998 * (count - 1) + 0.5)]
    expected = (low, high) if low < high else (high - 1, high)
    assert _save.find_window(itk.image_from_array(shuffled.reshape(18, 20))) == expected


def test_window_leaves_out_background_and_what_is_not_finite():
    pixels = np.full((3, 4), -1000.0, np.float32)
    pixels[0] = [np.nan, np.inf, -np.inf, 5.0]
    pixels[1, :2] = [0.0, 7.0]
    image = itk.image_from_array(pixels)
    image["Background"] = -1000.0
    assert _save.find_window(image) == (0.0, 7.0)
    assert _save.find_window(itk.image_from_array(np.maximum(pixels[1:], -1000.0))) == (0.0, 7.0)
    image["Background"] = float("nan")
    assert _save.find_window(image) == (-1000.0, 7.0)


@pytest.mark.parametrize("background", [0, -1000])
def test_window_of_nothing_has_a_black_background(background):
    image = itk.image_from_array(np.full((5, 4), background, np.int16))
    assert _save.find_window(image) == (background, background + 1)


def test_grey_levels():
    values = np.arange(-5, 1030, dtype=np.int16)
    for low, high in ((0, 255), (0, 510), (-2, 1000), (7, 8)):
        grey = _save.make_grey(values, (low, high))
        assert_array_equal(grey, expected_grey(values, low, high))
    assert list(_save.make_grey(np.array([0, 99, 255], np.uint8), (-1, 400))) == [1, 64, 163]
    special = np.array([np.nan, -np.inf, np.inf, 0.5], np.float32)
    assert list(_save.make_grey(special, (0.0, 1.0))) == [0, 0, 255, 128]


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_holds_the_pixels(rng, dtype):
    pixels = rng.integers(0, np.iinfo(dtype).max, (7, 5), dtype, endpoint=True)
    for given in (pixels, pixels[::2, ::-1], np.asfortranarray(pixels)):
        assert_array_equal(decode_png(_save.encode_png(given)), given)


@pytest.mark.parametrize("pixels", [np.zeros((2, 2), np.int16), np.zeros((2, 2, 3), np.uint8), np.zeros(4, np.uint8)])
def test_png_of_other_pixels(pixels):
    with pytest.raises(TypeError, match="uint8 or uint16 in rows and columns, not"):
        _save.encode_png(pixels)


# ---- Pages


def test_page_is_the_program_s_with_the_frames(turn):
    page = _save.make_page(turn, window=(-500, 800), rate=12)
    series = read_series(page)
    frames = np.asarray(turn.frames)
    spacing, origin = list(turn.frames.GetSpacing())[:2], list(turn.frames.GetOrigin())[:2]
    assert (series["height"], series["width"]) == frames.shape[1:]
    assert (series["spacing"], series["origin"]) == (spacing, origin)
    assert (series["window"], series["rate"], series["bits"]) == ([-500, 800], 12, 8)
    assert series["angles"] == [60.0 * n for n in range(FRAMES)]
    assert (series["loop"], series["inverted"], series["background"]) == ("turn", False, 0)
    assert series["labels"] and len(series["letters"]) == FRAMES
    values = frames[frames != frames.min()]
    assert series["intercept"] + series["slope"] == pytest.approx(max(values.min(), -500 - 650))
    assert series["intercept"] + 255 * series["slope"] == pytest.approx(min(values.max(), 800 + 650))
    stored = decode_frames(series)
    assert_array_equal(stored == 0, frames == frames.min())
    shown = np.where(stored == 0, frames, series["intercept"] + series["slope"] * stored)
    assert np.abs(shown - np.clip(frames, -1150, 1450)).max() <= 0.5000001 * series["slope"]
    template = Path(_save.__file__).with_name("cine.html").read_text(encoding="utf-8")
    start, end = template.split("@SERIES@")
    assert page.startswith(start) and page.endswith(end)


def test_page_is_exact_where_values_are_few(rng):
    image = itk.image_from_array(rng.integers(0, 200, (9, 10, 11), np.uint8))
    turn = make_turn(image)
    series = read_series(_save.make_page(turn))
    assert series["slope"] == 1.0
    stored = decode_frames(series).astype(int)
    assert_array_equal(np.where(stored == 0, 0, stored + series["intercept"]), turn.frames)


@pytest.mark.parametrize("labels", [True, False])
def test_page_names_the_sides_of_the_patient(labels):
    turn = make_turn(itk.image_from_array(np.zeros((4, 4, 4), np.int16)))
    series = read_series(_save.make_page(turn, labels=labels))
    assert series["letters"] == ["R L H F", "AR PL H F", "AL PR H F", "L R H F", "PL AR H F", "PR AL H F"]
    assert series["labels"] is labels


def test_page_is_in_mm(image):
    turn = make_turn(image)
    turn.frames["Unit"] = "micrometer"
    series = read_series(_save.make_page(turn))
    assert series["spacing"] == pytest.approx([each / 1000 for each in list(turn.frames.GetSpacing())[:2]])
    assert series["origin"] == pytest.approx([each / 1000 for each in list(turn.frames.GetOrigin())[:2]])


def test_page_of_an_array_has_no_letters(tmp_path):
    turn = itk_shearwarpmip.turn(np.zeros((4, 4, 4), np.int16), frames=2)
    turn.save(tmp_path / "turn.html", labels=False)
    series = read_series((tmp_path / "turn.html").read_text(encoding="utf-8"))
    assert "letters" not in series and series["labels"] is False


def test_page_names_the_sides_of_an_oblique_view(image, oblique_view):
    turn = make_turn(image, Transforms=[oblique_view])
    # azimuth 35, elevation 20 degrees: less than 22.5
    assert read_series(_save.make_page(turn))["letters"] == ["RA LP H F"]


def test_page_of_nothing():
    image = itk.image_from_array(np.zeros((4, 4, 4), np.float32))
    series = read_series(_save.make_page(make_turn(image)))
    assert series["window"] == [0.0, 1.0]
    assert not decode_frames(series).any()


@pytest.mark.parametrize(
    "parameters, loop",
    [
        ({}, "turn"),
        ({"AngularRange": -360.0}, "turn"),
        ({"NumberOfFrames": 1}, "turn"),
        ({"AngularRange": 180.0}, "none"),
        ({"AngularRange": 60.0, "Rocking": True}, "swing"),
        ({"Transforms": [itk.IdentityTransform[itk.D, 3].New()] * 2}, "none"),
    ],
)
def test_page_goes_on_as_the_turn_does(image, parameters, loop):
    series = read_series(_save.make_page(make_turn(image, **parameters)))
    assert series["loop"] == loop
    assert ("angles" in series) == ("Transforms" not in parameters)


@pytest.mark.parametrize("frames, rate", [(1, 5), (21, 5), (22, 6), (50, 13), (72, 18), (200, 25)])
def test_rate_by_default_is_the_turn_in_four_seconds(rng, frames, rate):
    turn = make_turn(itk.image_from_array(rng.integers(0, 200, (3, 3, 3), np.uint8)), NumberOfFrames=frames)
    assert read_series(_save.make_page(turn))["rate"] == rate
    assert read_series(_save.make_page(turn, rate=np.float32(rate)))["rate"] == rate


def test_title_of_a_page(turn, tmp_path):
    assert read_series(_save.make_page(turn))["title"] == "Maximum intensity projection"
    turn.source_files = [tmp_path / "a<b>.nrrd"]
    page = _save.make_page(turn)
    assert read_series(page)["title"] == "a<b>.nrrd"
    assert "a<b>.nrrd" not in page
    turn.source_files = [tmp_path / "series" / name for name in "ab"]
    assert read_series(_save.make_page(turn))["title"] == "Maximum intensity projection"
    assert 'srcdoc="&lt;!DOCTYPE html&gt;' in _save.make_frame(turn)


# ---- Files


@pytest.mark.parametrize("suffix", [".nrrd", ".nii.gz", ".nii", ".mha"])
def test_values_with_their_grid(turn, tmp_path, suffix):
    path = tmp_path / f"turn{suffix}"
    _save.save_turn(turn, path)
    read = itk.imread(path)
    assert_array_equal(read, turn.frames)
    assert np.asarray(read).dtype == np.int16
    for name in ("GetSpacing", "GetOrigin", "GetDirection"):
        found, given = (np.asarray(getattr(each, name)()) for each in (read, turn.frames))
        np.testing.assert_allclose(found, given, atol=1e-6 if "nii" in suffix else 1e-12)
    assert os.listdir(tmp_path) == [path.name]


def test_pictures(turn, tmp_path):
    turn.window = (-100, 100)
    for given, window in (({"window": (-500, 800)}, (-500, 800)), ({}, turn.window)):
        _save.save_turn(turn, str(tmp_path / "turn.png"), **given)
        paths = sorted(tmp_path.iterdir())
        assert [path.name for path in paths] == [f"turn-00{n}.png" for n in range(FRAMES)]
        assert_array_equal([decode_png(path.read_bytes()) for path in paths], expected_grey(turn.frames, *window))


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="ffmpeg is not installed")
@pytest.mark.parametrize("suffix", [".gif", ".apng", ".mp4"])
def test_animations(turn, tmp_path, suffix):
    path = tmp_path / f"turn{suffix}"
    _save.save_turn(turn, path, rate=20)
    expected = expected_grey(turn.frames, *map(int, _save.find_window(turn.frames)))
    _, rows, columns = expected.shape
    shape = (rows + rows % 2, columns + columns % 2) if suffix == ".mp4" else (rows, columns)
    found = decode_animation(path, shape)[:, :rows, :columns].astype(int)
    assert len(found) == FRAMES
    if suffix == ".mp4":
        assert np.abs(found - expected).mean() < 6
    else:
        assert_array_equal(found, expected)
        with Image.open(path) as animation:
            assert animation.info["loop"] == 0
            assert {frame.info["duration"] for frame in ImageSequence.Iterator(animation)} == {50}
    assert os.listdir(tmp_path) == [path.name]


def test_page_file(turn, tmp_path):
    _save.save_turn(turn, tmp_path / "turn.html", window=(0, 500))
    assert (tmp_path / "turn.html").read_text(encoding="utf-8") == _save.make_page(turn, window=(0, 500))


def test_link_and_mode_stay(turn, tmp_path):
    (tmp_path / "other").mkdir()
    real = tmp_path / "other" / "real.nrrd"
    real.write_text("before")
    real.chmod(0o640)
    (tmp_path / "turn.nrrd").symlink_to(real)
    _save.save_turn(turn, tmp_path / "turn.nrrd")
    assert (tmp_path / "turn.nrrd").is_symlink()
    assert real.stat().st_mode & 0o777 == 0o640
    assert_array_equal(itk.imread(real), turn.frames)


def test_all_pictures_or_none(turn, tmp_path, monkeypatch):
    for n in range(3):
        (tmp_path / f"turn-00{n}.png").write_text(f"before {n}")
    replace = os.replace

    def fail_at_the_fifth(source, target):
        if str(target).endswith("turn-004.png"):
            raise OSError("no more")
        replace(source, target)

    monkeypatch.setattr(os, "replace", fail_at_the_fifth)
    with pytest.raises(OSError, match="no more"):
        _save.save_turn(turn, tmp_path / "turn.png")
    before = {f"turn-00{n}.png": f"before {n}" for n in range(3)}
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("suffix", [".png", ".html", ".nrrd", ".mha", ".nii.gz", ".mp4", ".gif", ""])
def test_full_disk(isolated, tmp_path, suffix):
    if suffix in (".mp4", ".gif") and not shutil.which("ffmpeg"):
        pytest.skip("ffmpeg is not installed")
    path = tmp_path / f"turn{suffix}"
    if suffix not in ("", ".png"):
        path.write_text("before")
    before = sorted(os.listdir(tmp_path))
    outcome = isolated(f"""
import resource, signal
from itk_shearwarpmip import Turn, _save
voxels = np.random.default_rng(1).integers(0, 60000, (40, 40, 40), np.uint16)
cine = itk.ShearWarpMIPCineImageFilter.New(itk.image_from_array(voxels), NumberOfFrames=4)
cine.Update()
frames = cine.GetOutput()
turn = Turn(frames, [cine.GetFrameTransform(n) for n in range(4)])
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1500, resource.RLIM_INFINITY))
try:
    _save.save_turn(turn, {str(path)!r})
except (OSError, RuntimeError) as error:
    print("said:", error)
""")
    assert outcome.code == 0, outcome
    assert "said:" in outcome.text, outcome
    assert sorted(os.listdir(tmp_path)) == before
    assert not before or path.read_text() == "before"


# ---- The program


@pytest.mark.skipif(not PROGRAM, reason="this wheel was built without the program")
@pytest.mark.parametrize("suffix", [".html", ".png", ".gif", ".apng", ".mp4", ".nrrd", ".mha", ".nii.gz", ""])
@pytest.mark.parametrize("window", [None, (-300, 700.5)])
def test_program_writes_the_same(image, turn, tmp_path, suffix, window):
    if suffix in (".gif", ".apng", ".mp4") and not shutil.which("ffmpeg"):
        pytest.skip("ffmpeg is not installed")
    source = tmp_path / "volume.nrrd"
    itk.imwrite(image, source)
    turn.source_files = [source]
    turn.frames["Background"] = float(np.min(image))
    turn.center = itk.ShearWarpMIPView.GetCenter(image)
    folders = tmp_path / "program", tmp_path / "package"
    for folder in folders:
        folder.mkdir()
    paths = [folder / f"turn{suffix}" for folder in folders]
    outputs = [paths[0]] if suffix else [folders[0] / "turn.nrrd", "--dicom-out", paths[0]]
    given = ["--window", "{},{}".format(*window)] if window else []
    given += NO_LABELS if suffix in (".html", ".png", ".gif", ".apng", ".mp4") else []
    subprocess.run([PROGRAM, source, *outputs, "--frames", str(FRAMES), *given], check=True)
    _save.save_turn(turn, paths[1], window=window, labels=False)
    if suffix == ".png":
        files = [sorted(folder.iterdir()) for folder in folders]
        assert [path.name for path in files[0]] == [path.name for path in files[1]]
        for one, other in zip(*files, strict=True):
            assert_array_equal(*(decode_png(path.read_bytes()) for path in (one, other)))
    elif suffix == ".html":
        one, other = (read_series(path.read_text(encoding="utf-8")) for path in paths)
        assert_array_equal(decode_frames(one), decode_frames(other))
        assert one | {"frames": None} == other | {"frames": None}
    elif suffix == "":
        for datasets in zip(*map(read_dicom, paths), strict=True):
            compare_datasets(*datasets)
    elif suffix == ".nii.gz":
        assert_array_equal(*(np.asarray(itk.imread(path)) for path in paths))
    else:
        assert paths[0].read_bytes() == paths[1].read_bytes()


def compare_datasets(one, other):
    assert one.keys() == other.keys()
    for element in one:
        name, found = element.keyword, other[element.tag].value
        if element.VR == "DS" and element.value is not None:
            np.testing.assert_allclose(np.asarray(found, float), np.asarray(element.value, float), atol=1e-9)
        elif not name.endswith(("UID", "Time")) and name != "ManufacturerModelName":
            assert found == element.value, name


# ---- DICOM


def read_dicom(folder, count=FRAMES):
    files = sorted(folder.iterdir())
    assert [file.name for file in files] == [f"frame-{n:03}.dcm" for n in range(1, count + 1)]
    series = [pydicom.dcmread(file) for file in files]
    for dataset in series:
        dataset.walk(lambda _, element: element.value)
    return series


def test_dicom_without_a_source(turn, tmp_path):
    _save.save_turn(turn, tmp_path / "turn")
    series = read_dicom(tmp_path / "turn")
    assert os.listdir(tmp_path) == ["turn"]
    frames = np.asarray(turn.frames)
    for name in ("SeriesInstanceUID", "StudyInstanceUID", "FrameOfReferenceUID"):
        assert len({dataset[name].value for dataset in series}) == 1
    assert len({dataset.SOPInstanceUID for dataset in series}) == FRAMES
    for n, (dataset, frame, transform) in enumerate(zip(series, frames, turn.transforms, strict=True)):
        assert dataset.SOPClassUID == pydicom.uid.SecondaryCaptureImageStorage
        assert list(dataset.ImageType) == ["DERIVED", "SECONDARY", "PROJECTION IMAGE", "MAX_IP"]
        assert dataset.InstanceNumber == n + 1
        assert dataset.ImageComments == f"Turned by {60 * n} degrees"
        assert_array_equal(dataset.pixel_array, frame)
        assert (dataset.RescaleSlope, dataset.RescaleIntercept, dataset.RescaleType) == (1, 0, "US")
        assert dataset.WindowCenter == 0.5 * (int(frames.min()) + int(frames.max()) + 1)
        assert dataset.WindowWidth == int(frames.max()) - int(frames.min()) + 1
        check_plane(dataset, turn.frames, transform, 0.0)
        assert dataset.SliceThickness is None
        assert dataset.PatientOrientation[1] == "F"
    assert series[0].PatientOrientation[0] == "L"


def check_plane(dataset, frames, transform, depth):
    """A pixel lies where the view has it."""
    right, down = np.reshape(dataset.ImageOrientationPatient, (2, 3)).astype(float)
    row_spacing, column_spacing = dataset.PixelSpacing
    place = np.array(dataset.ImagePositionPatient, float) + 5 * column_spacing * right + 3 * row_spacing * down
    u, v, _ = (origin + n * step for origin, n, step in zip(frames.GetOrigin(), (5, 3, 0), frames.GetSpacing()))
    np.testing.assert_allclose(place, list(transform.TransformPoint([u, v, depth])), atol=1e-9)


def test_dicom_of_a_slab_and_a_minimum(image, tmp_path):
    turn = make_turn(image, SlabNear=-2.0, SlabFar=6.0, OutputSpacing=[0.5, 0.8])
    turn.slab, turn.mode = (-2.0, 6.0), "minimum"
    _save.save_turn(turn, tmp_path / "turn", window=(-500, 500))
    for dataset, transform in zip(read_dicom(tmp_path / "turn"), turn.transforms, strict=True):
        check_plane(dataset, turn.frames, transform, 2.0)
        assert dataset.SliceThickness == pytest.approx(8.0)
        assert (dataset.WindowCenter, dataset.WindowWidth) == (0.5, 1001)
        assert dataset.ImageType[3] == "MIN_IP"
        assert dataset.SeriesDescription == "MinIP"
        assert dataset.DerivationCodeSequence[0].CodeValue == "113079"


def test_dicom_plane_is_through_the_center(image, tmp_path):
    turn = make_turn(image, Center=[40.0, -10.0, 3.0])
    turn.center = itk.ShearWarpMIPView.GetCenter(image)
    _save.save_turn(turn, tmp_path / "turn")
    for dataset in read_dicom(tmp_path / "turn"):
        right, down = np.reshape(dataset.ImageOrientationPatient, (2, 3)).astype(float)
        away = np.array(list(turn.center)) - np.array(dataset.ImagePositionPatient, float)
        assert abs(away @ np.cross(right, down)) < 1e-9


@pytest.mark.parametrize("kind", ["fractions", "wide", "signed and wide", "unsigned"])
def test_dicom_values(image, tmp_path, kind):
    turn = make_turn(image)
    frames = np.asarray(turn.frames).astype(np.float64)
    values = {
        "fractions": frames / 7.0,
        "wide": frames * 100.0,
        "signed and wide": np.where(frames > 0, 60000.0, frames),
        "unsigned": frames + 1000.0 + 33000.0,
    }[kind]
    turn.frames = itk.image_from_array(values)
    _save.save_turn(turn, tmp_path / "turn")
    slopes = set()
    for dataset, expected in zip(read_dicom(tmp_path / "turn"), values, strict=True):
        slopes.add(float(dataset.RescaleSlope))
        found = dataset.pixel_array * float(dataset.RescaleSlope) + float(dataset.RescaleIntercept)
        assert np.abs(found - expected).max() <= (
            0.50001 * dataset.RescaleSlope if kind in ("fractions", "wide") else 0
        )
        assert dataset.get("VOILUTFunction") == ("LINEAR_EXACT" if dataset.RescaleSlope != 1 else None)
    assert len(slopes) == 1


def make_sources(name, folder):
    files = []
    for n in range(3):
        dataset = pydicom.dcmread(get_testdata_file(name))
        dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.{n}"
        files.append(folder / f"source-{n}.dcm")
        dataset.save_as(files[-1])
    return files


@pytest.mark.parametrize("name", ["CT_small.dcm", "MR_small.dcm"])
@pytest.mark.parametrize("known", ["files", "dictionary"])
def test_dicom_of_a_source(image, tmp_path, name, known):
    files = make_sources(name, tmp_path)
    turn = make_turn(image)
    if known == "files":
        turn.source_files = [*map(str, files), __file__]
    else:
        turn.source_metadata = dict(itk.imread(files[0]))
    _save.save_turn(turn, tmp_path / "turn")
    source = pydicom.dcmread(files[0])
    for dataset in read_dicom(tmp_path / "turn"):
        for keyword in """SOPClassUID PatientName PatientID PatientSex StudyInstanceUID StudyDate StudyID
                FrameOfReferenceUID SpecificCharacterSet Modality PhotometricInterpretation""".split():
            assert dataset.get(keyword) == source.get(keyword), keyword
        assert dataset.SeriesInstanceUID != source.SeriesInstanceUID
        assert dataset.SeriesNumber == source.SeriesNumber + 1000
        assert dataset.Manufacturer == ""
        assert dataset.ContributingEquipmentSequence[0].Manufacturer == source.Manufacturer
        assert dataset.get("WindowCenter", None) is not None
        if "WindowCenter" in source:
            assert dataset.WindowCenter == source.WindowCenter
        references = [item.ReferencedSOPInstanceUID for item in dataset.get("SourceImageSequence", [])]
        assert references == ([f"1.2.3.{n}" for n in range(3)] if known == "files" else [])
        assert ("RescaleType" in dataset) == (name == "CT_small.dcm")


@pytest.mark.skipif(not shutil.which("dciodvfy"), reason="dicom3tools is not installed")
@pytest.mark.parametrize("name", ["CT_small.dcm", "MR_small.dcm", None])
def test_dicom_is_valid(image, tmp_path, name):
    turn = make_turn(image)
    turn.source_files = make_sources(name, tmp_path) if name else []
    _save.save_turn(turn, tmp_path / "turn")
    for file in (tmp_path / "turn").iterdir():
        done = subprocess.run(["dciodvfy", file], check=False, capture_output=True, text=True)
        assert done.returncode == 0 and "Error" not in done.stdout + done.stderr


@pytest.mark.parametrize("suffix", [".html", ".png", ".nrrd", ".nii.gz", ".mha"])
def test_capitals(turn, tmp_path, suffix):
    for name in (f"turn{suffix}", f"TURN{suffix.upper()}"):
        _save.save_turn(turn, tmp_path / name)
    files = sorted(tmp_path.iterdir(), key=lambda path: (path.name.lower(), path.name))
    assert files and len(files) % 2 == 0
    for one, other in zip(files[::2], files[1::2]):
        assert one.read_bytes() == other.read_bytes()


# ---- Bad input


@pytest.mark.parametrize("name", ["turn.jpg", "turn.v2", ".gif", ".GIF", "."])
def test_unknown_suffix(turn, tmp_path, name):
    with pytest.raises(ValueError, match=r"must be a name that ends in one of .html .gif .* or be a folder"):
        _save.save_turn(turn, name if name == "." else tmp_path / name)


BAD = {
    "rate": ("must be from 0.1 to 100 frames per second, but it is", [0, -5, 100.1, float("nan"), "fast"]),
    "window": (
        "must be two finite numbers, the lower one first, but it is",
        [(5, 5), (8, 2), (0, float("inf")), (float("nan"), 1), (1, 2, 3), 5],
    ),
    "labels": ("must be True or False, but it is 'no'", ["no"]),
    "annotate": ("must be True or False, but it is 'no'", ["no"]),
}


@pytest.mark.parametrize("name, value", [(name, value) for name, (_, values) in BAD.items() for value in values])
def test_bad_parameters(name, value, turn, tmp_path):
    outputs = [tmp_path / each for each in ("turn.html", "turn.png", "turn", "turn.nrrd")]
    calls = [partial(_save.save_turn, turn, path) for path in outputs]
    if name == "rate":
        calls.append(partial(_save.make_page, turn))
    else:
        picture = itk_shearwarpmip.mip(itk_shearwarpmip.open_image(np.ones((3, 4, 5), np.uint8)))
        calls.append(partial(_save.save_png, picture, tmp_path / "mip.png"))
    for call in calls:
        with pytest.raises(ValueError, match=f"{name} {BAD[name][0]}"):
            call(**{name: value})
    assert not os.listdir(tmp_path)


def test_bad_folder(turn, tmp_path):
    for name in ("turn.nrrd", "turn.png", "turn"):
        with pytest.raises(FileNotFoundError, match=r"is no folder to write 'turn.* into: make it first"):
            _save.save_turn(turn, tmp_path / "none" / name)
    (tmp_path / "turn.nrrd").mkdir()
    with pytest.raises(ValueError, match="is a folder or a device"):
        _save.save_turn(turn, tmp_path / "turn.nrrd")
    (tmp_path / "turn-003.png").mkdir()
    with pytest.raises(ValueError, match=r"turn-003.png' is a folder or a device"):
        _save.save_turn(turn, tmp_path / "turn.png")
    assert sorted(os.listdir(tmp_path)) == ["turn-003.png", "turn.nrrd"]
    with pytest.raises(FileExistsError, match="a DICOM series needs a folder that is new or empty"):
        _save.save_turn(turn, tmp_path)
    (tmp_path / "turn").write_text("a file")
    with pytest.raises(FileExistsError, match="new or empty"):
        _save.save_turn(turn, tmp_path / "turn")
    (tmp_path / "empty").mkdir()
    _save.save_turn(turn, tmp_path / "empty")
    read_dicom(tmp_path / "empty")


def test_source_is_not_written(turn, tmp_path):
    source = tmp_path / "turn-002.png"
    source.write_text("source")
    (tmp_path / "link.nrrd").symlink_to(source)
    turn.source_files = [source, tmp_path / "gone.nrrd"]
    for name in ("turn.png", "link.nrrd"):
        with pytest.raises(ValueError, match=r"turn-002.png' was read to make this turn"):
            _save.save_turn(turn, tmp_path / name)
    assert source.read_text() == "source"
    assert len(os.listdir(tmp_path)) == 2


def test_frames_of_vectors(turn, tmp_path):
    turn.frames = itk.image_from_array(np.zeros((2, 3, 4, 3), np.uint8), is_vector=True)
    with pytest.raises(TypeError, match="one value for each pixel, but they have 3"):
        _save.save_turn(turn, tmp_path / "turn.nrrd")
    turn.frames = itk.image_from_array(np.zeros((3, 4), np.uint8))
    with pytest.raises(TypeError, match="frames must be a 3D image, their third axis the frames"):
        _save.make_page(turn)


def test_dicom_of_what_it_cannot_hold(turn, tmp_path):
    shear = itk.AffineTransform[itk.D, 3].New()
    shear.Shear(0, 1, 0.3)
    turn.transforms[2] = shear
    with pytest.raises(ValueError, match="the view of frame 3 is sheared"):
        _save.save_turn(turn, tmp_path / "turn")
    turn.frames = itk.image_from_array(np.full((FRAMES, 4, 4), np.nan, np.float32))
    with pytest.raises(ValueError, match="not finite, which DICOM cannot hold"):
        _save.save_turn(turn, tmp_path / "turn")
    assert not os.listdir(tmp_path)


def test_what_is_missing_is_named(turn, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RuntimeError, match="needs the program ffmpeg: install it"):
        _save.save_turn(turn, tmp_path / "turn.gif")
    monkeypatch.setitem(sys.modules, "pydicom", None)
    monkeypatch.delitem(sys.modules, "itk_shearwarpmip._dicom_series", raising=False)
    monkeypatch.delattr("itk_shearwarpmip._dicom_series", raising=False)
    with pytest.raises(ImportError, match=r"needs pydicom: pip install itk-shearwarpmip\[dicom\]"):
        _save.save_turn(turn, tmp_path / "turn")
    assert not os.listdir(tmp_path)

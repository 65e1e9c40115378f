"""Files and pages of pictures, turns and volumes, by the program, read back by others."""

import base64
import functools
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import itk
import itk_shearwarpmip
import numpy as np
import pydicom
import pytest
from forms import compare_datasets
from itk_shearwarpmip import Turn, _entries, _front, _program, _window, _write, mip, open_image, save_png, write
from numpy.testing import assert_array_equal
from PIL import Image
from program import HEED_INTERRUPTS
from pydicom.data import get_testdata_file
from samples import make_like, needs_proc

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


@pytest.fixture
def head(rng):
    """Large enough for letters."""
    voxels = rng.integers(-100, 1000, (40, 50, 60), np.int16)
    return open_image(voxels, spacing=(1.5, 2, 2.5), origin=(3, 4, 5), direction=np.eye(3))


def run_program(*arguments):
    subprocess.run([_program.find(), *map(str, arguments)], check=True, capture_output=True)


def expected_grey(frames, low, high):
    """Halves up, by whole numbers."""
    clamped = np.clip(np.asarray(frames).astype(int), low, high)
    return (510 * (clamped - low) + high - low) // (2 * (high - low))


def read_series(page):
    return json.loads(re.search(r'id="series">(.*?)</script>', page, re.DOTALL)[1])


def read_png(path):
    return np.asarray(Image.open(path if not isinstance(path, bytes) else io.BytesIO(path)))


# ---- Windows, as the viewer finds them


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 2, 51, 120])
def test_window_is_that_of_sorted_values(rng, dtype, count):
    values = np.sort(rng.permutation(np.arange(1, 121))[:count])
    shuffled = rng.permutation(np.concatenate([values, np.zeros(360 - count)])).astype(dtype)
    low = values[int(0.01 * (count - 1) + 0.5)]
    high = values[int(0.998 * (count - 1) + 0.5)]
    expected = (low, high) if low < high else (high - 1, high)
    assert _window.find_window(itk.image_from_array(shuffled.reshape(18, 20))) == expected


def test_window_leaves_out_background_and_what_is_not_finite():
    pixels = np.full((3, 4), -1000.0, np.float32)
    pixels[0] = [np.nan, np.inf, -np.inf, 5.0]
    pixels[1, :2] = [0.0, 7.0]
    image = itk.image_from_array(pixels)
    image["Background"] = -1000.0
    assert _window.find_window(image) == (0.0, 7.0)
    assert _window.find_window(itk.image_from_array(np.maximum(pixels[1:], -1000.0))) == (0.0, 7.0)
    image["Background"] = float("nan")
    assert _window.find_window(image) == (-1000.0, 7.0)


@pytest.mark.parametrize("background", [0, -1000])
def test_window_of_nothing_has_a_black_background(background):
    image = itk.image_from_array(np.full((5, 4), background, np.int16))
    assert _window.find_window(image) == (background, background + 1)


def test_grey_levels():
    values = np.arange(-5, 1030, dtype=np.int16)
    for low, high in ((0, 255), (0, 510), (-2, 1000), (7, 8)):
        assert_array_equal(_window.make_grey(values, (low, high)), expected_grey(values, low, high))
    assert list(_window.make_grey(np.array([0, 99, 255], np.uint8), (-1, 400))) == [1, 64, 163]
    special = np.array([np.nan, -np.inf, np.inf, 0.5], np.float32)
    assert list(_window.make_grey(special, (0.0, 1.0))) == [0, 0, 255, 128]


# ---- The program's options


def read_help():
    """Names of options and whether they have a value."""
    text = subprocess.run([_program.find(), "--help-all"], check=True, capture_output=True, text=True).stdout
    options = {}
    for names, value in re.findall(r"^  (?:-\w, ?)?(--[a-z-]+(?:, ?--[a-z-]+)*)( [A-Z{])?", text, re.MULTILINE):
        options |= {name.removeprefix("--"): bool(value) for name in names.replace(" ", "").split(",")}
    return options


def test_options_are_the_program_s(tmp_path, head):
    """The options of outputs are the options that a file of frames takes."""
    others = """output help help-all version write-phantom phantom-size write-volume with-attributes trust
        mask overlay segments""".split()
    run_program(save_head(head, tmp_path), tmp_path / "turn.nrrd", "--frames", 3)
    values = {"size": (9, 9), "page_bits": 8, "oversampling": 2, "mode": "minimum", "view": "left", "center": (1, 2, 3)}
    of_outputs = set()
    for option, has_value in read_help().items():
        if option in others:
            continue
        name = "labels" if option == "no-labels" else option.replace("-", "_")
        value = values.get(name, (1, 2) if "slab" in name or name in ("window", "wl") else 1)
        arguments = _write.make_arguments({name: value if has_value else name != "labels"})
        command = [_program.find(), *arguments, tmp_path / "turn.nrrd", tmp_path / "x.html"]
        run = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
        if run.returncode == 0 or "--multi-frame requires --dicom-out" in run.stderr:
            of_outputs.add(name)
    assert of_outputs == _write.OutputOptions.__annotations__.keys()


def save_head(head, folder):
    itk.imwrite(head, folder / "head.nrrd")
    return folder / "head.nrrd"


@pytest.mark.parametrize(
    "name, value, argument",
    [
        ("window", (1, 2.5), "--window=1,2.5"),
        ("window", "bone", "--window=bone"),
        ("wl", np.array([1, 2], np.int16), "--wl=1,2"),
        ("elevations", [-30, np.float32(0.5)], "--elevations=-30,0.5"),
        ("labels", False, "--no-labels"),
        ("multi_frame", True, "--multi-frame"),
        ("page_bits", np.uint8(16), "--page-bits=16"),
        ("slab", (-np.inf, 5), "--slab=-inf,5.0"),
    ],
)
def test_arguments(name, value, argument):
    made = _write.make_arguments({name: value})
    assert made == [argument] or made == [argument.replace("5.0", "5")]
    assert _write.make_arguments({name: None}) == []


@pytest.mark.parametrize("name", ["help", "help-all", "version"])
def test_options_that_are_not_of_images(name):
    with pytest.raises(TypeError, match="is no option for an image"):
        _write.make_arguments({name: True})


def test_flags_that_say_nothing():
    assert _write.make_arguments({"labels": True, "annotate": False}) == []


@pytest.mark.parametrize(
    "options, message",
    [
        ({"azimuth": 3}, "azimuth is not possible: the (turn|picture) has frames, which are not projected again"),
        ({"labels": "no"}, "labels must be True or False"),
        ({"annotate": "yes"}, "annotate must be True or False, but it is 'yes'"),
        ({"rate": True}, "rate must be a number, a text or a sequence, but it is True"),
        ({"overlay": np.ones((30, 40, 50))}, r"but it is an array of the shape \(30, 40, 50\)$"),
        ({"rate": None, "window": {}}, "window must be a number, a text or a sequence"),
        ({"rate": 0}, "rate"),
        ({"rate": 100.1}, "rate"),
        ({"window": (8, 2)}, "LOW must be less than HIGH"),
        ({"window": (0, float("inf"))}, "not two finite numbers"),
        ({"page_bits": 12}, "page"),
    ],
)
def test_bad_options(turn, tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        turn.save(tmp_path / "turn.html", **options)
    picture = mip(open_image(np.ones((3, 4, 5), np.uint8)))
    if not {"rate", "page_bits", "labels"} & options.keys():
        with pytest.raises(ValueError, match=message):
            save_png(picture, tmp_path / "mip.png", **options)
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("value", [True, False, 3, "a", np.ones((30, 40, 50)), np.arange(500.0), {}])
def test_unknown_options(turn, head, tmp_path, value):
    message = "^annotated is not expected; did you mean 'annotate'[?]$"
    with pytest.raises(TypeError, match=message):
        turn.save(tmp_path / "turn.html", annotated=value)
    with pytest.raises(TypeError, match=message):
        write(head, tmp_path / "x.png", annotated=value)
    assert not os.listdir(tmp_path)


def test_flags_are_the_program_s():
    flags = {option.replace("-", "_") for option, has_value in read_help().items() if not has_value}
    assert {*_write._FLAGS} == flags - {*_write._NOT_OF_IMAGES} | {"labels"}


@pytest.mark.parametrize("name", ["source", "mask", "overlay", "transform"])
def test_files_that_are_missing(head, tmp_path, name):
    options = {} if name == "source" else {name: tmp_path / "none.nrrd"}
    with pytest.raises(FileNotFoundError, match=r"none\.nrrd' does not exist"):
        write(head if options else tmp_path / "none.nrrd", tmp_path / "x.png", **options)


# ---- Turns


def test_all_outputs_at_once(head, tmp_path):
    turn = itk_shearwarpmip.turn(head, frames=3)
    turn.save(tmp_path / "a.html", page_bits=16, dicom_out=tmp_path / "dicom", multi_frame=True, rate=7)
    series = read_series((tmp_path / "a.html").read_text(encoding="utf-8"))
    assert (series["bits"], series["rate"]) == (16, 7)
    assert pydicom.dcmread(tmp_path / "dicom" / "frames.dcm").NumberOfFrames == 3


@pytest.mark.parametrize(
    "parameters, loop",
    [
        ({"frames": FRAMES}, "turn"),
        ({"angular_range": -360.0}, "turn"),
        ({"frames": 1}, "turn"),
        ({"angular_range": 180.0}, "none"),
        ({"angular_range": 60.0, "rocking": True}, "swing"),
        ({"frames": 2, "angular_range": 60.0, "rocking": True}, "swing"),
        ({"transforms": [itk.IdentityTransform[itk.D, 3].New()] * 2}, "none"),
    ],
)
def test_page_goes_on_as_the_turn_does(image, parameters, loop):
    series = read_series(_write.make_page(itk_shearwarpmip.turn(image, **parameters)))
    assert series["loop"] == loop
    assert ("angles" in series) == ("transforms" not in parameters)


def test_page_is_in_mm(image):
    turn = make_turn(image)
    _entries.put(turn.frames, "Unit", "um")
    series = read_series(_write.make_page(turn))
    assert series["spacing"] == pytest.approx([each / 1000 for each in list(turn.frames.GetSpacing())[:2]])
    assert series["origin"] == pytest.approx([each / 1000 for each in list(turn.frames.GetOrigin())[:2]])


def test_page_of_an_array_has_no_letters(tmp_path):
    turn = itk_shearwarpmip.turn(np.zeros((4, 4, 4), np.int16), frames=2)
    turn.save(tmp_path / "turn.html", labels=False)
    series = read_series((tmp_path / "turn.html").read_text(encoding="utf-8"))
    assert "letters" not in series and series["labels"] is False


def test_title_of_a_page(turn, tmp_path):
    turn.source_files = [tmp_path / "Doe^Jane.nrrd"]
    page = _write.make_page(turn)
    assert read_series(page)["title"] == "Maximum intensity projection"
    assert "Jane" not in page and tmp_path.name not in page
    turn.save(tmp_path / "titled.html", title="a<b> \\n é")
    page = (tmp_path / "titled.html").read_text(encoding="utf-8")
    assert read_series(page)["title"] == "a<b> \\n é"
    assert "a<b>" not in page
    assert 'srcdoc="&lt;!DOCTYPE html&gt;' in turn._repr_html_()


def test_window_of_a_turn(turn, tmp_path):
    turn.window = (-100, 100)
    for given, window in (
        ({"window": (-500, 800)}, (-500, 800)),
        ({"wl": (150, 1300)}, (-500, 800)),
        ({}, turn.window),
    ):
        turn.save(str(tmp_path / "turn.png"), **given)
        paths = sorted(tmp_path.iterdir())
        assert [path.name for path in paths] == [f"turn-00{n}.png" for n in range(FRAMES)]
        assert_array_equal([read_png(path) for path in paths], expected_grey(turn.frames, *window))


def test_frames_of_colours(tmp_path):
    frames = itk.image_from_array(np.arange(72, dtype=np.uint8).reshape(2, 3, 4, 3), is_vector=True)
    Turn(frames, [itk.AffineTransform[itk.D, 3].New()] * 2).save(tmp_path / "turn.png", window=(0, 255))
    assert_array_equal(read_png(tmp_path / "turn-001.png"), np.asarray(frames)[1])


def test_link_and_mode_stay(turn, tmp_path):
    (tmp_path / "other").mkdir()
    real = tmp_path / "other" / "real.nrrd"
    real.write_text("before")
    real.chmod(0o640)
    (tmp_path / "turn.nrrd").symlink_to(real)
    turn.save(tmp_path / "turn.nrrd")
    assert (tmp_path / "turn.nrrd").is_symlink()
    assert real.stat().st_mode & 0o777 == 0o640
    assert_array_equal(itk.imread(real), turn.frames)


@pytest.mark.parametrize("name", ["turn 1.nrrd", "-turn.nrrd", "Ünï 図.nrrd", "TURN.NRRD"])
def test_names(turn, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    turn.save(name)
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("name", ["turn.v2", ".gif", "none/turn.nrrd"])
def test_bad_names(turn, tmp_path, name):
    with pytest.raises((OSError, ValueError), match=re.escape(name)):
        turn.save(tmp_path / name)
    assert not os.listdir(tmp_path)


def test_source_is_not_written(turn, tmp_path):
    source, mask = tmp_path / "turn-002.png", tmp_path / "mask.nrrd"
    for each in (source, mask):
        each.write_text("source")
    (tmp_path / "link.nrrd").symlink_to(source)
    turn.source_files, turn.mask_files = [source, tmp_path / "gone.nrrd"], [mask]
    for name in ("turn.png", "link.nrrd", "mask.nrrd"):
        with pytest.raises((OSError, ValueError), match="this call reads it"):
            turn.save(tmp_path / name)
    assert source.read_text() == mask.read_text() == "source"
    assert len(os.listdir(tmp_path)) == 3


@pytest.mark.parametrize("suffix", [".html", ""])
def test_full_disk(turn, tmp_path, suffix, monkeypatch):
    """Of the program: a file of 1500 bytes is the largest."""
    path = tmp_path / f"turn{suffix}"
    if suffix:
        path.write_text("before")
    before = sorted(os.listdir(tmp_path))
    script = tmp_path.parent / f"{tmp_path.name}-limited"
    script.write_text(f"#!/bin/bash\ntrap '' XFSZ\nulimit -f 1\nexec '{_program.find()}' \"$@\"\n")
    script.chmod(0o755)
    monkeypatch.setenv("SHEARWARPMIP_PROGRAM", str(script))
    large = make_turn(itk.image_from_array(np.random.default_rng(1).integers(0, 60000, (40, 40, 40), np.uint16)))
    with pytest.raises((OSError, RuntimeError, ValueError)):
        large.save(path)
    assert sorted(os.listdir(tmp_path)) == before
    assert not before or path.read_text() == "before"


def test_program_that_is_missing(turn, tmp_path, monkeypatch):
    monkeypatch.setenv("SHEARWARPMIP_PROGRAM", str(tmp_path / "none"))
    with pytest.raises((OSError, RuntimeError), match="none"):
        turn.save(tmp_path / "turn.nrrd")
    assert not os.listdir(tmp_path)


def test_ffmpeg_that_is_missing(turn, tmp_path, monkeypatch):
    monkeypatch.setenv("SHEARWARPMIP_PROGRAM", _program.find())
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises((OSError, RuntimeError), match="ffmpeg"):
        turn.save(tmp_path / "turn.gif")


# ---- DICOM


def read_dicom(folder, count=FRAMES):
    files = sorted(folder.iterdir())
    assert [file.name for file in files] == [f"frame-{n:03}.dcm" for n in range(1, count + 1)]
    return [pydicom.dcmread(file) for file in files]


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
    turn.save(tmp_path / "turn")
    source = pydicom.dcmread(files[0])
    for dataset in read_dicom(tmp_path / "turn"):
        for keyword in """SOPClassUID PatientName PatientID PatientSex StudyInstanceUID StudyDate StudyID
                FrameOfReferenceUID SpecificCharacterSet Modality PhotometricInterpretation""".split():
            assert dataset.get(keyword) == source.get(keyword), keyword
        assert dataset.SeriesInstanceUID != source.SeriesInstanceUID
        assert dataset.SeriesNumber == source.SeriesNumber + 1000
        assert dataset.ContributingEquipmentSequence[0].Manufacturer == source.Manufacturer
        if "WindowCenter" in source:
            assert dataset.WindowCenter == source.WindowCenter
        references = [item.ReferencedSOPInstanceUID for item in dataset.get("SourceImageSequence", [])]
        assert references == ([f"1.2.3.{n}" for n in range(3)] if known == "files" else [])
        assert ("RescaleType" in dataset) == (name == "CT_small.dcm")
    assert read_series(_write.make_page(turn))["title"] == "Maximum intensity projection"


def test_dicom_of_low_values_that_are_white(image, tmp_path):
    turn = make_turn(image)
    _entries.put(turn.frames, "IsInverted", "1")
    turn.save(tmp_path / "turn")
    assert read_dicom(tmp_path / "turn")[0].PhotometricInterpretation == "MONOCHROME1"
    assert read_series(_write.make_page(turn))["inverted"] is True


def test_dicom_of_suv(image, tmp_path):
    turn = make_turn(image)
    _entries.put(image, "IsSuv", "1")
    turn.frames = _front.show_itself(turn.frames, 0.0, image)
    turn.save(tmp_path / "turn")
    assert read_dicom(tmp_path / "turn")[0].DerivationDescription.endswith(" of SUV by body weight")
    write(image, tmp_path / "written", frames=2)
    assert read_dicom(tmp_path / "written", 2)[0].DerivationDescription.endswith(" of SUV by body weight")


def test_dicom_of_what_it_cannot_hold(turn, tmp_path):
    shear = itk.AffineTransform[itk.D, 3].New()
    shear.Shear(0, 1, 0.3)
    turn.transforms[2] = shear
    with pytest.raises(ValueError, match="sheared"):
        turn.save(tmp_path / "turn")
    assert not os.listdir(tmp_path)


# ---- Pictures


def test_picture_without_a_view(tmp_path):
    image = itk.image_from_array(np.arange(3600, dtype=np.int16).reshape(60, 60))
    save_png(image, tmp_path / "x.png", window=(0, 3599))
    assert_array_equal(read_png(tmp_path / "x.png"), expected_grey(image, 0, 3599))


# ---- write()


def test_write_of_frames(head, tmp_path):
    """Projected once, written twice."""
    write(head, tmp_path / "turn.nrrd", frames=4)
    for name in ("turn.html", "turn.tif"):
        for source, folder, options in ((head, "one", {"frames": 4}), (tmp_path / "turn.nrrd", "other", {})):
            (tmp_path / folder).mkdir(exist_ok=True)
            write(source, tmp_path / folder / name, annotate=name != "turn.html", **options)
    files = [sorted((tmp_path / folder).iterdir()) for folder in ("one", "other")]
    assert [each.read_bytes() for each in files[0]] == [each.read_bytes() for each in files[1]]
    assert len(files[0]) == 5
    with pytest.raises(ValueError, match=r"azimuth is not possible: '.*' has frames, which are not projected again"):
        write(tmp_path / "turn.nrrd", tmp_path / "x.png", azimuth=3)


def test_write_of_arrays_as_mask_overlay_and_segments(head, tmp_path):
    voxels = np.asarray(head)
    mask, labels = (voxels > 500).astype(np.int64), (voxels > 900).astype(np.uint8)
    write(head, tmp_path / "one.png", mask=mask, overlay=voxels, segments=labels, opacity=0.3, view="left")
    source = save_head(head, tmp_path)
    files = {"mask": mask.astype(np.int16), "overlay": voxels, "segments": labels}
    for name, array in files.items():
        itk.imwrite(make_like(array, head), tmp_path / f"{name}.nrrd")
        files[name] = tmp_path / f"{name}.nrrd"
    write(source, tmp_path / "other.png", **files, opacity=0.3, view="left")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "other.png").read_bytes()
    write(source, tmp_path / "third.png", mask=mask > 0, overlay=voxels, segments=labels, opacity=0.3, view="left")
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "third.png").read_bytes()
    with pytest.raises(ValueError, match=r"^mask: an array must have the source's shape here"):
        write(head, tmp_path / "x.png", mask=mask[1:])


def test_write_of_an_array_as_mask_of_part_of_a_file(rng, tmp_path):
    """Of a DICOM folder with two series, of points in time, of colours."""
    folder = tmp_path / "study"
    folder.mkdir()
    for n in range(8):
        dataset = pydicom.dcmread(get_testdata_file("CT_small.dcm"))
        dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.{n}"
        dataset.SeriesInstanceUID, dataset.SeriesDescription = f"1.2.{n % 2}", "ab"[n % 2]
        dataset.ImagePositionPatient = [0, 0, 5 * (n // 2)]
        dataset.save_as(folder / f"{n}.dcm")
    mask = rng.integers(0, 2, (4, 128, 128)).astype(bool)
    write(folder, tmp_path / "one.nrrd", series="b", mask=mask)
    assert_array_equal(itk.imread(tmp_path / "one.nrrd"), mip(folder, series="b", mask=mask))
    times = rng.integers(0, 200, (3, 5, 6, 7)).astype(np.int16)
    itk.imwrite(itk.image_from_array(times), tmp_path / "4d.nrrd")
    colours = rng.integers(0, 200, (5, 6, 7, 3), np.uint8)
    itk.imwrite(itk.image_from_array(colours, is_vector=True), tmp_path / "rgb.nrrd")
    mask = rng.integers(0, 2, (5, 6, 7), np.uint8)
    parts = {"4d.nrrd": [*times], "rgb.nrrd": np.moveaxis(colours, -1, 0)}
    for name, volumes in parts.items():
        write(tmp_path / name, tmp_path / "x.nrrd", mask=mask)
        written = itk.array_from_image(itk.imread(tmp_path / "x.nrrd"))
        found = np.moveaxis(written, -1, 0) if name == "rgb.nrrd" else written
        for part, volume in zip(found, volumes, strict=True):
            assert_array_equal(part, mip(volume, mask=mask))


@pytest.mark.parametrize("kind", ["array", "file"])
def test_write_takes_the_geometry_of_a_source(kind, rng, tmp_path):
    voxels = rng.integers(0, 900, (10, 12, 14), np.int16)
    source = voxels
    if kind == "file":
        itk.imwrite(itk.image_from_array(voxels), tmp_path / "source.nrrd")
        source = tmp_path / "source.nrrd"
    where = {"spacing": (2.0, 1.5, 3.0), "origin": (5, 6, 7), "direction": np.diag([-1, 1, -1])}
    write(source, tmp_path / "x.nrrd", **where, mask=voxels > 100)
    expected = mip(open_image(voxels, **where), mask=voxels > 100)
    written = itk.imread(tmp_path / "x.nrrd")
    assert_array_equal(written, expected)
    assert list(written.GetSpacing())[:2] == list(expected.GetSpacing())


def test_write_takes_a_point_in_time(rng, tmp_path):
    times = rng.integers(0, 200, (3, 5, 6, 7)).astype(np.int16)
    itk.imwrite(itk.image_from_array(times), tmp_path / "4d.nrrd")
    write(tmp_path / "4d.nrrd", tmp_path / "x.nrrd", time=1)
    assert_array_equal(itk.imread(tmp_path / "x.nrrd"), mip(times[1]))


@pytest.mark.parametrize("kind", ["image", "file", "micrometres"])
def test_write_takes_matrices_and_transforms(kind, head, oblique_view, tmp_path):
    image = open_image(head, origin=(1, 2, 3)) if kind == "micrometres" else head
    if kind == "micrometres":
        _entries.put(image, "Unit", "um")
    source = save_head(head, tmp_path) if kind == "file" else image
    matrix = np.array(mip(image, "left", azimuth=20)["FrameTransforms"]).reshape(4, 4)
    for view in (matrix, oblique_view):
        write(source, tmp_path / "x.nrrd", view=view)
        assert_array_equal(itk.imread(tmp_path / "x.nrrd"), mip(image, view))
    views = ["anterior", matrix.tolist(), oblique_view]
    write(source, tmp_path / "x.nrrd", transforms=views)
    written = itk.array_from_image(itk.imread(tmp_path / "x.nrrd"))
    assert_array_equal(written, itk_shearwarpmip.turn(image, transforms=views).frames)
    write(source, tmp_path / "x.nrrd", view=None)
    with pytest.raises(ValueError, match="a matrix as view must be 4 x 4"):
        write(source, tmp_path / "x.nrrd", view=np.eye(3))
    with pytest.raises(ValueError, match="transforms must be a list of views"):
        write(source, tmp_path / "x.nrrd", transforms="left")
    with pytest.raises(ValueError, match="elevation excludes transform"):
        write(source, tmp_path / "x.nrrd", view=matrix, elevation=3)


def test_write_keeps_what_is_known(rng, tmp_path):
    array = rng.integers(0, 1000, (50, 50, 50), np.int16)
    with pytest.warns(UserWarning, match="^there are no letters: the source does not say how it lies in the patient$"):
        write(array, tmp_path / "True.png")
    write(array, tmp_path / "False.png", labels=False)
    assert (tmp_path / "True.png").read_bytes() == (tmp_path / "False.png").read_bytes()
    image = open_image(array, spacing=(1, 1, 1))
    _entries.put(image, "IsInverted", "1")
    write(image, tmp_path / "inverted.png", labels=False)
    assert_array_equal(255 - read_png(tmp_path / "inverted.png"), read_png(tmp_path / "True.png"))
    write(array, tmp_path / "x.html", frames=2, labels=False)
    assert read_series((tmp_path / "x.html").read_text(encoding="utf-8"))["title"] == "Maximum intensity projection"


def test_notes_about_the_picture_are_warnings(rng, tmp_path):
    image = open_image(rng.integers(0, 1000, (50, 50, 50), np.int16), spacing=(1, 1, 1))
    turn = itk_shearwarpmip.turn(image, frames=2)
    for save in (turn.save, functools.partial(save_png, mip(image))):
        with pytest.warns(UserWarning, match="^there are no letters: .* does not say how it lies") as said:
            save(tmp_path / "x.png")
        assert said[0].filename == __file__
        save(tmp_path / "x.png", labels=False)
    # a notebook shows pictures and turns often
    assert turn._repr_html_() and mip(image)._repr_png_()
    labels = open_image((np.asarray(image) // 250).astype(np.uint8), direction=np.eye(3))
    with pytest.warns(UserWarning, match="^the source looks like labels: interpolation nearest"):
        write(labels, tmp_path / "x.png")
    write(labels, tmp_path / "x.png", interpolation="nearest")


def test_warnings_do_not_name_temporary_files(head, tmp_path):
    nothing = np.zeros(head.shape, np.uint8)
    with pytest.warns(UserWarning) as said:
        write(head, tmp_path / "x.png", mask=nothing, overlay=nothing, segments=nothing)
    texts = [str(each.message) for each in said]
    assert any("the mask" in text for text in texts) and not any(".nrrd" in text for text in texts), texts


def test_write_of_dicom(tmp_path):
    folder = tmp_path / "ct"
    folder.mkdir()
    for n in range(4):
        dataset = pydicom.dcmread(get_testdata_file("CT_small.dcm"))
        dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = f"1.2.3.{n}"
        dataset.ImagePositionPatient = [0, 0, 5 * n]
        dataset.InstanceNumber = n + 1
        dataset.save_as(folder / f"{n}.dcm")
    write(folder, tmp_path / "one", frames=2)
    write(open_image(folder), tmp_path / "other", frames=2)
    files = [sorted((tmp_path / name).iterdir()) for name in ("one", "other")]
    for one, other in zip(*files, strict=True):
        compare_datasets(pydicom.dcmread(one), pydicom.dcmread(other))


def test_write_does_not_overwrite_its_source(head, tmp_path):
    source = save_head(head, tmp_path)
    before = source.read_bytes()
    for each in (source, open_image(source)):
        with pytest.raises((OSError, ValueError), match="this call reads it"):
            write(each, source)
    assert source.read_bytes() == before


@pytest.mark.parametrize(
    "options, message",
    [
        ({"write_phantom": "x.nrrd"}, "the source excludes write_phantom"),
        ({"frames": 0}, "frames"),
        ({"mask": "none.nrrd"}, "none.nrrd"),
        ({"crop": ((1, 2), (3, 4))}, "crop must be a number"),
        ({"suv": True}, "suv"),
        ({"dicom_out": ""}, "dicom_out: a value is needed"),
        ({"slab": (None, 5)}, "slab must be a number"),
    ],
)
def test_write_refuses(head, tmp_path, options, message):
    with pytest.raises((OSError, ValueError), match=message) as caught:
        write(head, tmp_path / "x.png", **options)
    assert "/shear-warp-mip-" not in str(caught.value)
    assert not os.listdir(tmp_path)


@pytest.mark.parametrize("length", [1000, 100_000])
def test_full_folder_of_temporary_files(head, tmp_path, monkeypatch, length):
    resource = pytest.importorskip("resource")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    series = itk_shearwarpmip.turn(head, frames=20)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (length, limits[1]))
    try:
        for save, what in ((series.save, "turn"), (functools.partial(write, head), "source")):
            with pytest.raises(OSError) as caught:
                save(tmp_path / "x.html")
            assert (
                str(caught.value) == f"the {what} needs more room than '{tmp_path}' has: set TMPDIR to another folder"
            )
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not os.listdir(tmp_path)


def test_nothing_is_left(head, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    write(head, tmp_path / "a.png")
    with pytest.raises(ValueError):
        write(head, tmp_path / "b.png", frames=0)
    itk_shearwarpmip.turn(head, frames=2)._repr_html_()
    assert os.listdir(tmp_path) == ["a.png"]


def test_no_source_is_overwritten(head, tmp_path, monkeypatch):
    """Also from another folder, and through images of a mask and an overlay."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.nrrd", "b.nrrd", "c.nrrd"):
        itk.imwrite(head, name)
    image, mask, overlay = (open_image(name) for name in ("a.nrrd", "b.nrrd", "c.nrrd"))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path / "sub")
    with pytest.raises(OSError, match="cannot write"):
        write(image, "../a.nrrd")
    with pytest.raises(OSError, match="cannot write"):
        write(image, "../b.nrrd", mask=mask)
    with pytest.raises(OSError, match="cannot write"):
        write(image, "x.png", overlay=overlay, depth="../c.nrrd")
    with pytest.raises(OSError, match="cannot write"):
        itk_shearwarpmip.turn(image, frames=2, mask=mask).save("../b.nrrd")
    assert all(path.read_bytes() == voxels for path, voxels in before.items())


def test_frames_are_no_volume(head, tmp_path):
    write(head, tmp_path / "turn.nrrd", frames=3)
    with pytest.raises(ValueError, match=r"has frames of projections, and is no volume: write\(\) makes pictures"):
        open_image(tmp_path / "turn.nrrd")
    with pytest.raises(ValueError, match="has frames of projections, and is no volume"):
        write(head, tmp_path / "x.png", overlay=tmp_path / "turn.nrrd")


@pytest.mark.parametrize("name", ["mask", "overlay", "segments"])
def test_what_is_no_volume_is_named(head, tmp_path, name):
    with pytest.raises(TypeError, match=f"^{name}: a volume is the path"):
        write(head, tmp_path / "x.png", **{name: [[1]]})


def test_turn_is_a_sequence_of_pictures(turn):
    assert len(turn) == FRAMES
    assert_array_equal(np.asarray(turn), turn.frames)
    assert np.asarray(turn, np.float64).dtype == np.float64
    copied = np.array(turn)
    copied[:] = 7
    assert not (np.asarray(turn) == 7).all()
    with pytest.raises(TypeError, match=r"but this is a itk_shearwarpmip\._front\.Turn"):
        mip(turn)


def test_write_has_the_values_of_mip(head, tmp_path):
    center = np.array(list(itk.ShearWarpMIPView.GetCenter(head)))
    options = {"mode": "absolute_maximum", "crop": (center - np.array([9, 8, 7]), center + np.array([9, 6, 5]))}
    write(head, tmp_path / "x.nrrd", **options)
    assert_array_equal(itk.array_from_image(itk.imread(tmp_path / "x.nrrd")), mip(head, **options))


def test_lengths_are_in_the_unit_of_the_source(tmp_path, rng):
    voxels = rng.integers(0, 999, (10, 20, 30)).astype(np.uint16)
    image = open_image(voxels, spacing=(1.0, 1.0, 2.0))
    _entries.put(image, "Unit", "um")
    options = {"slab": (-5, 5), "output_spacing": 1.0}
    write(image, tmp_path / "x.nrrd", **options)
    assert_array_equal(itk.array_from_image(itk.imread(tmp_path / "x.nrrd")), mip(image, **options))


@needs_proc
def test_interrupt_ends_the_program(tmp_path):
    """By the signal that Ctrl-C sends, to Python alone."""
    code = f"""
{HEED_INTERRUPTS}
import itk, numpy as np
from itk_shearwarpmip import write
write(np.ones((200, 200, 200), np.int16), {str(tmp_path / "x.nrrd")!r}, exact=True, frames=500)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    children = Path(f"/proc/{child.pid}/task/{child.pid}/children")
    while child.poll() is None and not children.read_text():
        time.sleep(0.1)
    program = Path(f"/proc/{children.read_text().split()[0]}")
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=60)
    assert child.returncode != 0 and "KeyboardInterrupt" in said
    assert not os.listdir(tmp_path) and not program.exists()


def test_pages_hold_the_pixels(rng):
    image = itk.image_from_array(rng.integers(0, 200, (9, 10, 11), np.uint8))
    turn = make_turn(image)
    series = read_series(_write.make_page(turn))
    assert series["slope"] == 1.0
    stored = np.array([read_png(base64.b64decode(text)) for text in series["frames"]]).astype(int)
    assert_array_equal(np.where(stored == 0, 0, stored + series["intercept"]), turn.frames)

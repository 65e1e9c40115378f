"""Letters, angles and scale bars of pictures."""

import io
from pathlib import Path

import itk
import numpy as np
import pytest
from itk_shearwarpmip import _labels, mip, open_image, save_png
from numpy.testing import assert_array_equal
from PIL import Image


def turned(axis, degrees):
    angle = np.radians(degrees)
    direction = [0.0, 0.0, 0.0]
    direction[axis], direction[(axis + 1) % 3] = np.cos(angle), np.sin(angle)
    return direction


@pytest.mark.parametrize(
    "direction, letters",
    [
        ((1, 0, 0), "L"),
        ((-3, 0, 0), "R"),
        ((0, 1, 0), "P"),
        ((0, -1, 0), "A"),
        ((0, 0, 1), "H"),
        ((0, 0, -0.2), "F"),
        (turned(0, 22.4), "L"),
        (turned(0, 22.5), "LP"),
        (turned(0, 44.9), "LP"),
        (turned(0, 45), "LP"),
        (turned(0, 45.1), "PL"),
        (turned(0, 135), "RP"),
        (turned(1, 45), "PH"),
        (turned(2, 225), "RF"),
        ((1, 1, 1), "LP"),
        ((-0.5, 0.6, -0.62), "FP"),
        ((1e-17, -1, 1e-17), "A"),
    ],
)
def test_letters_of_directions(direction, letters):
    assert _labels.find_letters(np.array(direction)) == letters
    opposite = letters.translate(str.maketrans("LRAPHF", "RLPAFH"))
    assert _labels.find_letters(-np.array(direction)) == opposite


@pytest.mark.parametrize(
    "most, length", [(1, 1), (0.999, 0.5), (4.9999, 2), (5 - 1e-12, 5), (75, 50), (100, 100), (0.0021, 0.002)]
)
def test_lengths_are_round(most, length):
    assert _labels.round_length(most) == pytest.approx(length)


@pytest.mark.parametrize(
    "length, text",
    [
        (100.0, "100 mm"),
        (0.1, "0.1 mm"),
        (0.05, "50 µm"),
        (0.01, "10 µm"),
        (0.0001, "0.1 µm"),
        (5e-5, "50 nm"),
        (2e-7, "0.2 nm"),
    ],
)
def test_lengths_below_a_tenth_have_the_smaller_unit(length, text):
    assert _labels.format_length(length) == text


@pytest.fixture
def head():
    """Oblique, and large enough for letters."""
    voxels = np.random.default_rng(3).integers(0, 1000, (40, 50, 60), np.int16)
    return open_image(voxels, spacing=(1.5, 2, 2.5), direction=np.eye(3))


def read(path):
    return np.asarray(Image.open(path if isinstance(path, Path) else io.BytesIO(path)))


def has_letters(picture, tmp_path):
    """Whether there is something at the edges that options can leave out."""
    save_png(picture, tmp_path / "plain.png", labels=False)
    return (tmp_path / "plain.png").read_bytes() != picture._repr_png_()


def test_no_letters_without_a_direction(tmp_path):
    voxels = np.random.default_rng(3).integers(0, 1000, (60, 60, 60), np.int16)
    for image in (open_image(voxels), open_image(voxels, spacing=(1, 1, 2), origin=(3, 4, 5))):
        assert not has_letters(mip(image), tmp_path)
        assert has_letters(mip(open_image(image, direction=np.eye(3))), tmp_path)
    placed = itk.image_from_array(voxels)
    for source in (placed, open_image(itk.xarray_from_image(placed)), open_image(placed, spacing=(1, 2, 3))):
        assert has_letters(mip(source), tmp_path)


def test_letters_of_chunks(tmp_path):
    dask_array = pytest.importorskip("dask.array")
    chunked = dask_array.ones((60, 60, 60), dtype=np.uint8, chunks=30)
    assert not has_letters(mip(chunked), tmp_path)
    assert has_letters(mip(chunked, "inferior", direction=np.eye(3)), tmp_path)


def test_scale_bar_is_in_mm(head, tmp_path):
    source = itk.xarray_from_image(head)
    bars = {}
    for unit, factor in (("mm", 1.0), ("um", 1e3), ("µm", 1e3)):
        scaled = source.copy()
        for axis in "xyz":
            scaled = scaled.assign_coords({axis: source[axis] * factor})
            scaled[axis].attrs["units"] = unit
        save_png(mip(open_image(scaled)), tmp_path / "mip.png", annotate=True)
        bars[unit] = (tmp_path / "mip.png").read_bytes()
    assert bars["um"] == bars["µm"]
    assert_array_equal(read(bars["um"]), read(bars["mm"]))


def test_annotations_of_what_is_no_projection(tmp_path):
    with pytest.raises(ValueError, match="annotate is for a picture as mip"):
        save_png(itk.image_from_array(np.zeros((60, 60), np.uint8)), tmp_path / "x.png", annotate=True)
    assert not list(tmp_path.iterdir())

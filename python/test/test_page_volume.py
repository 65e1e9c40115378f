"""A page that holds the volume: its voxels, where they are, and what the package hands on."""

import base64
import gzip
import json
import re

import itk
import numpy as np
import pytest
from itk_shearwarpmip import mip, turn, write
from numpy.testing import assert_allclose, assert_array_equal
from samples import make_rotation


@pytest.fixture(autouse=True, scope="module")
def engine(tmp_path_factory):
    try:
        path = tmp_path_factory.mktemp("probe") / "page.html"
        write(np.ones((4, 4, 4), np.int16), path, page_volume=True, labels=False)
    except ValueError as error:
        if "this build has no engine" in str(error):
            pytest.skip(str(error))
        raise


@pytest.fixture
def sheared(rng):
    """Anisotropic, oblique and sheared: thin bright lines in noise."""
    array = rng.integers(1, 200, (20, 30, 46), np.uint16)
    array[:, 11, 17] = array[7, :, 29] = 4000
    rotation = itk.array_from_matrix(make_rotation(0.3, -0.2, 0.5).GetMatrix())
    matrix = rotation @ [[1, 0.1, 0.2], [0, 1, -0.1], [0, 0, 1]] @ np.diag([0.5, 0.7, 1.1])
    return place(array, np.column_stack([matrix, (-20.0, 31.0, 7.5)]))


def place(array, matrix):
    image = itk.image_from_array(np.ascontiguousarray(array))
    spacing = np.linalg.norm(matrix[:, :3], axis=0)
    image.SetSpacing(spacing)
    image.SetDirection(matrix[:, :3] / spacing)
    image.SetOrigin(matrix[:, 3])
    return image


def get_matrix(image):
    """From the index of a voxel to mm."""
    axes = itk.array_from_matrix(image.GetDirection()) * np.array(image.GetSpacing())
    return np.column_stack([axes, image.GetOrigin()])


def read_page(path):
    """The description in a page, and the stored voxels."""
    page = path.read_text(encoding="utf-8")
    text = {name: re.search(rf'id="{name}">(.*?)</script>', page, re.DOTALL)[1] for name in ("series", "voxels")}
    series = json.loads(text["series"])
    planes = np.frombuffer(gzip.decompress(base64.b64decode(text["voxels"])), np.uint8)
    planes = planes.reshape(series["bits"] // 8, *reversed(series["volume"]["size"])).astype(np.uint16)
    stored = sum(plane << 8 * n for n, plane in enumerate(planes))
    assert stored.min() >= 1
    return series, stored


def make_blocks(image, factors, combine):
    """One voxel of each block, which may have fewer voxels at the end."""
    array = itk.array_view_from_image(image).astype(float)
    steps = factors[::-1]
    padded = np.pad(array, [(0, -n % step) for n, step in zip(array.shape, steps, strict=True)], constant_values=np.nan)
    shape = [length for n, step in zip(padded.shape, steps, strict=True) for length in (n // step, step)]
    blocks = np.floor(0.5 + combine(padded.reshape(shape), axis=(1, 3, 5))).astype(array.dtype)
    matrix = get_matrix(image)
    middle = (np.array(factors) - 1) / 2
    return place(
        blocks.astype(itk.array_view_from_image(image).dtype),
        np.column_stack([matrix[:, :3] * factors, matrix[:, 3] + matrix[:, :3] @ middle]),
    )


@pytest.mark.parametrize("mode", ["maximum", "minimum", "mean"])
def test_page_shows_what_mip_shows_of_blocks(sheared, mode, tmp_path):
    write(sheared, tmp_path / "page.html", page_volume=True, page_volume_size=12, page_bits=16, mode=mode)
    series, stored = read_page(tmp_path / "page.html")
    combine = {"maximum": np.nanmax, "minimum": np.nanmin, "mean": np.nanmean}[mode]
    # of 46 x 30 x 20 voxels
    expected = make_blocks(sheared, (5, 3, 2), combine)
    values = series["intercept"] + series["slope"] * stored
    assert_array_equal(values, itk.array_view_from_image(expected))
    matrix = np.array(series["volume"]["toPhysical"])
    assert_allclose(matrix, get_matrix(expected), rtol=1e-12, atol=1e-12)
    assert_allclose(series["volume"]["whole"]["toPhysical"], get_matrix(sheared), rtol=1e-12, atol=1e-12)
    assert series["volume"]["mode"] == mode
    view = np.vstack([series["volume"]["view"], [0, 0, 0, 1]])
    grid = {"size": (60, 50), "output_spacing": 0.5, "output_origin": (-15.0, -12.5), "mode": mode}
    shown = mip(place(values.astype(np.uint16), matrix), view=view, **grid)
    assert_array_equal(shown, mip(expected, view=view, **grid))


def test_bright_voxel_stays_within_half_a_block(sheared, tmp_path):
    index = 34, 14, 8
    sheared.SetPixel(index, 9999)
    write(sheared, tmp_path / "page.html", page_volume=True, page_volume_size=7, page_bits=16)
    series, stored = read_page(tmp_path / "page.html")
    matrix = np.array(series["volume"]["toPhysical"])
    found = np.unravel_index(np.argmax(stored), stored.shape)[::-1]
    point = matrix[:, :3] @ found + matrix[:, 3]
    expected = np.array(sheared.TransformIndexToPhysicalPoint(index))
    in_blocks = np.linalg.solve(matrix[:, :3], expected - point)
    assert np.abs(in_blocks).max() <= 0.5
    assert np.abs(in_blocks).max() > 0.1


def test_all_options_are_handed_on(sheared, tmp_path):
    path = tmp_path / "page.html"
    write(sheared, path, page_volume=False)
    assert "volume" not in read_series(path)
    options = {"slab": (-2, 3), "exact": True, "mode": "minimum", "title": "Vessels", "labels": False}
    array = itk.array_from_image(sheared)
    write(array, path, page_volume=True, page_volume_size="full", spacing=(0.5, 0.7, 1.1), **options)
    series, stored = read_page(path)
    assert stored.shape == (20, 30, 46)
    volume = series["volume"]
    assert (volume["slab"], volume["exact"], volume["mode"], series["title"]) == ([-2, 3], True, "minimum", "Vessels")
    assert volume["hasOrientation"] is False
    assert volume["command"] == ["shear-warp-mip", "INPUT"]
    page = path.read_text(encoding="utf-8")
    assert "shear-warp-mip-" not in page and tmp_path.name not in page


def read_series(path):
    return json.loads(re.search(r'id="series">(.*?)</script>', path.read_text(encoding="utf-8"), re.DOTALL)[1])


@pytest.mark.parametrize(
    "options, message",
    [
        ({"frames": 3}, "frames excludes page_volume|page_volume excludes frames"),
        ({"mode": "absolute_maximum"}, "page_volume is not possible with mode absolute-maximum"),
        ({"page_volume_size": 0}, "page_volume_size: '0' is not a whole number from 1 to 65535, nor full"),
        ({"page_volume": 1}, "page_volume must be True or False"),
    ],
)
def test_wrong_options_are_refused(sheared, options, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write(sheared, tmp_path / "page.html", **({"page_volume": True} | options))
    assert not (tmp_path / "page.html").exists()


def test_turn_is_no_volume(sheared, tmp_path):
    with pytest.raises(ValueError, match=r"page_volume is not possible: .* has frames, which are not projected again"):
        turn(sheared, frames=2).save(tmp_path / "page.html", page_volume=True)

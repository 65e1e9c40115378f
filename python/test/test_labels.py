"""Letters, angles and scale bars of pictures."""

import io
import itertools
import shutil
import subprocess
from pathlib import Path

import itk
import numpy as np
import pytest
from itk_shearwarpmip import _entries, _labels, mip, open_image, save_png, turn
from numpy.testing import assert_array_equal
from PIL import Image, ImageDraw
from program import NO_LABELS, PROGRAM
from samples import make_rotation

SIDES = "left", "right", "top", "bottom"


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
    "view, azimuth, elevation, expected",
    [
        ("anterior", 0, 0, "R L H F"),
        ("posterior", 0, 0, "L R H F"),
        ("left", 0, 0, "A P H F"),
        ("right", 0, 0, "P A H F"),
        ("superior", 0, 0, "L R A P"),
        ("inferior", 0, 0, "R L A P"),
        ("anterior", 30, 0, "RA LP H F"),
        ("anterior", -60, 0, "PR AL H F"),
        ("anterior", 0, 40, "R L HP FA"),
        ("anterior", 45, 0, "RA LP H F"),
        ("left", 20, 0, "A P H F"),
    ],
)
def test_letters_of_views(view, azimuth, elevation, expected, image):
    image.SetDirection(itk.matrix_from_array(np.eye(3)))
    picture = mip(image, view, azimuth=azimuth, elevation=elevation)
    assert list(_labels.find_sides(_entries.get_view(picture)).values()) == expected.split()


# all signed permutations of axes, and one that is none
DIRECTIONS = [
    np.diag(signs)[list(order)]
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1, -1), repeat=3)
]
DIRECTIONS.append(itk.array_from_matrix(make_rotation(0.3, -0.2, 0.5).GetMatrix()))


@pytest.mark.parametrize("direction", DIRECTIONS, ids=[str(n) for n in range(49)])
def test_the_letter_is_where_the_side_is(direction):
    """A ball at the patient's left, behind or at the head is nearer to the edge with that letter."""
    voxels = np.zeros((15, 15, 15), np.uint8)
    center = np.array([7.0, 7.0, 7.0])
    for axis, letter in enumerate("LPH"):
        ball = np.eye(3)[axis] * 6
        index = np.rint(np.linalg.inv(direction) @ ball + center).astype(int)
        voxels[:] = 0
        voxels[tuple(index[::-1])] = 200
        image = open_image(voxels, direction=direction, origin=(5, 6, 7))
        for view, azimuth, elevation in (("anterior", 0, 0), ("left", 0, 0), ("inferior", 0, 0), ("posterior", 35, 20)):
            picture = mip(image, view, azimuth=azimuth, elevation=elevation)
            row, column = (np.array(found).mean() for found in np.nonzero(np.asarray(picture) > 20))
            rows, columns = picture.shape
            beyond = {"right": column - (columns - 1) / 2, "bottom": row - (rows - 1) / 2}
            sides = _labels.find_sides(_entries.get_view(picture))
            for side, distance in beyond.items():
                if letter in sides[side]:
                    assert distance > 1
                elif letter in sides["left" if side == "right" else "top"]:
                    assert distance < -1


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


@pytest.fixture
def written(monkeypatch):
    """The texts that are drawn, with the part of the picture where they are anchored."""
    texts = []
    draw = ImageDraw.ImageDraw.text

    def text(self, place, text, *arguments, **options):
        texts.append((text, tuple(round(3 * n / length) for n, length in zip(place, self.im.size))))
        draw(self, place, text, *arguments, **options)

    monkeypatch.setattr(ImageDraw.ImageDraw, "text", text)
    return texts


def read(path):
    return np.asarray(Image.open(path if isinstance(path, Path) else io.BytesIO(path)))


def test_letters_are_drawn_at_the_edges(head, tmp_path, written):
    picture = mip(head, azimuth=30)
    save_png(picture, tmp_path / "plain.png", labels=False)
    assert not written
    save_png(picture, tmp_path / "labels.png")
    assert written == [("RA", (0, 2)), ("LP", (3, 2)), ("H", (2, 0)), ("F", (2, 3))]
    plain, labels = (read(tmp_path / f"{name}.png") for name in ("plain", "labels"))
    rows, columns = np.nonzero(plain != labels)
    height, width = plain.shape
    margin = 32
    assert rows.size and plain.dtype == labels.dtype == np.uint8
    is_inside = (rows > margin) & (rows < height - margin) & (columns > margin) & (columns < width - margin)
    assert not is_inside.any()
    assert read(picture._repr_png_()).tolist() == labels.tolist()
    with pytest.raises(TypeError):
        save_png(picture, tmp_path / "labels.png", letters=False)


@pytest.mark.parametrize("level", [0, 255])
def test_letters_are_seen_on_black_and_white(level):
    grey = np.full((100, 120), level, np.uint8)
    drawn = _labels.draw(grey, np.eye(4), 1.0, has_sides=True, has_scale=True)
    assert (grey == level).all()
    sides = drawn[40:60, :20], drawn[40:60, -20:], drawn[:20, 50:70], drawn[-20:, 50:70]
    angles, scale = drawn[:30, :40], drawn[-15:, :40]
    for part in (*sides, angles, scale):
        assert part.min() < 60 and part.max() > 230


def test_no_letters_without_a_direction(written):
    voxels = np.random.default_rng(3).integers(0, 1000, (60, 60, 60), np.int16)
    for image in (open_image(voxels), open_image(voxels, spacing=(1, 1, 2), origin=(3, 4, 5))):
        mip(image)._repr_png_()
        assert not written
        mip(open_image(image, direction=np.eye(3)))._repr_png_()
        assert [text for text, _ in written] == ["R", "L", "H", "F"]
        written.clear()
    placed = itk.image_from_array(voxels)
    for source in (placed, open_image(itk.xarray_from_image(placed)), open_image(placed, spacing=(1, 2, 3))):
        mip(source)._repr_png_()
        assert [text for text, _ in written] == ["R", "L", "H", "F"]
        written.clear()


def test_letters_of_chunks(written):
    dask_array = pytest.importorskip("dask.array")
    chunked = dask_array.ones((60, 60, 60), dtype=np.uint8, chunks=30)
    mip(chunked)._repr_png_()
    assert not written
    mip(chunked, "inferior", direction=np.eye(3))._repr_png_()
    assert [text for text, _ in written] == ["R", "L", "A", "P"]


def test_small_pictures_have_no_room(head, written):
    for size, count in (((47, 90), 0), ((90, 47), 0), ((48, 48), 4)):
        mip(head, size=size)._repr_png_()
        assert len(written) == count


@pytest.mark.parametrize(
    "view, azimuth, elevation, expected",
    [
        ("anterior", 0, 0, ["LAO 0", "CRA 0"]),
        ("anterior", 30, 12.34, ["LAO 30", "CRA 12.3"]),
        ("anterior", -30.06, -15, ["RAO 30.1", "CAU 15"]),
        ("left", 0, 0, ["LAO 90", "CRA 0"]),
        ("posterior", -40, 0, ["140°", "CRA 0"]),
        ("right", 20.5, 0, ["RAO 69.5", "CRA 0"]),
        ("superior", 0, 0, ["LAO 0", "CRA 90"]),
        ("inferior", 0, 0, ["LAO 0", "CAU 90"]),
    ],
)
def test_angles(view, azimuth, elevation, expected, head):
    matrix = _entries.get_view(mip(head, view, azimuth=azimuth, elevation=elevation))
    assert _labels.describe_angles(matrix) == expected


@pytest.mark.parametrize("spacing, scale, text", [(0.5, 1.0, "50 mm"), (0.11, 1.0, "10 mm"), (0.5, 2.0, "100 mm")])
def test_scale_bar_is_as_long_as_it_says(spacing, scale, text, head, tmp_path, written):
    """`scale` is mm in the patient for one in the view."""
    matrix = np.diag([scale, scale, scale, 1.0])
    picture = mip(head, matrix, size=(400, 300), output_spacing=spacing, slab=(-1e4, 1e4))
    save_png(picture, tmp_path / "mip.png", window=(1e5, 2e5), labels=False, annotate=True)
    assert text in [each for each, _ in written]
    pixels = read(tmp_path / "mip.png")
    rows = pixels[280:, :200]
    longest = max(len(run) for row in rows for run in "".join("#" if n > 200 else " " for n in row).split())
    assert longest == pytest.approx(float(text.split()[0]) / spacing / scale, abs=2)


def test_scale_bar_is_in_mm_or_micrometres(head, tmp_path, written):
    source = itk.xarray_from_image(head)
    for unit, text in (("mm", "20 mm"), ("micrometer", "20 µm"), ("µm", "20 µm"), ("m", "20000 mm")):
        for axis in "xyz":
            source[axis].attrs["units"] = unit
        save_png(mip(open_image(source), output_spacing=0.5), tmp_path / "mip.png", annotate=True)
        assert text in [each for each, _ in written]
        written.clear()


def test_annotations_of_what_is_no_projection(tmp_path):
    with pytest.raises(ValueError, match="annotate is for a picture as mip"):
        save_png(itk.image_from_array(np.zeros((60, 60), np.uint8)), tmp_path / "x.png", annotate=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [{}, {"labels": False}, {"annotate": True}])
def test_each_frame_has_its_letters(head, tmp_path, options):
    series = turn(head, frames=4)
    series.save(tmp_path / "turn.png", **options)
    grid = {"size": series.frames.shape[:0:-1], "output_origin": list(series.frames.GetOrigin())[:2]}
    for n, transform in enumerate(series.transforms):
        save_png(mip(head, transform, **grid), tmp_path / "mip.png", window=series.window, **options)
        assert_array_equal(read(tmp_path / f"turn-00{n}.png"), read(tmp_path / "mip.png"))


@pytest.mark.parametrize("suffix", [".gif", ".apng", ".mp4", ".nrrd", ".nii.gz", ""])
def test_letters_are_for_eyes(head, tmp_path, suffix):
    if suffix in (".gif", ".apng", ".mp4") and not shutil.which("ffmpeg"):
        pytest.skip("ffmpeg is not installed")
    series = turn(head, frames=3)
    found = []
    for n, options in enumerate(({}, {"labels": False})):
        path = tmp_path / f"turn{n}{suffix}"
        series.save(path, **options)
        if suffix in (".gif", ".apng", ".mp4"):
            command = ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
            found.append(subprocess.run(command, check=True, capture_output=True).stdout)
        elif suffix:
            found.append(np.asarray(itk.imread(str(path))).tobytes())
        else:
            found.append(b"".join(np.asarray(itk.imread(str(each))).tobytes() for each in sorted(path.iterdir())))
    assert (found[0] != found[1]) == (suffix in (".gif", ".apng", ".mp4"))


@pytest.mark.skipif(not PROGRAM, reason="needs the program shear-warp-mip")
def test_large_pictures_are_the_programs(head, tmp_path):
    itk.imwrite(head, str(tmp_path / "head.nrrd"))
    subprocess.run([PROGRAM, tmp_path / "head.nrrd", tmp_path / "p.png", *NO_LABELS], check=True, capture_output=True)
    save_png(mip(tmp_path / "head.nrrd"), tmp_path / "mip.png", labels=False)
    assert_array_equal(read(tmp_path / "mip.png"), read(tmp_path / "p.png"))

"""DICOM folders in Python, by the rules of the program."""

import subprocess

import itk
import numpy as np
import pytest
from conftest import PROGRAM
from itk_shearwarpmip import mip, open_image

ROW, COLUMN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.8, 0.6])
NORMAL = np.cross(ROW, COLUMN)
VOXELS = 2 * np.random.default_rng(7).integers(-250, 450, (6, 10, 12), np.int16)


def write_slice(path, pixels, position, uid="1.2.3.4", orientation=(ROW, COLUMN), **entries):
    """One file; entries are tags without the bar."""
    image = itk.image_from_array(pixels[np.newaxis])
    image.SetSpacing([0.5, 0.75, 2.5])
    image.SetOrigin(position)
    image.SetDirection(itk.matrix_from_array(np.column_stack([*orientation, np.cross(*orientation)])))
    entries = {"t0020000e": uid, "t0020000d": "1.2.3", "t00080060": "CT"} | entries
    dictionary = image.GetMetaDataDictionary()
    for tag, value in entries.items():
        dictionary[f"{tag[1:5]}|{tag[5:]}"] = value
    image.SetMetaDataDictionary(dictionary)
    writer = itk.ImageFileWriter.New(image, FileName=str(path))
    writer.SetImageIO(itk.GDCMImageIO.New(KeepOriginalUID=True))
    writer.Update()


def write_series(folder, positions=None, step=NORMAL, **entries):
    """Slices in an order that names do not tell."""
    positions = 2.5 * np.arange(len(VOXELS)) if positions is None else np.array(positions)
    folder.mkdir(exist_ok=True)
    for n, position in enumerate(positions):
        place = np.array([-10.0, 20.0, 30.0]) + position * step
        write_slice(folder / f"{(n * 5) % 7}-{entries.get('uid', '')}.dcm", VOXELS[n], place.tolist(), **entries)
    return folder


def assert_as_the_program(folder, tmp_path, *options, **keywords):
    picture = mip(folder, azimuth=30, output_spacing=0.5, **keywords)
    if PROGRAM:
        output = tmp_path / "mip.mha"
        command = [PROGRAM, folder, output, "--azimuth=30", "--spacing=0.5", *options]
        subprocess.run(command, check=True, capture_output=True)
        expected = itk.imread(str(output))
        assert np.asarray(picture).tobytes() == np.asarray(expected).tobytes()
    return picture


def test_slices_lie_where_they_say(tmp_path):
    folder = write_series(tmp_path / "series")
    (folder / "note.txt").write_text("text")
    (folder / ".hidden").write_bytes(b"\0\1")
    (folder / "folder").mkdir()
    image = open_image(folder)
    np.testing.assert_array_equal(itk.array_view_from_image(image), VOXELS)
    assert list(image.GetSpacing()) == pytest.approx([0.5, 0.75, 2.5])
    assert list(image.GetOrigin()) == [-10, 20, 30]
    assert np.allclose(itk.array_from_matrix(image.GetDirection()), np.column_stack([ROW, COLUMN, NORMAL]))
    assert image["0020|000e"].strip("\0 ") == "1.2.3.4"
    assert_as_the_program(folder, tmp_path)


def test_a_tilted_gantry_makes_a_sheared_image(tmp_path):
    step = NORMAL + 0.2 * COLUMN
    folder = write_series(tmp_path / "series", step=step)
    image = open_image(folder)
    assert np.allclose(list(image.TransformIndexToPhysicalPoint([0, 0, 4])), [-10, 20, 30] + 10 * step, atol=1e-4)
    assert_as_the_program(folder, tmp_path)


def test_several_series_are_listed(tmp_path):
    folder = write_series(tmp_path / "series")
    write_series(folder, uid="1.2.3.5", positions=[0, 2.5, 5])
    with pytest.raises(ValueError, match=r"several DICOM series, .* series=: 1.2.3.4 \(6 files\), 1.2.3.5 \(3 files\)"):
        mip(folder)
    with pytest.raises(ValueError, match=r"series 1.2 is not in .*, which has 1.2.3.4"):
        mip(folder, series="1.2")
    assert open_image(folder, series="1.2.3.5").shape == (3, 10, 12)
    assert_as_the_program(folder, tmp_path, "--series=1.2.3.5", series="1.2.3.5")


def replace_bytes(path, old, new):
    whole = path.read_bytes()
    assert len(old) == len(new) and whole.count(old) == 1
    path.write_bytes(whole.replace(old, new))


def test_each_slice_has_its_own_rescaling(tmp_path):
    folder = write_series(tmp_path / "series", t00281053="2", t00281052="0")
    np.testing.assert_array_equal(np.asarray(open_image(folder)), VOXELS)
    # the first slice
    replace_bytes(folder / "0-.dcm", b"\x53\x10\x02\x00\x00\x002 ", b"\x53\x10\x02\x00\x00\x00.5")
    voxels = np.asarray(open_image(folder))
    assert voxels.dtype == np.float64
    np.testing.assert_array_equal(voxels, [0.25 * VOXELS[0], *VOXELS[1:]])
    assert_as_the_program(folder, tmp_path)


@pytest.mark.parametrize(
    "positions, text",
    [
        ([0, 2.5, 7.5, 10], "a slice is missing between"),
        ([0, 2.5, 2.5, 5], "two slices lie at one position"),
        ([0, 2.5, 2.5001, 5], "two slices lie at one position"),
    ],
)
def test_slices_that_make_no_volume(positions, text, tmp_path):
    with pytest.raises(ValueError, match=text):
        mip(write_series(tmp_path / "series", positions))


def test_slices_that_are_not_alike(tmp_path):
    folder = write_series(tmp_path / "series")
    for text, pixels, options in (
        ("orientation", VOXELS[0], {"orientation": (ROW, np.array([0.0, 1.0, 0.0]))}),
        ("size", VOXELS[0, :5], {}),
    ):
        write_slice(folder / "other.dcm", pixels, ([-10, 20, 30] + 15 * NORMAL).tolist(), **options)
        with pytest.raises(ValueError, match=f"are of one series, but differ in {text}"):
            mip(folder)


def test_uneven_slices_and_single_ones_are_said(tmp_path):
    folder = write_series(tmp_path / "series", [0, 2.5, 5.3, 7.5])
    with pytest.warns(UserWarning, match="the slices are not evenly spaced"):
        assert_as_the_program(folder, tmp_path)
    (alone,) = write_series(tmp_path / "alone", [0]).iterdir()
    with pytest.warns(UserWarning, match="has only one slice; for a whole series give its folder"):
        assert open_image(alone).shape == (1, 10, 12)


def test_other_files_in_the_folder(tmp_path):
    folder = write_series(tmp_path / "series")
    (folder / "thumbnail.db").write_bytes(b"\0\1\2")
    with pytest.warns(UserWarning, match=r"thumbnail\.db' is not DICOM and left out"):
        assert_as_the_program(folder, tmp_path)
    (folder / "damaged.dcm").write_bytes(b"\0\1\2")
    with pytest.raises(OSError, match=r"damaged\.dcm' is damaged or incomplete"):
        mip(folder)
    (folder / "damaged.dcm").unlink()
    (folder / "link.dcm").symlink_to(folder / "nowhere")
    with pytest.raises(OSError, match="is no file or a link to nothing"):
        mip(folder)


def test_a_slice_that_is_cut_short(tmp_path):
    folder = write_series(tmp_path / "series")
    path = folder / "4-.dcm"
    whole = path.read_bytes()
    for length in (len(whole) - 2, len(whole) - VOXELS[0].nbytes // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(OSError, match="cannot be read"):
            mip(folder)
    # it might be another object
    path.write_bytes(whole[:300])
    with pytest.warns(UserWarning, match="has no image and is left out"):
        mip(folder)


def test_inverted_values_are_refused(tmp_path):
    folder = write_series(tmp_path / "series")
    for path in folder.iterdir():
        replace_bytes(path, b"MONOCHROME2", b"MONOCHROME1")
    with pytest.raises(ValueError, match="is MONOCHROME1, whose values ITK inverts"):
        mip(folder)

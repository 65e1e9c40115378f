"""DICOM in Python: what the program hands over. Its rules are tested where it is."""

import shutil
import subprocess

import itk
import numpy as np
import pydicom
import pytest
from itk_shearwarpmip import mip, open_image, save_png, turn
from numpy.testing import assert_array_equal
from program import NO_LABELS, PROGRAM
from pydicom.data import get_testdata_file

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
    folder.mkdir(exist_ok=True, parents=True)
    for n, position in enumerate(positions):
        place = np.array([-10.0, 20.0, 30.0]) + position * step
        write_slice(folder / f"{(n * 5) % 7}-{entries.get('uid', '')}.dcm", VOXELS[n], place.tolist(), **entries)
    return folder


def assert_as_the_program(folder, tmp_path, *options, **keywords):
    picture = mip(folder, azimuth=30, output_spacing=0.5, **keywords)
    if PROGRAM:
        output = tmp_path / "mip.mha"
        command = [PROGRAM, folder, output, "--azimuth=30", "--output-spacing=0.5", *options]
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
    assert_array_equal(image, VOXELS)
    assert list(image.GetSpacing()) == pytest.approx([0.5, 0.75, 2.5])
    assert list(image.GetOrigin()) == [-10, 20, 30]
    assert np.allclose(itk.array_from_matrix(image.GetDirection()), np.column_stack([ROW, COLUMN, NORMAL]))
    assert image["0020|000e"].strip("\0 ") == "1.2.3.4"
    assert_as_the_program(folder, tmp_path)


def test_attributes_of_any_character_set(tmp_path):
    folder = write_series(tmp_path / "series")
    for path in folder.iterdir():
        dataset = pydicom.dcmread(path)
        dataset.SpecificCharacterSet, dataset.PatientName = "ISO_IR 100", "Müller^Jürgen"
        dataset.StudyDescription = "a:=b \\n"
        dataset.save_as(path)
    image = open_image(folder)
    assert image["0010|0010"].rstrip() == "Müller^Jürgen"
    assert image["0008|1030"].rstrip() == "a:=b \\n"
    for path in folder.iterdir():
        replace_bytes(path, b"ISO_IR 100", b"ISO_IR 999")
    assert open_image(folder)["0010|0010"].startswith("M")


def test_a_tilted_gantry_makes_a_sheared_image(tmp_path):
    step = NORMAL + 0.2 * COLUMN
    folder = write_series(tmp_path / "series", step=step)
    image = open_image(folder)
    assert np.allclose(list(image.TransformIndexToPhysicalPoint([0, 0, 4])), [-10, 20, 30] + 10 * step, atol=1e-4)
    assert_as_the_program(folder, tmp_path)


def test_several_series_are_listed(tmp_path):
    day = {"t00080021": "20240131", "t00180050": "2.5"}
    folder = write_series(tmp_path / "series", t00200011="4", **day)
    write_series(folder, uid="1.2.3.5", positions=[0, 2.5, 5], t00200011="11", **day)
    write_series(
        folder / "disc" / "1", uid="1.2.3.3", positions=[0], t0008103e="Thorax", t00080021="20240201", t00180050="1"
    )
    listed = r"1: CT, 2024-01-31, 6 images; 2: CT, 2024-01-31, 3 images; 3: Thorax, CT, 2024-02-01, 1 image$"
    with pytest.raises(ValueError, match=r"has several DICOM series, choose one by series=NUMBER: " + listed):
        mip(folder)
    for wrong in ("1.2", "abdomen", 4):
        with pytest.raises(ValueError, match=rf"{wrong}.*{listed}"):
            mip(folder, series=wrong)
    for chosen in ("THORAX", 3, "3"):
        with pytest.warns(UserWarning, match="has only one slice"):
            assert open_image(folder, series=chosen).shape == (1, 10, 12)
    assert open_image(folder, series="1.2.3.5").shape == (3, 10, 12)
    assert_as_the_program(folder, tmp_path, "--series=1.2.3.5", series="1.2.3.5")


def replace_bytes(path, old, new):
    whole = path.read_bytes()
    assert len(old) == len(new) and whole.count(old) == 1
    path.write_bytes(whole.replace(old, new))


@pytest.mark.filterwarnings("ignore:left out")
def test_dicomdir_stands_for_its_folder(tmp_path):
    folder = write_series(tmp_path / "disc" / "series").parent
    (folder / "DICOMDIR").touch()
    image = open_image(folder / "DICOMDIR", series=1)
    assert_array_equal(image, VOXELS)


def test_other_files_in_the_folder(tmp_path):
    folder = write_series(tmp_path / "series")
    (folder / "disc").mkdir()
    for name in ("thumbnail.db", "viewer.exe"):
        (folder / name).write_bytes(b"\0\1\2")
    shutil.copy(folder / "0-.dcm", folder / "disc" / "copy.dcm")
    (folder / "disc" / "again").symlink_to(folder)
    write_slice(folder / "scout.dcm", VOXELS[0, :5], [0, 0, 0], t00080008="ORIGINAL\\PRIMARY\\LOCALIZER")
    with pytest.warns(UserWarning) as said:
        mip(folder)
    said = [each for each in said if each.category is UserWarning]
    assert [str(each.message).replace(str(folder), "") for each in said] == [
        "left out: '/thumbnail.db' and 1 more (not DICOM)",
        "left out: '/disc/copy.dcm' (the same as another file)",
        "left out: '/scout.dcm' (localizer)",
    ]
    assert {each.filename for each in said} == {__file__}
    with pytest.warns(UserWarning, match="left out"):
        assert_as_the_program(folder, tmp_path)
    (folder / "damaged.dcm").write_bytes(b"\0\1\2")
    with pytest.raises(OSError, match=r"damaged\.dcm' is damaged or incomplete"):
        mip(folder)
    (folder / "damaged.dcm").unlink()
    (folder / "link.dcm").symlink_to(folder / "nowhere")
    with pytest.raises(OSError, match="is a link to a file that is not there"):
        mip(folder)


def test_files_that_others_wrote(tmp_path):
    for name in ("rtdose.dcm", "rtdose_rle.dcm"):
        path = get_testdata_file(name)
        assert open_image(path).shape == (15, 10, 10)
        assert_as_the_program(path, tmp_path)
    for name, text in (
        ("rtdose_1frame.dcm", "is damaged or incomplete"),
        ("badVR.dcm", "has no valid slice thickness"),
        ("MR_truncated.dcm", "is damaged or incomplete"),
        ("test-SR.dcm", "is not a DICOM image"),
    ):
        with pytest.raises((OSError, ValueError), match=text) as caught:
            mip(get_testdata_file(name))
        # no line of the source file that found the error
        assert "xx:" not in str(caught.value) and "\n" not in str(caught.value)


def test_inverted_values_are_kept_and_shown_inverted(tmp_path):
    folder = write_series(tmp_path / "series")
    upright = mip(folder, azimuth=30)
    for path in folder.iterdir():
        replace_bytes(path, b"MONOCHROME2", b"MONOCHROME1")
    assert_array_equal(open_image(folder), VOXELS)
    picture = assert_as_the_program(folder, tmp_path)
    picture = mip(folder, azimuth=30)
    assert_array_equal(picture, upright)
    grey = {}
    for name, each in {"upright": upright, "inverted": picture}.items():
        save_png(each, tmp_path / f"{name}.png", labels=False)
        grey[name] = np.asarray(itk.imread(str(tmp_path / f"{name}.png")))
    assert_array_equal(grey["inverted"], 255 - grey["upright"])
    save_png(picture, tmp_path / "inverted.png")
    assert (tmp_path / "inverted.png").read_bytes() == picture._repr_png_()
    series = turn(folder, frames=2, azimuth=30)
    series.save(tmp_path / "turn.png", labels=False)
    series.save(tmp_path / "turn.html")
    series.save(tmp_path / "turn")
    assert '"inverted": true' in (tmp_path / "turn.html").read_text(encoding="utf-8")
    assert pydicom.dcmread(tmp_path / "turn" / "frame-001.dcm").PhotometricInterpretation == "MONOCHROME1"
    if PROGRAM:
        command = [PROGRAM, folder, tmp_path / "p.png", "--frames=2", "--azimuth=30", *NO_LABELS]
        subprocess.run(command, check=True, capture_output=True)
        for n in range(2):
            pictures = (np.asarray(itk.imread(str(tmp_path / f"{name}-00{n}.png"))) for name in ("p", "turn"))
            assert_array_equal(*pictures)
    replace_bytes(folder / "0-.dcm", b"MONOCHROME1", b"MONOCHROME2")
    with pytest.raises(ValueError, match="differ in photometric interpretation"):
        mip(folder)

"""DICOM folders in Python, by the rules of the program."""

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
from pydicom.dataset import Dataset
from pydicom.sequence import Sequence

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
    with pytest.raises(ValueError, match=r"has several DICOM series, choose one by series NUMBER: " + listed):
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


def test_each_slice_has_its_own_rescaling(tmp_path):
    folder = write_series(tmp_path / "series", t00281053="2", t00281052="0")
    assert_array_equal(open_image(folder), VOXELS)
    # the first slice
    replace_bytes(folder / "0-.dcm", b"\x53\x10\x02\x00\x00\x002 ", b"\x53\x10\x02\x00\x00\x00.5")
    voxels = np.asarray(open_image(folder))
    assert voxels.dtype == np.float64
    assert_array_equal(voxels, [0.25 * VOXELS[0], *VOXELS[1:]])
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
    (alone,) = write_series(tmp_path / "alone", [0], t00180050="2.5").iterdir()
    with pytest.warns(UserWarning, match="has only one slice; for a whole series give its folder"):
        assert open_image(alone).shape == (1, 10, 12)


@pytest.mark.filterwarnings("ignore:left out")
def test_dicomdir_stands_for_its_folder(tmp_path):
    folder = write_series(tmp_path / "disc" / "series").parent
    (folder / "DICOMDIR").touch()
    image = open_image(folder / "DICOMDIR", series=1)
    assert_array_equal(image, VOXELS)


def test_series_that_are_no_volume(tmp_path):
    folder = write_series(tmp_path / "series")
    turn(folder, frames=2).save(tmp_path / "turn")
    with pytest.raises(ValueError, match=r"001\.dcm' is a projection, not a part of a volume"):
        mip(tmp_path / "turn")
    for path in folder.iterdir():
        dataset = pydicom.dcmread(path)
        dataset.SOPClassUID = pydicom.uid.SegmentationStorage
        dataset.save_as(path)
    with pytest.raises(ValueError, match="is a DICOM segmentation"):
        mip(folder)


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


def test_a_slice_that_is_cut_short(tmp_path):
    folder = write_series(tmp_path / "series")
    path = folder / "4-.dcm"
    whole = path.read_bytes()
    for length in (len(whole) - 2, len(whole) - VOXELS[0].nbytes // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(OSError, match=r"4-\.dcm' is damaged or incomplete"):
            mip(folder)


@pytest.mark.parametrize("syntax", ["ImplicitVRLittleEndian", "ExplicitVRLittleEndian", "ExplicitVRBigEndian"])
def test_pixels_that_are_fewer_than_the_size_says(syntax, tmp_path):
    folder = write_series(tmp_path / "series")
    path = folder / "4-.dcm"
    dataset = pydicom.dcmread(path)
    little = "Little" in syntax
    pixels = dataset.pixel_array.astype("<i2" if little else ">i2").tobytes()
    dataset.file_meta.TransferSyntaxUID = getattr(pydicom.uid, syntax)

    def write(missing):
        dataset.PixelData = pixels[: len(pixels) - missing]
        pydicom.dcmwrite(
            path, dataset, implicit_vr=syntax.startswith("Impl"), little_endian=little, force_encoding=True
        )

    write(0)
    assert_array_equal(open_image(folder), VOXELS)
    for missing in (2, len(pixels) - 2):
        write(missing)
        for source in (folder, path):
            with pytest.raises(OSError, match=r"4-\.dcm' is damaged or incomplete"):
                mip(source)


def make_sequence(**values):
    item = Dataset()
    for name, value in values.items():
        setattr(item, name, value)
    return Sequence([item])


def write_frames(path, *, order=(0, 1, 2, 3, 4, 5), photometric="MONOCHROME2", rescales=None, **values):
    """Enhanced CT, its frames in this order along the normal."""
    dataset = Dataset()
    dataset.ensure_file_meta()
    dataset.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    dataset.SOPClassUID, dataset.SOPInstanceUID = pydicom.uid.EnhancedCTImageStorage, pydicom.uid.generate_uid()
    dataset.StudyInstanceUID, dataset.SeriesInstanceUID = "1.2.3", "1.2.3.4"
    dataset.Modality, dataset.PhotometricInterpretation, dataset.SamplesPerPixel = "CT", photometric, 1
    dataset.NumberOfFrames, dataset.Rows, dataset.Columns = VOXELS.shape
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = 16, 12, 11, 1
    dataset.PixelData = VOXELS.astype("<i2").tobytes()
    shared, frames = Dataset(), []
    shared.PlaneOrientationSequence = make_sequence(ImageOrientationPatient=[*ROW, *COLUMN])
    shared.PixelMeasuresSequence = make_sequence(PixelSpacing=[0.75, 0.5], SliceThickness=2.5)
    for n, place in enumerate(order):
        frame = Dataset()
        position = np.array([-10.0, 20.0, 30.0]) + 2.5 * place * NORMAL
        frame.PlanePositionSequence = make_sequence(ImagePositionPatient=position.tolist())
        if rescales:
            slope, intercept = rescales[n % len(rescales)]
            frame.PixelValueTransformationSequence = make_sequence(
                RescaleSlope=slope, RescaleIntercept=intercept, RescaleType="HU"
            )
        frames.append(frame)
    dataset.SharedFunctionalGroupsSequence = Sequence([shared])
    dataset.PerFrameFunctionalGroupsSequence = Sequence(frames)
    for name, value in values.items():
        setattr(dataset, name, value)
    pydicom.dcmwrite(path, dataset, enforce_file_format=True)
    return path


@pytest.mark.parametrize("photometric", ["MONOCHROME2", "MONOCHROME1"])
@pytest.mark.parametrize(
    "order, step",
    [(range(6), 2.5), (range(5, -1, -1), -2.5), ([3, 1, 0, 2, 5, 4], 2.5)],
    ids=["upward", "downward", "mixed"],
)
@pytest.mark.parametrize(
    "rescales, dtype",
    [(None, np.int16), ([(2, -1024)], np.int16), ([(0.5, 0), (2, 1)], np.float64)],
    ids=["stored", "whole", "each its own"],
)
def test_frames_lie_where_they_say(photometric, order, step, rescales, dtype, tmp_path):
    path = write_frames(tmp_path / "frames.dcm", order=order, photometric=photometric, rescales=rescales)
    image = open_image(path)
    slopes = np.array([(rescales or [(1, 0)])[n % len(rescales or "1")] for n in range(6)])
    expected = VOXELS * slopes[:, 0, None, None] + slopes[:, 1, None, None]
    expected = expected[np.argsort(order)][:: 1 if step > 0 else -1]
    assert np.asarray(image).dtype == dtype
    assert_array_equal(image, expected)
    assert list(image.GetSpacing()) == pytest.approx([0.5, 0.75, 2.5])
    assert np.allclose(itk.array_from_matrix(image.GetDirection())[:, 2], np.sign(step) * NORMAL)
    assert_as_the_program(path, tmp_path)


@pytest.mark.parametrize("slope, intercept, dtype", [(1, -1024, np.int16), (16, 0, np.uint16), (0.5, 3, np.float64)])
def test_frames_without_a_sign(slope, intercept, dtype, tmp_path):
    pixels = (VOXELS + 500).astype("<u2")
    values = {"PixelRepresentation": 0, "PixelData": pixels.tobytes(), "rescales": [(slope, intercept)]}
    path = write_frames(tmp_path / "frames.dcm", **values)
    image = open_image(path)
    assert np.asarray(image).dtype == dtype
    assert_array_equal(image, pixels * float(slope) + intercept)
    assert_as_the_program(path, tmp_path)


def test_frames_that_are_compressed(tmp_path):
    path = write_frames(tmp_path / "frames.dcm", rescales=[(1, -100)])
    expected = mip(path)
    dataset = pydicom.dcmread(path)
    dataset.compress(pydicom.uid.RLELossless)
    dataset.save_as(path)
    assert_array_equal(mip(path), expected)
    assert_as_the_program(path, tmp_path)


def test_files_of_one_frame_make_a_series(tmp_path):
    folder = tmp_path / "series"
    folder.mkdir()
    for n in range(6):
        write_frames(
            folder / f"{(n * 5) % 7}.dcm", order=[n], NumberOfFrames=1, PixelData=VOXELS[n].tobytes(), rescales=[(1, n)]
        )
    assert_array_equal(open_image(folder), VOXELS + np.arange(6)[:, None, None])
    assert_as_the_program(folder, tmp_path)


PLACE = {"ImageOrientationPatient": [*ROW, *COLUMN], "ImagePositionPatient": [0, 0, 0], "PixelSpacing": [1, 1]}
PLAIN = {**PLACE, "PerFrameFunctionalGroupsSequence": None, "SharedFunctionalGroupsSequence": None}


@pytest.mark.parametrize(
    "values, axis",
    [
        ({"GridFrameOffsetVector": [0, 2, 4, 6, 8, 10], "DoseGridScaling": "0.25"}, NORMAL),
        ({"GridFrameOffsetVector": [10, 8, 6, 4, 2, 0]}, [0, 0, -1]),
        ({"FrameIncrementPointer": 0x00540080, "SpacingBetweenSlices": 2, "SliceVector": [1, 2, 3, 4, 5, 6]}, NORMAL),
        ({"FrameIncrementPointer": 0x00540080, "SpacingBetweenSlices": -2}, -NORMAL),
    ],
    ids=["dose", "dose in the patient's space", "slices", "slices backward"],
)
def test_frames_without_functional_groups(values, axis, tmp_path):
    path = write_frames(tmp_path / "frames.dcm", **PLAIN, **values)
    image = open_image(path)
    assert_array_equal(image, VOXELS * float(values.get("DoseGridScaling", 1)))
    assert list(image.GetSpacing()) == [1, 1, 2]
    assert np.allclose(itk.array_from_matrix(image.GetDirection())[:, 2], axis)
    assert_as_the_program(path, tmp_path)


@pytest.mark.parametrize(
    "values, text",
    [
        (PLAIN, "two slices lie at one position: frame 1 of '.*' at 0 mm and frame 2 of"),
        ({"NumberOfFrames": 5}, "has 5 frames, but describes 6"),
        ({"SharedFunctionalGroupsSequence": None}, "frame 1 of '.*' has no valid orientation"),
        ({"order": [0, 1, 2, 4, 5, 6]}, "a slice is missing between frame 3 of '.*' at .* mm and frame 4 of"),
        ({"rescales": [(1, None)]}, "frame 1 of '.*' has no valid rescale intercept"),
        (
            PLAIN | {"FrameIncrementPointer": 0x00540080, "SpacingBetweenSlices": 2, "SliceVector": [2, 1, 3]},
            "in the order",
        ),
    ],
    ids=["no places", "count", "no orientation", "gap", "slope", "order"],
)
def test_frames_that_make_no_volume(values, text, tmp_path):
    with pytest.raises(ValueError, match=text):
        mip(write_frames(tmp_path / "frames.dcm", **values))


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


def test_colours_are_refused(tmp_path):
    pixels = np.zeros((6, 10, 12, 3), np.uint8)
    values = {"SamplesPerPixel": 3, "PlanarConfiguration": 0, "PixelRepresentation": 0, "PixelData": pixels.tobytes()}
    bits = {"BitsAllocated": 8, "BitsStored": 8, "HighBit": 7}
    path = write_frames(tmp_path / "colours.dcm", photometric="RGB", **values, **bits)
    for source in (path, tmp_path):
        with pytest.raises(
            ValueError, match="has 3 components, as a colour image has, but a volume has 1: give one of them"
        ):
            mip(source)


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

"""One oblique volume in every form that the package takes: the same pictures, and files with the program's bytes."""

import shutil
import subprocess
from functools import cache

import itk
import numpy as np
import pydicom
import pytest
import SimpleITK
from forms import ARRAYS, FORMS, IN_MEMORY, compare_datasets, get_geometry, make_form
from itk_shearwarpmip import _write, mip, open_image, save_png, turn, write
from numpy.testing import assert_allclose, assert_array_equal
from program import PROGRAM
from samples import make_image, make_rotation

pytestmark = pytest.mark.skipif(not PROGRAM, reason="needs the program shear-warp-mip: SHEARWARPMIP_PROGRAM=path")


@pytest.fixture(scope="module")
def volume():
    """With room for letters, oblique about all axes, anisotropic, its origin anywhere."""
    voxels = np.random.default_rng(8).integers(-100, 1000, (40, 50, 60), np.int16)
    direction = itk.array_from_matrix(make_rotation(0.4, -0.3, 0.7).GetMatrix())
    return make_image(voxels, (0.9, 1.1, 1.7), (13.5, -31.25, 107.125), direction)


@pytest.fixture(scope="module")
def path(volume, tmp_path_factory):
    path = tmp_path_factory.mktemp("volume") / "volume.mha"
    itk.imwrite(volume, path)
    return path


def run(source, output, options):
    subprocess.run([PROGRAM, source, output, *_write.make_arguments(options)], check=True, capture_output=True)


GRID = {"output_spacing": (1.2, 1.3), "size": (50, 60)}
VIEWS = {
    "side": {"view": "left"},
    "angles": {"view": "superior", "azimuth": -20, "elevation": 15, "oversampling": 2, "background": 5},
    "grid": {"azimuth": 133, **GRID},
    # of volumes in memory
    "minimum": {"elevation": 40, "mode": "minimum", "slab": (-20, 30)},
    "absolute": {"azimuth": 50, "mode": "absolute_maximum", "crop": ((-50, -50, 100), (60, 60, 190))},
    "mean": {"azimuth": 110, "mode": "mean", "slab": (-20, 30)},
    "nearest": {"azimuth": 250, "interpolation": "nearest"},
    "exact": {"azimuth": 210, "exact": True, **GRID},
    "attenuation": {"azimuth": 300, "attenuation": 0.01, "background": 0},
    "local maximum": {"view": "inferior", "local_maximum": 900},
}
OF_CHUNKS = ("side", "angles", "grid")


@pytest.fixture(scope="module")
def pictures(path, tmp_path_factory):
    """The program's."""
    folder = tmp_path_factory.mktemp("pictures")
    for name, options in VIEWS.items():
        run(path, folder / f"{name}.mha", options)
    return {name: itk.imread(folder / f"{name}.mha") for name in VIEWS}


def get_pixels(picture):
    return SimpleITK.GetArrayFromImage(picture) if isinstance(picture, SimpleITK.Image) else np.asarray(picture)


@pytest.mark.parametrize("form", [*FORMS, *ARRAYS])
def test_each_form_has_the_same_pixels(form, volume, path, pictures):
    source, where = make_form(form, volume, path.parent)
    for name in VIEWS if form in IN_MEMORY else OF_CHUNKS:
        picture, expected = mip(source, **VIEWS[name], **where), pictures[name]
        assert get_pixels(picture).dtype == np.int16
        assert_array_equal(get_pixels(picture), np.asarray(expected).reshape(get_pixels(picture).shape), name)
        if isinstance(picture, SimpleITK.Image | itk.Image[itk.SS, 2]):
            assert_allclose(list(picture.GetSpacing()), list(expected.GetSpacing())[:2], rtol=1e-14)
            assert_allclose(list(picture.GetOrigin()), list(expected.GetOrigin())[:2], rtol=1e-12)


FRAMES = 5
TURNS = {"frames": FRAMES, "azimuth": 30, "elevation": 10}
SUFFIXES = (".nrrd", ".mha", ".nii.gz", ".png", ".tif", ".jpg", ".html", ".gif", ".apng", ".mp4", "")
OPTIONS = {"nothing": {}, "window": {"window": (-300, 700.5), "labels": False}, "annotations": {"annotate": True}}


def save_all(save, folder):
    """Each format, and with options some, in a folder for each of the options."""
    for suffix in SUFFIXES:
        if suffix in (".gif", ".apng", ".mp4") and not shutil.which("ffmpeg"):
            continue
        for name, options in OPTIONS.items():
            if options and suffix not in ("", ".html", ".png", ".gif"):
                continue
            own = folder / name
            own.mkdir(exist_ok=True, parents=True)
            save(own / f"turn{suffix}", options)
    save(folder / "multi-frame", {"multi_frame": True})
    return {file.relative_to(folder): file for file in sorted(folder.rglob("*.*"))}


@pytest.fixture(scope="module")
def save_by_program(path, tmp_path_factory):
    """The program's files."""

    @cache
    def save(path):
        def save_one(output, options):
            run(path, output if output.suffix else f"{output}/", TURNS | options)

        return save_all(save_one, tmp_path_factory.mktemp("files"))

    return save


def write_rounded(form, source, where, path, folder):
    """The file of a form's geometry: some forms round its last digit."""
    if form not in ("nibabel", "xarray"):
        return path
    image = open_image(source, **where)
    for one, other in zip(get_geometry(image).values(), get_geometry(itk.imread(path)).values(), strict=True):
        assert_allclose(one, other, rtol=1e-12, atol=1e-14)
    itk.imwrite(image, folder / path.name)
    return folder / path.name


def compare(file, expected):
    if file.suffix != ".dcm":
        assert file.read_bytes() == expected.read_bytes(), file
        return
    compare_datasets(pydicom.dcmread(file), pydicom.dcmread(expected))


@pytest.mark.parametrize("form", ["path", "itk", "SimpleITK", "nibabel", "xarray", "NumPy", "Dask"])
def test_each_turn_has_the_same_files(form, volume, path, save_by_program, tmp_path, tmp_path_factory):
    source, where = make_form(form, volume, path.parent)
    files = save_by_program(write_rounded(form, source, where, path, tmp_path_factory.mktemp("volume")))
    series = turn(source, **TURNS, **where)
    own = save_all(lambda output, options: series.save(output, **options), tmp_path)
    assert own.keys() == files.keys()
    for name, file in own.items():
        compare(file, files[name])


@pytest.mark.parametrize("form", ["path", "itk", "SimpleITK", "nibabel", "xarray", "NumPy"])
def test_each_form_is_written_the_same(form, volume, path, tmp_path):
    source, where = make_form(form, volume, path.parent)
    path = write_rounded(form, source, where, path, tmp_path)
    options = {"frames": 4, "elevations": (-20, 20), "mode": "minimum", "crop": (-90, 90, -90, 90, 0, 200)}
    for suffix in (".nrrd", ".html"):
        run(path, tmp_path / f"one{suffix}", options)
        write(open_image(source, **where) if where else source, tmp_path / f"other{suffix}", **options)
        compare(tmp_path / f"other{suffix}", tmp_path / f"one{suffix}")


@pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS)
def test_pictures_have_the_same_bytes(options, path, tmp_path):
    run(path, tmp_path / "one.png", {"azimuth": 33} | options)
    picture = mip(path, azimuth=33)
    save_png(picture, tmp_path / "other.png", **options)
    compare(tmp_path / "other.png", tmp_path / "one.png")
    if not options:
        assert picture._repr_png_() == (tmp_path / "one.png").read_bytes()

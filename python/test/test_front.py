"""mip() and turn(): every kind of input, every parameter, what is kept, and what is refused."""

import doctest
import importlib
import inspect
import os
import subprocess
import sys
import threading
import traceback
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import call

import itk
import itk_shearwarpmip
import nibabel
import numpy as np
import pydicom
import pytest
import samples
import SimpleITK
import xarray
from forms import ArrayLike, get_geometry, make_form, make_nibabel, make_simple_itk
from IPython.core.formatters import DisplayFormatter
from itk_shearwarpmip import Turn, mip, open_image, save_png, turn
from itk_shearwarpmip._front import _FILTERS
from itk_shearwarpmip._window import find_window, find_window_of
from numpy.testing import assert_array_equal
from program import PROGRAM
from samples import make_like

Enums = itk.ShearWarpMIPImageFilterEnums


def make_view(image, azimuth=30.0, elevation=0.0):
    return itk.ShearWarpMIPView.MakeTransform(image, itk.ShearWarpMIPViewEnums.Direction_Anterior, azimuth, elevation)


def project(image, **parameters):
    """What the filter gives, on the program's background."""
    lowest = min(0, itk.array_view_from_image(image).min().item())
    return itk.shear_warp_mip_image_filter(
        image, **{"transform": make_view(image), "default_pixel_value": lowest, **parameters}
    )


class OfItsOwn(ArrayLike):
    """Of a package with the functions of the array API."""

    def __array_namespace__(self, *, api_version=None):
        return SimpleNamespace(asarray=OfItsOwn)


def get_pixels(picture):
    return SimpleITK.GetArrayFromImage(picture) if isinstance(picture, SimpleITK.Image) else np.asarray(picture)


def test_chunks(image):
    dask_array = pytest.importorskip("dask.array")
    chunked = dask_array.from_array(itk.array_from_image(image), 5)
    series = turn(chunked, azimuth=30, elevation=10, frames=5, **get_geometry(image))
    assert_array_equal(series.frames, turn(image, azimuth=30, elevation=10, frames=5).frames)
    assert len(series.transforms) == 5
    # each chunk may have the least
    assert series.frames["Background"] == itk.array_view_from_image(image).min()
    assert mip(itk.xarray_from_image(image).chunk(5)).dims == ("y", "x")


def test_tensors(image):
    torch = pytest.importorskip("torch", reason="PyTorch is too large for the tests' environment")
    tensor = torch.from_numpy(itk.array_from_image(image))
    picture = mip(tensor, azimuth=30, **get_geometry(image))
    assert isinstance(picture, torch.Tensor)
    assert_array_equal(picture.numpy(), project(image))
    with pytest.raises(TypeError, match=r"must be in the computer's memory: .*grad"):
        mip(torch.ones((3, 4, 5), requires_grad=True))


def test_without_dask(tmp_path):
    code = f"""
import sys
sys.modules["dask"] = sys.modules["zarr"] = None
sys.path[:0] = [{os.path.dirname(__file__)!r}, {os.path.dirname(samples.__file__)!r}]
import pathlib, numpy as np, itk_shearwarpmip
assert hasattr(itk_shearwarpmip, "mip") and "dask.array" not in sys.modules
from samples import make_oblique
from forms import IN_MEMORY, make_form
for form in IN_MEMORY:
    source, where = make_form(form, make_oblique(np.random.default_rng(1)), pathlib.Path({str(tmp_path)!r}))
    itk_shearwarpmip.mip(source, **where)
try:
    itk_shearwarpmip.mip("light-sheet.ome.zarr")
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.stdout == "itk_shearwarpmip needs Dask: install the wheel with its extra [distributed]\n", done.stderr


def test_nothing_is_imported_for_others():
    code = """
import sys, itk, numpy as np
# ITK itself imports some of them
itk.shear_warp_mip_image_filter(np.ones((3, 4, 5), np.uint8))
before = set(sys.modules)
from itk_shearwarpmip import mip, turn
mip(np.ones((3, 4, 5), np.uint8))
turn(np.ones((3, 4, 5), np.uint8), frames=2)
print(sorted({name.partition(".")[0] for name in set(sys.modules) - before} - set(sys.stdlib_module_names) - {"itk"}))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "['itk_shearwarpmip']\n"


# as of the program: shear-warp-mip --help
DEFAULTS = dict.fromkeys(
    "slab crop mask mask_label local_maximum output_spacing size output_origin threads".split()
) | {
    "view": "anterior", "azimuth": 0.0, "elevation": 0.0, "mode": "maximum", "interpolation": "linear", "depth": False,
    "places": False, "attenuation": 0.0, "background": "auto", "exact": False, "oversampling": 1,
}  # fmt: skip
DEFAULTS_OF_TURN = {
    "frames": 36, "rotation_axis": "superior", "center": None, "start_angle": 0.0, "angular_range": 360.0,
    "rocking": False, "transforms": None,
}  # fmt: skip


def test_defaults_are_the_programs():
    for function, expected in ((mip, DEFAULTS | {"geometry": False}), (turn, DEFAULTS | DEFAULTS_OF_TURN)):
        parameters = inspect.signature(function).parameters.values()
        assert {each.name: each.default for each in parameters if each.default is not each.empty} == expected


with_program = pytest.mark.skipif(not PROGRAM, reason="needs the program shear-warp-mip: SHEARWARPMIP_PROGRAM=path")


@with_program
@pytest.mark.parametrize(
    "parameters, options",
    [
        ({}, ""),
        (
            {"elevation": 20, "rotation_axis": "i", "center": (1, 2, 3)},
            "--elevation=20 --rotation-axis=i --centre=1,2,3",
        ),
        ({"angular_range": 60, "rocking": True, "view": "right"}, "--rocking --angular-range 60 --view=right"),
        ({"angular_range": -90, "rotation_axis": (1, 2, 3)}, "--angular-range=-90 --rotation-axis=1,2,3"),
    ],
)
def test_turns_are_the_programs(parameters, options, image, tmp_path):
    path = tmp_path / "image.nrrd"
    itk.imwrite(image, path)
    subprocess.run([PROGRAM, path, tmp_path / "turn.nrrd", "--frames=7", *options.split()], check=True)
    series = turn(path, frames=7, **parameters)
    assert np.asarray(series.frames).tobytes() == np.asarray(itk.imread(str(tmp_path / "turn.nrrd"))).tobytes()


MASK = np.random.default_rng(3).integers(0, 3, (9, 11, 14))

# keywords, parameters of the filter
FILTERS = {
    "minimum": ({"mode": "minimum"}, {"mode": Enums.Mode_Minimum}),
    "absolute": ({"mode": "absolute_maximum"}, {"mode": Enums.Mode_AbsoluteMaximum}),
    "mean": ({"mode": "mean", "slab": (-2, 3)}, {"mode": Enums.Mode_Mean, "slab_near": -2.0, "slab_far": 3.0}),
    "nearest": ({"interpolation": "nearest"}, {"interpolation": Enums.Interpolation_Nearest}),
    "slab": ({"slab": (-2, 3)}, {"slab_near": -2.0, "slab_far": 3.0}),
    "crop": (
        {"crop": ((12, -30, 5), (16, -26, np.inf))},
        {"crop_lower": [12.0, -30.0, 5.0], "crop_upper": [16.0, -26.0, np.inf]},
    ),
    "mask": ({"mask": MASK}, {"mask_image": (MASK != 0).astype(np.uint8)}),
    "label": ({"mask": MASK, "mask_label": 1}, {"mask_image": (MASK == 1).astype(np.uint8)}),
    "fading": ({"attenuation": 0.05, "background": 0}, {"depth_attenuation": 0.05, "default_pixel_value": 0}),
    "local maximum": ({"local_maximum": 300}, {"local_maximum": True, "local_maximum_threshold": 300}),
    "exact": ({"exact": True}, {"exact": True}),
    "oversampling": ({"oversampling": 2}, {"oversampling": 2}),
    "spacing": ({"output_spacing": 0.4}, {"output_spacing": 0.4}),
    "grid": (
        {"output_spacing": (0.4, 0.5), "size": (20, 30), "output_origin": (-3, -4)},
        {"output_spacing": [0.4, 0.5], "size": [20, 30], "output_origin": [-3.0, -4.0]},
    ),
    "threads": ({"threads": 1}, {}),
}


@pytest.mark.parametrize("keywords, parameters", FILTERS.values(), ids=FILTERS)
def test_parameters_are_the_filters(keywords, parameters, image):
    parameters = parameters.copy()
    if "mask_image" in parameters:
        parameters["mask_image"] = make_like(parameters["mask_image"], image)
    expected = project(image, **parameters)
    before = mip(image, azimuth=30)
    kept = np.array(before)
    threads = get_filter(image).GetNumberOfWorkUnits()
    for source, where in ((image, {}), (itk.array_from_image(image), get_geometry(image))):
        picture = mip(source, azimuth=30, **where, **keywords)
        assert_array_equal(picture, expected)
        if keywords.get("mode") != "mean":
            same, depths = mip(source, azimuth=30, depth=True, **where, **keywords)
            assert_array_equal(same, expected)
            assert np.asarray(depths).dtype == np.float32 and np.isfinite(depths).any()
    # nothing of it stays
    for each in (before, mip(image, azimuth=30)):
        assert_array_equal(each, kept)
    assert get_filter(image).GetNumberOfWorkUnits() == threads


def test_views(image):
    matrix = np.eye(4)
    view = make_view(image, 25.0, 10.0)
    matrix[:3, :3] = itk.array_from_matrix(view.GetMatrix())
    matrix[:3, 3] = list(view.GetTranslation())
    expected = project(image, transform=view)
    for each in (view, matrix, matrix.tolist(), [view]):
        assert_array_equal(mip(image, each), expected)
    frames = np.asarray(turn(image, transforms=["left", matrix], size=(20, 20)).frames)
    assert_array_equal(frames[0], mip(image, "left", size=(20, 20)))


@pytest.mark.parametrize("kind", ["itk", "xarray", "SimpleITK", "nibabel", "path", "bool"])
def test_masks_with_a_place_of_their_own(kind, image, tmp_path):
    mask = make_like(MASK.astype(np.uint8), image)
    source = MASK != 0 if kind == "bool" else make_form(kind, mask, tmp_path)[0]
    expected = mip(image, mask=MASK)
    assert_array_equal(mip(image, mask=source), expected)
    if kind != "bool":
        mask.SetOrigin([12.0, -30.0, 5.6])
        with pytest.raises(ValueError, match=r"a corner is 0\.1 mm away"):
            mip(image, mask=make_form(kind, mask, tmp_path)[0])


@pytest.mark.parametrize(
    "parameters",
    [{"slab": (500, 600)}, {"crop": ((500,) * 3, (600,) * 3)}, {"slab": (500, 600), "background": np.nan}],
    ids=["slab", "crop", "not a number"],
)
@pytest.mark.parametrize("function", [mip, turn])
def test_only_background_is_said(function, parameters, image):
    text = "there is only background in the picture: is the image within "
    text += "slab? A slab must be at least as thick as the voxels." if "slab" in parameters else "crop?"
    image = open_image(np.asarray(image, np.float32)) if "background" in parameters else image
    with pytest.warns(UserWarning) as said:
        function(image, **parameters)
    assert [str(each.message) for each in said] == [text]
    # of the line that called
    assert said[0].filename == __file__
    function(image, slab=(-500, 500))


@pytest.mark.parametrize("function", [mip, turn])
def test_masks_without_voxels_are_said(function, image):
    with pytest.warns(UserWarning, match=r"^the mask has no label 7: its labels are 0, 1, 2$") as said:
        function(image, mask=MASK, mask_label=7)
    assert said[0].filename == __file__
    with pytest.warns(UserWarning, match=r"^the mask has no label 999: its labels are 0, 1, .* 19, \.\.\.$"):
        function(image, mask=np.arange(MASK.size).reshape(MASK.shape) % 99, mask_label=999)
    with pytest.warns(UserWarning, match="^no voxel is in the mask: all are 0$"):
        function(image, mask=0 * MASK)


def test_regions_that_do_not_begin_at_0(image):
    region = image.GetLargestPossibleRegion()
    region.SetIndex([3, -2, 5])
    image.SetRegions(region)
    expected = project(image)
    assert_array_equal(mip(image, azimuth=30), expected)
    voxels = itk.array_from_image(image)
    geometry = get_geometry(image) | {"origin": list(image.TransformIndexToPhysicalPoint([3, -2, 5]))}
    assert_array_equal(mip(voxels, azimuth=30, **geometry), expected)
    mask = make_like(MASK.astype(np.uint8), image)
    assert_array_equal(mip(image, mask=mask), mip(image, mask=MASK))


@pytest.mark.parametrize(
    "dtype, kept",
    [
        (bool, np.uint8),
        (np.int8, np.int16),
        (np.int64, np.int16),
        (np.uint32, np.uint16),
        (np.uint64, np.uint16),
        (np.float16, np.float32),
        (">f8", np.float64),
    ],
    ids=str,
)
def test_types_of_voxels(dtype, kept):
    voxels = (np.arange(60).reshape(3, 4, 5) % 7 == 1).astype(dtype)
    voxels.setflags(write=False)
    picture = mip(voxels, "superior")
    assert picture.dtype == kept
    assert_array_equal(picture[:, ::-1], voxels.max(axis=0))


@pytest.mark.parametrize(
    "dtype, least, most", [(np.int64, -(2**53), 32768), (np.int32, 0, 40000), (np.uint32, 0, 70000)]
)
def test_integers_that_16_bits_do_not_hold(dtype, least, most):
    voxels = np.full((3, 4, 5), least, dtype)
    voxels[1, 2, 3] = most
    picture = mip(voxels, "superior")
    assert picture.dtype == np.float64
    assert_array_equal(picture[:, ::-1], voxels.max(axis=0))


def test_what_is_given_goes_before(image):
    picture = mip(image, "superior", spacing=(2, 2, 3), origin=(0, 0, 0), direction=np.eye(3))
    assert list(picture.GetSpacing()) == [2, 2]
    assert_array_equal(np.asarray(picture)[:, ::-1], itk.array_from_image(image).max(axis=0))
    assert list(image.GetSpacing()) == [0.7, 0.9, 2.1]


def test_a_sheared_affine_stays_sheared():
    voxels = np.random.default_rng(4).integers(0, 999, (14, 11, 9), np.int16)
    affine = np.array([[-1.0, 0, 0.5, 3], [0, -2.0, 0, 4], [0, 0, 3.0, 5], [0, 0, 0, 1]])
    image = open_image(nibabel.Nifti1Image(voxels, affine))
    for index in ((0, 0, 0), (13, 10, 8), (3, 7, 2)):
        point = image.TransformIndexToPhysicalPoint(list(index))
        assert np.allclose(np.diag([-1, -1, 1]) @ list(point), (affine @ [*index, 1])[:3])
    assert mip(image).shape


@pytest.mark.parametrize("name", ["sheared.nii.gz", "sheared.nrrd", "sheared.mha"])
def test_files_keep_their_shear(name, tmp_path):
    direction = np.array([[1, 0, 0.3], [0, 0.8, 0.1], [0, 0.6, 0.9]])
    direction /= np.linalg.norm(direction, axis=0)
    voxels = np.random.default_rng(5).integers(0, 999, (9, 11, 14), np.int16)
    image = samples.make_image(voxels, (0.5, 0.75, 2), (3, -4, 5), direction)
    path = tmp_path / name
    if ".nii" in name:
        # ITK cannot write it
        nibabel.save(make_nibabel(image), path)
    else:
        itk.imwrite(image, path)
    found, expected = (get_geometry(each) for each in (open_image(path), image))
    for key, values in expected.items():
        assert np.allclose(found[key], values, atol=1e-6), key
    by_program = tmp_path / "by-program.nrrd"
    subprocess.run([PROGRAM, path, by_program, "--azimuth", "30"], check=True)
    for picture in (mip(path, azimuth=30), itk.imread(by_program)):
        assert_array_equal(np.asarray(picture), np.asarray(project(image)))


@pytest.mark.parametrize("view", ["left", "superior", "anterior"])
def test_a_skewed_stack_is_projected_as_if_deskewed(view):
    """Gaussian spots, whose projection is known."""
    angle, spacing, sigma = np.radians(30), np.array([0.5, 0.5, 0.8]), 2.5
    direction = np.array([[1, 0, 0], [0, np.cos(angle), 1], [0, -np.sin(angle), 0]])
    generator = np.random.default_rng(6)
    image = samples.make_image(np.zeros((70, 100, 60), np.float32), spacing, (3, -4, 5), direction)
    indices = np.moveaxis(np.indices((70, 100, 60)), 0, -1)[..., ::-1]
    points = indices @ (direction * spacing).T + (3, -4, 5)
    # away from the faces
    centers = generator.uniform(0.4, 0.6, (8, 3)) * (60, 100, 70) @ (direction * spacing).T + (3, -4, 5)
    heights = generator.uniform(1000, 5000, 8)
    array = itk.array_view_from_image(image)
    for center, height in zip(centers, heights):
        spot = height * np.exp(-np.square(points - center).sum(axis=-1) / (2 * sigma**2))
        np.maximum(array, spot, out=array)
    transform = itk.ShearWarpMIPView.MakeTransform(
        image, getattr(itk.ShearWarpMIPViewEnums, f"Direction_{view.title()}"), 20.0, 15.0
    )
    picture = mip(image, transform, exact=True)
    rows, columns = np.asarray(picture).shape
    straight = itk.resample_image_filter(
        image, size=[70, 210, 64], output_origin=[1, -6, -23], output_spacing=[0.5, 0.5, 0.5]
    )
    grid = {"size": (columns, rows), "output_origin": picture.GetOrigin(), "output_spacing": picture.GetSpacing()}
    u = picture.GetOrigin()[0] + picture.GetSpacing()[0] * np.arange(columns)
    v = picture.GetOrigin()[1] + picture.GetSpacing()[1] * np.arange(rows)[:, None]
    expected = np.zeros((rows, columns))
    for center, height in zip(centers, heights):
        at = transform.GetInverseTransform().TransformPoint(center.tolist())
        away = np.square(u - at[0]) + np.square(v - at[1])
        np.maximum(expected, height * np.exp(-away / (2 * sigma**2)), out=expected)
    for found in (picture, mip(straight, transform, exact=True, **grid)):
        assert np.abs(np.asarray(found) - expected).max() < 0.06 * heights.max()


@pytest.mark.parametrize("axes", ["z", "y", "x", "zx", "zyx"])
@pytest.mark.parametrize("attributes", [True, False])
def test_descending_coordinates_are_negative_directions(axes, attributes):
    image = open_image(
        np.random.default_rng(4).integers(0, 999, (5, 6, 7), np.int16), spacing=(0.5, 0.75, 2), origin=(3, 4, 5)
    )
    ascending = itk.xarray_from_image(image)
    if not attributes:
        ascending = ascending.drop_attrs()
    source = ascending.isel({axis: slice(None, None, -1) for axis in axes})
    found = open_image(source)
    for index in ((0, 0, 0), (6, 5, 4), (1, 2, 3)):
        other = [length - 1 - n if axis in axes else n for n, axis, length in zip(index, "xyz", (7, 6, 5))]
        assert found[index[::-1]] == image[tuple(other[::-1])]
        point, expected = (
            list(each.TransformIndexToPhysicalPoint(list(at))) for each, at in ((found, index), (image, other))
        )
        assert point == pytest.approx(expected)
    assert_array_equal(mip(source), mip(image))


def test_units_of_nibabel_are_millimetres(image):
    expected = open_image(make_nibabel(image))
    source = make_nibabel(image)
    source.header.set_xyzt_units("micron")
    assert list(open_image(source).GetSpacing()) == pytest.approx([each / 1000 for each in expected.GetSpacing()])


def test_units_of_coordinates_are_kept(image, tmp_path):
    source = itk.xarray_from_image(image)
    for axis in "xyz":
        source[axis].attrs["units"] = "micrometer"
    picture, depths = mip(source, depth=True)
    assert [each[axis].attrs["units"] for each in (picture, depths) for axis in "xy"] == ["micrometer"] * 4
    assert open_image(source)["Unit"] == open_image(open_image(source), origin=(0, 0, 0))["Unit"] == "micrometer"
    assert not open_image(source, spacing=(1, 2, 3)).GetMetaDataDictionary().HasKey("Unit")
    turn(source, frames=1).save(tmp_path / "turn")
    found = pydicom.dcmread(tmp_path / "turn" / "frame-001.dcm").PixelSpacing
    assert found == pytest.approx([0.001 * min(image.GetSpacing())] * 2)


def test_a_written_array_is_read_anew(image):
    for source in (itk.array_from_image(image), make_simple_itk(image)):
        before = get_pixels(mip(source))
        if isinstance(source, np.ndarray):
            source[:] = 7
        else:
            source[3, 4, 5] = 30000
        assert (get_pixels(mip(source)) != before).any()


def get_filter(image, template=itk.ShearWarpMIPImageFilter):
    return _FILTERS[id(image)]._made[template]


def test_a_volume_is_prepared_once():
    voxels = np.random.default_rng(5).integers(-99, 999, (64, 64, 64), np.int16)
    image = itk.image_from_array(voxels)
    preparations = []
    for azimuth in (0, 10, 20, 30):
        mip(image, "superior", azimuth=azimuth)
        preparations.append(get_filter(image).GetPreparationSeconds() > 0)
    assert preparations == [False, True, False, False]
    assert get_filter(image) is get_filter(image)
    # a change is seen
    itk.array_view_from_image(image)[:] = -200
    image.Modified()
    picture = mip(image, "superior")
    assert (np.asarray(picture) == -200).all() and picture["Background"] == -200
    image.SetSpacing([2.0, 2.0, 2.0])
    assert list(mip(image).GetSpacing()) == [2.0, 2.0]


def test_a_pipeline_is_updated(image):
    median = itk.MedianImageFilter.New(image, Radius=1)
    output = median.GetOutput()
    first = np.array(mip(output))
    median.SetRadius(0)
    assert_array_equal(mip(output), mip(image))
    assert (np.asarray(mip(output)) != first).any()


def test_nothing_is_kept_alive():
    before = set(_FILTERS)
    image = itk.image_from_array(np.ones((9, 9, 9), np.int16))
    deleted = []
    image.AddObserver(itk.DeleteEvent(), lambda: deleted.append(True))
    mask = itk.image_from_array(np.ones((9, 9, 9), np.uint8))
    picture = mip(image, mask=mask)
    assert get_filter(image).GetMaskImage() is None
    series = turn(image, frames=2)
    alive = [weakref.ref(each) for each in (image, mask, picture, series.frames)]
    assert id(image) in _FILTERS and id(image) not in before
    del image, mask, picture, series
    # at once, without the garbage collector
    assert [each() for each in alive] == [None] * 4
    assert deleted and set(_FILTERS) <= before


def test_threads_share_an_image():
    image = itk.image_from_array(np.random.default_rng(6).integers(-99, 999, (32, 32, 32), np.int16))
    expected = [np.array(mip(itk.image_duplicator(image), azimuth=n)) for n in range(8)]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda n: np.array(mip(image, azimuth=n)), range(8)))
    for one, other in zip(found, expected, strict=True):
        assert_array_equal(one, other)


def test_a_picture_is_an_image(image, tmp_path):
    picture = mip(image)
    assert type(picture) is itk.Image[itk.SS, 2]
    assert itk.median_image_filter(picture).shape == picture.shape
    itk.imwrite(picture, str(tmp_path / "mip.nrrd"))
    assert_array_equal(itk.imread(str(tmp_path / "mip.nrrd")), picture)
    (tmp_path / "mip.png").write_bytes(picture._repr_png_())
    # as a notebook asks
    assert DisplayFormatter().format(picture)[0]["image/png"]
    grey = np.asarray(itk.imread(str(tmp_path / "mip.png")))
    assert grey.shape == picture.shape and grey.max() == 255 and grey.min() == 0
    # of a turn there is the page, of depths a picture
    assert "image/png" not in DisplayFormatter().format(turn(image, frames=2).frames)[0]
    assert DisplayFormatter().format(mip(image, depth=True)[1])[0]["image/png"]
    # of one that nobody keeps
    assert mip(image)._repr_png_() == picture._repr_png_()
    # what is written into it is shown
    itk.array_view_from_image(picture)[:3] = 32000
    assert picture._repr_png_() != (tmp_path / "mip.png").read_bytes()
    # not-a-number and infinity
    voxels = itk.array_from_image(image).astype(np.float32)
    voxels[3], voxels[4], voxels[5] = np.nan, np.inf, -np.inf
    assert mip(itk.image_from_array(voxels))._repr_png_()
    assert mip(itk.image_from_array(voxels), background=np.nan)._repr_png_()


def test_results_are_of_the_kind_that_came_in(image, tmp_path):
    expected = {"NumPy": np.ndarray, "xarray": xarray.DataArray, "SimpleITK": SimpleITK.Image}
    for kind in ("NumPy", "xarray", "SimpleITK", "nibabel", "itk", "path"):
        source, where = make_form(kind, image, tmp_path)
        picture, depths = mip(source, depth=True, **where)
        assert type(picture) is expected.get(kind, itk.Image[itk.SS, 2])
        assert type(depths) is expected.get(kind, itk.Image[itk.F, 2])
    assert type(mip(OfItsOwn(itk.array_from_image(image)))) is OfItsOwn
    assert mip(itk.xarray_from_image(image)).coords["x"].values == pytest.approx(
        np.array([mip(image).TransformIndexToPhysicalPoint([n, 0])[0] for n in range(mip(image).shape[1])])
    )


def test_turns(image):
    image["0010|0020"] = "patient"
    series = turn(image, elevation=20, frames=5, depth=True)
    assert isinstance(series, Turn) and series.source_metadata["0010|0020"] == "patient"
    frames = np.asarray(series.frames)
    grid = {"size": frames.shape[:0:-1], "output_origin": list(series.frames.GetOrigin())[:2]}
    assert series.frames["FrameAngles"] == (0, 72, 144, 216, 288)
    assert series.window[0] < series.window[1]
    # nothing of another turn stays
    turn(image, transforms=["left"], size=(9, 9))
    turn(image, center=(1, 2, 3), rocking=True, frames=2)
    assert_array_equal(turn(image, elevation=20, frames=5).frames, frames)
    for frame, transform in enumerate(series.transforms):
        picture, depths = mip(image, transform, depth=True, **grid)
        assert_array_equal(frames[frame], picture)
        assert_array_equal(np.asarray(series.depths)[frame], depths)


SHORTS = np.ones((3, 4, 5), np.int16)
IMAGE = itk.image_from_array(SHORTS)
TURNED = open_image(SHORTS, direction=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def make_affine(pixel_type):
    return itk.AffineTransform[pixel_type, 3].New()


def label(**coordinates):
    """A DataArray."""
    return xarray.DataArray(SHORTS, dims=list("zyx"), coords=coordinates)


def make_placed(**attributes):
    """An array of a package that knows where it lies."""

    class Placed(np.ndarray):
        pass

    array = SHORTS.view(Placed)
    for name, value in attributes.items():
        setattr(array, name, value)
    return array


# of mip() and turn(): FUNCTION is its name
BAD = {
    "2D array": (call(SHORTS[0]), ValueError, r"the axes z, y, x, but this one has the shape \(4, 5\)"),
    "colours": (call(np.ones((3, 4, 5, 3), np.uint8)), ValueError, r"array\[..., 0\] of colours"),
    "2D image": (call(itk.image_from_array(SHORTS[0])), TypeError, "3 dimensions, but this itk.Image has 2"),
    "4D image": (call(itk.image_from_array(SHORTS[None])), TypeError, "has 4: give a part of its array"),
    "4D array": (call(SHORTS[None]), ValueError, r"array\[0\] of several volumes"),
    "colour image": (call(itk.Image[itk.RGBPixel[itk.UC], 3].New()), TypeError, "several components"),
    "masked array": (call(np.ma.masked_less(SHORTS, 3)), TypeError, "loses its mask: fill it"),
    "empty array": (call(SHORTS[:0]), ValueError, "must not be empty"),
    "empty image": (call(itk.Image[itk.SS, 3].New()), ValueError, "must not be empty"),
    "large integers": (call(SHORTS.astype(int) * (2**53 + 1)), TypeError, r"they are int64; use astype\(\)"),
    "complex": (call(SHORTS.astype(complex)), TypeError, "they are complex128"),
    "None": (call(None), TypeError, "but this is None$"),
    "list": (call(SHORTS.tolist()), TypeError, "this is a builtins.list: give an array .* with spacing"),
    "class": (call(np.ndarray), TypeError, "this is a builtins.type"),
    "filter": (call(itk.MedianImageFilter.New(IMAGE)), TypeError, r"give its output, GetOutput\(\)"),
    "4D nibabel": (call(nibabel.Nifti1Image(np.ones((2, 3, 4, 5)), np.eye(4))), ValueError, r"as image.slicer\["),
    "no affine": (call(nibabel.Nifti1Image(SHORTS, None)), ValueError, "has no affine"),
    "2D SimpleITK": (call(SimpleITK.Image(3, 4, SimpleITK.sitkInt16)), ValueError, "this one has 2 and 1"),
    "label map": (call(SimpleITK.Image([3, 4, 5], SimpleITK.sitkLabelUInt8)), TypeError, "label map"),
    "names of axes": (call(xarray.DataArray(SHORTS)), ValueError, "the dimensions z, y, x"),
    "uneven coordinates": (call(label(z=[0, 1, 3])), ValueError, "equal steps, .* z do not: see its method interp"),
    "coordinates to and fro": (call(label(y=[4, 2, 3, 1])), ValueError, "go in equal steps, but the coordinates of y"),
    "one coordinate": (call(label(z=[2, 2, 2])), ValueError, "go in equal steps, but the coordinates of z"),
    "units of coordinates": (
        call(label(z=("z", [0, 1, 2], {"units": "mm"}), x=range(5))),
        ValueError,
        "must have the same units",
    ),
    "dates as coordinates": (
        call(label(z=np.arange(3).astype("M8[D]"))),
        TypeError,
        "must be numbers, but the coordinates of z are datetime64",
    ),
    "words as a direction in attributes": (
        call(xarray.DataArray(SHORTS, dims=list("zyx"), attrs={"direction": "RAS"})),
        ValueError,
        "direction must be 3 x 3 finite numbers, but it is 'RAS'",
    ),
    "descending coordinates with a direction": (
        call(itk.xarray_from_image(TURNED).isel(y=slice(None, None, -1))),
        ValueError,
        r"must ascend, but some descend: see its method sortby\(\)",
    ),
    "empty path": (call(""), ValueError, "the path of a volume must not be empty"),
    "no such file": (call("nowhere.nrrd"), FileNotFoundError, "'nowhere.nrrd' does not exist"),
    "no image": (call(__file__), OSError, "test_front.py' is no image of DICOM, NIfTI-1"),
    "no DICOM": (call(Path(__file__).parent), ValueError, "no DICOM series"),
    "no OME-Zarr": (call("nowhere.zarr"), ValueError, "nowhere.zarr is no OME-Zarr"),
    "series": (call(IMAGE, series="1.2"), ValueError, "series is for a DICOM folder"),
    "volume": (call(IMAGE, volume=2), ValueError, "volume is for a DICOM folder or file"),
    "SUV": (call(IMAGE, suv=True), ValueError, "suv is for a DICOM folder or file"),
    "SUV as a word": (call(IMAGE, suv="yes"), ValueError, "suv must be True or False"),
    "time": (call(IMAGE, time=1), ValueError, "only an OME-Zarr has levels, times and channels, and a 4D file times"),
    "geometry of an array": (call(make_placed(affine=np.eye(4))), TypeError, r"geometry of its own \(affine\)"),
    "spacing of an array": (call(make_placed(spacing=(1, 2, 3), meta={})), TypeError, r"own \(meta, spacing\)"),
    "level": (call(IMAGE, level=1), ValueError, "only an OME-Zarr has levels"),
    "unknown keyword": (call(IMAGE, angle=3), TypeError, r"^FUNCTION\(\) has no parameter angle$"),
    "misspelt keyword": (call(IMAGE, azimut=1), TypeError, "no parameter azimut: did you mean azimuth[?]"),
    "two spacings": (call(SHORTS, spacing=(1, 2)), ValueError, "spacing must be three finite numbers"),
    "zero spacing": (call(SHORTS, spacing=(1, 2, 0)), ValueError, "Zero-valued spacing"),
    "infinite origin": (call(SHORTS, origin=(1, 2, np.inf)), ValueError, "origin must be three finite"),
    "true origin": (call(SHORTS, origin=(1, 2, True)), ValueError, "origin must be three finite"),
    "true time": (call(IMAGE, time=True), ValueError, "time must be a whole number"),
    "true threads": (call(IMAGE, threads=True), ValueError, "threads must be a whole number"),
    "true angle": (call(IMAGE, azimuth=True), ValueError, "azimuth and elevation must be finite"),
    "true oversampling": (call(IMAGE, oversampling=True), ValueError, "oversampling cannot be True"),
    "singular direction": (call(SHORTS, direction=np.zeros((3, 3))), ValueError, "determinant is 0"),
    "long direction": (call(SHORTS, direction=2 * np.eye(3)), ValueError, "columns of length 1, but .* 2.0"),
    "words as direction": (call(SHORTS, direction="RAS"), ValueError, "direction must be 3 x 3"),
    "view": (call(IMAGE, "front"), ValueError, "one of anterior, posterior, .* but it is 'front'"),
    "enumerator": (call(IMAGE, 0), TypeError, "view must be one of"),
    "3 x 3": (call(IMAGE, np.eye(3)), ValueError, "a matrix as view must be 4 x 4"),
    "singular": (call(IMAGE, np.diag([1, 0, 1, 1])), ValueError, "view must be invertible"),
    "single precision": (call(IMAGE, make_affine(itk.F)), TypeError, "in double precision"),
    "list of views": (call(IMAGE, [make_affine(itk.D)] * 2), TypeError, "one itk.Transform"),
    "angle": (call(IMAGE, azimuth=np.nan), ValueError, "azimuth and elevation must be finite"),
    "angles": (call(IMAGE, azimuth=np.array([30.0])), ValueError, "azimuth and elevation must be finite"),
    "angle of a matrix": (call(IMAGE, np.eye(4), azimuth=3), ValueError, "for a view that is a name"),
    "mode": (call(IMAGE, mode="median"), ValueError, "mode must be one of maximum, minimum, absolute_maximum, mean"),
    "depth of a mean": (call(IMAGE, mode="mean", depth=True), ValueError, "^depth needs another mode"),
    "places of a mean": (call(IMAGE, mode="mean", places=True), ValueError, "^places needs another mode"),
    "exact mean": (call(IMAGE, mode="mean", exact=True), ValueError, "exact needs another mode: mode is mean"),
    "interpolation": (call(IMAGE, interpolation="cubic"), ValueError, "must be one of linear, nearest, but"),
    "nearest mean": (call(IMAGE, mode="mean", interpolation="nearest"), ValueError, "needs another mode"),
    "nearest and fading": (
        call(IMAGE, attenuation=0.1, interpolation="nearest"),
        ValueError,
        "exact, attenuation and oversampling must be as by default",
    ),
    "slab": (call(IMAGE, slab=5), ValueError, r"slab must be two numbers, \(near, far\)"),
    "slab's order": (call(IMAGE, slab=(5, 1)), ValueError, "slab's near must"),
    "crop": (call(IMAGE, crop=(1, 2, 3, 4, 5, 6)), ValueError, "crop must be two corners"),
    "mask's shape": (call(IMAGE, mask=SHORTS[1:]), ValueError, "shape .* Resample an image"),
    "number as a mask": (call(IMAGE, mask=3), TypeError, "^mask: .* but this is a builtins.int"),
    "mask's type": (call(IMAGE, mask=SHORTS * 0.5), TypeError, "whole numbers"),
    "OME-Zarr as a mask": (call(IMAGE, mask="cells.ome.zarr"), ValueError, "cells.ome.zarr is no OME-Zarr"),
    "label alone": (call(IMAGE, mask_label=1), ValueError, "mask_label is for a mask"),
    "labels": (call(SHORTS, mask=SHORTS, mask_label=[1, 7]), ValueError, "mask_label must be a whole number"),
    "label": (call(IMAGE, mask=SHORTS, mask_label=0), ValueError, "mask_label must be a whole"),
    "exact mask": (call(IMAGE, mask=SHORTS, exact=True), ValueError, "exact pictures have no mask"),
    "text as a flag": (call(IMAGE, exact="no"), ValueError, "exact must be True or False, but it is 'no'"),
    "file of depths": (call(IMAGE, depth="d.nrrd"), ValueError, "depth must be True or False"),
    "fading": (call(IMAGE, attenuation=-1), ValueError, "attenuation must be finite and not negative"),
    "local maximum": (call(IMAGE, local_maximum=1.5), ValueError, "local_maximum must be whole"),
    "local maximum of magnitudes": (
        call(IMAGE, local_maximum=1, mode="absolute_maximum"),
        ValueError,
        "local_maximum needs mode .* but mode is absolute_maximum",
    ),
    "switched local maximum": (call(IMAGE, local_maximum=False), ValueError, "local_maximum must be whole"),
    "text as local maximum": (call(IMAGE, local_maximum="3"), ValueError, "local_maximum must be whole"),
    "background": (call(IMAGE, background=70000), ValueError, "background must be whole"),
    "backgrounds": (call(IMAGE, background=np.arange(2)), ValueError, "background must be whole"),
    "oversampling": (call(IMAGE, oversampling=3), ValueError, "oversampling must be 1 or 2"),
    "output spacing": (call(IMAGE, output_spacing=0), ValueError, "output_spacing must be positive"),
    "size": (call(IMAGE, size=5), ValueError, "size must be two whole numbers"),
    "size beyond integers": (call(IMAGE, size=(10**20, 1)), ValueError, "size must be positive and fit"),
    "huge size": (call(IMAGE, size=(10**7, 10**7)), ValueError, "size must fit in memory"),
    "output origin": (call(IMAGE, output_origin=(0, np.nan)), ValueError, "output_origin must be two finite"),
    "many threads": (call(IMAGE, threads=2**40), ValueError, "threads cannot be"),
    "threads": (call(IMAGE, threads=0), ValueError, "threads must be a whole"),
}
# of turn() alone
BAD_TURN = {
    **{
        f"transforms and {name}": (
            call(IMAGE, transforms=["left"], **{name: value}),
            ValueError,
            f"^{name} cannot be given with transforms",
        )
        for name, value in {
            "view": np.eye(4),
            "azimuth": 1,
            "elevation": 1.0,
            "frames": 3,
            "rotation_axis": "left",
            "center": (0, 0, 0),
            "start_angle": 5,
            "angular_range": 90,
            "rocking": True,
        }.items()
    },
    "frames": (call(IMAGE, frames=0), ValueError, "frames must be from 1 to 65535"),
    "half a frame": (call(IMAGE, frames=1.5), ValueError, "frames cannot be 1.5"),
    "axis": (call(IMAGE, rotation_axis="z"), ValueError, "one of left, posterior, superior, i, j, k or a direction"),
    "zero axis": (call(IMAGE, rotation_axis=(0, 0, 0)), ValueError, "rotation_axis must be finite and not zero"),
    "center": (call(IMAGE, center=(1, 2)), ValueError, "center must be three finite numbers"),
    "range": (call(IMAGE, angular_range=np.inf), ValueError, "angular_range must be finite"),
    "angle of rocking": (call(IMAGE, rocking=60), ValueError, "rocking must be True or False, but it is 60"),
    "start": (call(IMAGE, start_angle="a"), ValueError, "start_angle cannot be 'a'"),
    "transforms": (call(IMAGE, transforms=[]), ValueError, "transforms must be a list of views"),
    "one transform": (call(IMAGE, transforms="left"), ValueError, "transforms must be a list of views, but .* 'left'"),
}


@pytest.mark.filterwarnings("ignore:left out")
@pytest.mark.parametrize(
    "function, bad, kind, text",
    [(mip, *bad) for bad in BAD.values()] + [(turn, *bad) for bad in (*BAD.values(), *BAD_TURN.values())],
    ids=[f"mip-{name}" for name in BAD] + [f"turn-{name}" for name in (*BAD, *BAD_TURN)],
)
def test_bad_input_is_one_clear_error(function, bad, kind, text):
    with pytest.raises(kind, match=text.replace("FUNCTION", function.__name__)) as caught:
        function(*bad.args, **bad.kwargs)
    assert str(caught.value).count("\n") <= 2
    assert "ITK ERROR" not in "".join(traceback.format_exception(caught.value))
    # the next call is as good as ever
    assert (np.asarray(mip(IMAGE)) == 1).all()


@pytest.mark.parametrize(
    "shape, text",
    [
        ((3, 4), "has 2 dimensions; 3 are needed, or 4 with time"),
        ((2, 3, 4, 5), "has 2 points in time: give the number of one, as time=0"),
        ((3, 4, 5, 2), "has 2 components"),
    ],
    ids=["2D", "4D", "vectors"],
)
def test_files_that_are_no_volume(shape, text, tmp_path):
    path = tmp_path / "image.nrrd"
    itk.imwrite(itk.image_from_array(np.ones(shape, np.float32), is_vector="components" in text), path)
    with pytest.raises(ValueError, match=text):
        mip(path)


def test_files_of_other_types(tmp_path):
    path = tmp_path / "image.mha"
    itk.imwrite(itk.image_from_array(SHORTS.astype(np.int32) * 40000), str(path))
    assert np.asarray(open_image(path)).dtype == np.float64
    # of one point in time
    itk.imwrite(itk.image_from_array(SHORTS[np.newaxis]), str(path))
    assert mip(path).shape == (3, 5)


def test_docstrings():
    for name in ("_front", "_inputs", "_places", "_viewer", "_views", "_volume", "_window", "_write"):
        module = importlib.import_module(f"itk_shearwarpmip.{name}")
        result = doctest.testmod(module, verbose=False)
        assert result.attempted and not result.failed
    more = itk_shearwarpmip.sample, itk_shearwarpmip.open_volume, itk_shearwarpmip.show
    for function in (mip, turn, open_image, save_png, *more):
        assert "Raises" in function.__doc__ and ">>>" in function.__doc__


# ---- Images that a pipeline makes


def make_pipeline(voxels, origin):
    image = open_image(voxels, origin=origin)
    made = itk.ShiftScaleImageFilter[type(image), type(image)].New(Input=image, Scale=1.0, Shift=0.0)
    made.image = image
    return made


def test_image_that_is_not_made_yet():
    voxels = np.random.default_rng(5).integers(0, 900, (9, 11, 14), np.int16)
    options = {"azimuth": 30, "slab": (-3, 3)}
    expected = mip(open_image(voxels, origin=(500, 300, -200)), **options)
    made = make_pipeline(voxels, (500, 300, -200))
    picture = mip(made.GetOutput(), **options)
    assert_array_equal(picture, expected)
    assert picture.GetOrigin() == expected.GetOrigin()
    made = make_pipeline(voxels, (7, 7, 7))
    placed = open_image(made.GetOutput(), spacing=(1, 1, 2))
    assert list(placed.GetOrigin()) == [7, 7, 7]


def test_pipeline_that_fails_is_an_error_each_time():
    reader = itk.ImageFileReader[itk.Image[itk.SS, 3]].New(FileName="/nonexistent.nrrd")
    broken = reader.GetOutput()
    outcomes = []

    def project():
        with pytest.raises(ValueError, match="pipeline"):
            mip(broken)
        outcomes.append(True)

    for _ in range(2):
        thread = threading.Thread(target=project, daemon=True)
        thread.start()
        thread.join(20)
    assert outcomes == [True, True]


@pytest.mark.parametrize("dtype, options", [(np.int32, {}), (np.int16, {"spacing": (1, 1, 2)}), (np.int16, {})])
def test_what_was_read_is_never_written(tmp_path, dtype, options):
    voxels = np.random.default_rng(5).integers(0, 900, (5, 6, 7)).astype(dtype)
    volume, mask = tmp_path / "volume.nrrd", tmp_path / "mask.nrrd"
    itk.imwrite(itk.image_from_array(voxels), volume)
    itk.imwrite(itk.image_from_array(np.ones(voxels.shape, np.uint8)), mask)
    series = turn(volume, frames=2, mask=None if options else mask, **options)
    for path in (volume,) if options else (volume, mask):
        before = path.read_bytes()
        with pytest.raises(ValueError, match="this call reads it"):
            series.save(path)
        assert path.read_bytes() == before


def test_what_nibabel_has_read_is_never_written(tmp_path):
    path = tmp_path / "volume.nii"
    nibabel.save(nibabel.Nifti1Image(np.ones((5, 6, 7), np.int16), np.eye(4)), path)
    with pytest.raises(ValueError, match="this call reads it"):
        turn(nibabel.load(path), frames=2).save(path)


@pytest.mark.parametrize("size", [(1, 9), (9, 1), (1, 1)])
def test_pictures_of_one_column(tmp_path, size):
    voxels = np.random.default_rng(5).integers(0, 900, (5, 6, 7), np.int16)
    series = turn(voxels, frames=3, size=size)
    series.save(tmp_path / "turn.nrrd")
    assert_array_equal(itk.imread(tmp_path / "turn.nrrd"), series.frames)
    series.save(tmp_path / "turn.png")
    assert np.asarray(itk.imread(tmp_path / "turn-000.png")).reshape(size[::-1]).shape == size[::-1]
    picture = mip(open_image(voxels), size=size)
    (tmp_path / "picture.png").write_bytes(picture._repr_png_())
    image = itk.ImageIOFactory.CreateImageIO(str(tmp_path / "picture.png"), itk.CommonEnums.IOFileMode_ReadMode)
    image.SetFileName(str(tmp_path / "picture.png"))
    image.ReadImageInformation()
    assert (image.GetDimensions(0), image.GetDimensions(1)) == size


def test_background_of_double_precision():
    voxels = np.random.default_rng(5).normal(0, 100, (5, 6, 7))
    # no number of single precision
    voxels[0, 0, :2] = -1000.1, np.nan
    image = open_image(voxels)
    for shown in (mip(image, azimuth=30), turn(image, azimuth=30, frames=2).frames):
        pixels = np.asarray(shown)
        assert shown["Background"] == -1000.1 and (pixels == -1000.1).any()
        assert find_window(shown) == find_window_of(pixels, -1000.1)
        assert find_window(shown)[0] > -1000
    assert mip(open_image(np.full((2, 3, 4), -1e308)))._repr_png_()


def test_window_of_large_constants():
    low, high = turn(np.full((3, 4, 5), 1e20), frames=2).window
    assert low < high == 1e20


def test_metadata_lives_without_the_source(tmp_path):
    image = itk.image_from_array(np.ones((3, 4, 5), np.int16))
    image["name"] = "head"
    series = turn(image, frames=2)
    del image
    assert series.source_metadata["name"] == "head"
    assert all(isinstance(value, str | int | float) for value in series.source_metadata.values())
    assert repr(series) == "<Turn of 2 frames, 5 x 3 pixels>"


def test_picture_as_png(tmp_path):
    picture = mip(open_image(np.arange(60, dtype=np.int16).reshape(3, 4, 5)), "superior")
    path = tmp_path / "picture.png"
    for each in (path, tmp_path / "PICTURE.PNG"):
        save_png(picture, each)
        assert each.read_bytes() == picture._repr_png_()
    save_png(picture, path, window=(40, 59))
    assert_array_equal(itk.imread(path), np.floor(255 * (np.asarray(picture).clip(40, 59) - 40) / 19 + 0.5))
    link = tmp_path / "link.png"
    link.symlink_to(path)
    save_png(picture, link)
    assert link.is_symlink() and path.read_bytes() == picture._repr_png_()
    for wrong, text in (
        (tmp_path / ".png", "must be a name that ends in .png"),
        (tmp_path / "none" / "x.png", "cannot write"),
    ):
        with pytest.raises((OSError, ValueError), match=text):
            save_png(picture, wrong)
    for other in (np.asarray(picture), (picture, picture), turn(SHORTS, frames=1), None):
        with pytest.raises(
            TypeError, match=r"a picture is an itk.Image, but this is a .*: of an array mip\(open_image"
        ):
            save_png(other, path)
    for other in (IMAGE, itk.Image[itk.UC, 2].New()):
        with pytest.raises(ValueError, match="a picture has 2 dimensions and pixels"):
            save_png(other, path)

"""The projection of chunked volumes, against the filter on the whole volume."""

import hashlib
import http.server
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import dask
import dask.array
import itk
import ngff_zarr
import numpy as np
import pytest
import xarray
import zarr
from dask.utils import key_split
from distributed import Client, LocalCluster, get_task_stream, wait
from itk_shearwarpmip import mip, open_image, open_volume, show, turn
from itk_shearwarpmip.__main__ import main
from numpy.testing import assert_array_equal
from rendercanvas.offscreen import RenderCanvas
from samples import make_image, needs_posix

DTYPES = [np.uint8, np.int16, np.uint16, np.float32, np.float64]
IDENTITY = itk.IdentityTransform[itk.D, 3].New()
GEOMETRY = {
    "spacing": (0.7, 1.1, 2.3),
    "origin": (-12.0, 5.0, 31.0),
    "direction": [[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]],
}


@pytest.fixture(autouse=True)
def synchronous():
    with dask.config.set(scheduler="synchronous"):
        yield


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(n_workers=2, threads_per_worker=1, memory_limit="1GB", dashboard_address=":0") as local:
        yield local


@pytest.fixture
def client(cluster):
    with dask.config.set(scheduler=None), Client(cluster) as connected:
        yield connected


def make_array(generator, shape, dtype=np.uint16):
    if np.issubdtype(dtype, np.floating):
        return generator.normal(size=shape).astype(dtype)
    limits = np.iinfo(dtype)
    return generator.integers(limits.min, limits.max, shape, dtype, endpoint=True)


def make_chunks(generator, shape, most):
    chunks = []
    for length in shape:
        lengths = []
        while sum(lengths) < length:
            lengths.append(min(int(generator.integers(1, most + 1)), length - sum(lengths)))
        chunks.append(tuple(lengths))
    return tuple(chunks)


def make_view(generator):
    view = itk.Euler3DTransform[itk.D].New()
    view.SetRotation(*generator.uniform(-np.pi, np.pi, 3))
    view.SetTranslation(generator.uniform(-20, 20, 3).tolist())
    return view


def project_whole(array, view=None, **geometry):
    """By the filter."""
    return itk.shear_warp_mip_image_filter(make_image(array, **geometry), transform=view or IDENTITY)


def project(volume, view=None, background=0, **options):
    """By default what the filter does: along z, on 0."""
    return mip(volume, np.eye(4) if view is None else view, background=background, **options)


def project_turn(volume, transforms=None, background=0, number_of_frames=36, rotation_axis=(0, 0, 1), **options):
    """By default what the filter does: upright, on 0."""
    options["background"] = background
    if transforms is not None:
        return turn(volume, transforms=transforms, **options).frames
    outline = open_volume(volume, **{key: options[key] for key in GEOMETRY if key in options}).make_image()
    upright = itk.ShearWarpMIPView.MakeUprightTransform(outline, rotation_axis)
    return turn(volume, upright, rotation_axis=rotation_axis, frames=number_of_frames, **options).frames


def assert_same(picture, expected):
    assert np.asarray(picture).tobytes() == np.asarray(expected).tobytes()
    assert picture.GetLargestPossibleRegion() == expected.GetLargestPossibleRegion()
    assert tuple(picture.GetSpacing()) == tuple(expected.GetSpacing())
    assert tuple(picture.GetOrigin()) == tuple(expected.GetOrigin())


@pytest.mark.parametrize("dtype", DTYPES)
def test_random_chunks_give_the_bits_of_the_whole(dtype):
    generator = np.random.default_rng(1)
    for repeat in range(12):
        thin = repeat % 4 == 0
        array = make_array(generator, generator.integers(1, 9 if thin else 40, 3), dtype)
        view = make_view(generator)
        oversampling = 1 + repeat % 2
        chunked = dask.array.from_array(array, make_chunks(generator, array.shape, 2 if thin else 20))
        picture = project(chunked, view, oversampling=oversampling, background=9, output_spacing=0.6, **GEOMETRY)
        whole = itk.shear_warp_mip_image_filter(
            make_image(array, **GEOMETRY),
            transform=view,
            oversampling=oversampling,
            default_pixel_value=9,
            output_spacing=[0.6, 0.6],
        )
        assert_same(picture, whole)
        assert picture["BytesSent"] > 0


RULES = {
    "minimum": {"mode": "minimum"},
    "absolute maximum": {"mode": "absolute_maximum", "depth": True},
    "mean": {"mode": "mean"},
    "mean of a slab": {"mode": "mean", "slab": (-9, 12), "oversampling": 2},
    "slab and box": {"slab": (-15, 30), "crop": ((-20, -30, -np.inf), (50, 40, 90))},
    "depth": {"depth": True, "oversampling": 2},
    "nearest": {"interpolation": "nearest"},
    "exact": {"exact": True},
    "exact minimum": {"exact": True, "mode": "minimum", "slab": (-15, 30), "depth": True},
}


def make_random_chunks(generator, dtype, thin):
    array = make_array(generator, generator.integers(1, 9 if thin else 40, 3), dtype)
    # many samples are equal
    array = array if generator.integers(2) else (array % 3 if dtype != np.float32 else np.round(array))
    return array, dask.array.from_array(array, make_chunks(generator, array.shape, 2 if thin else 15))


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
def test_every_rule_has_the_bits_of_the_whole(rule, dtype):
    generator = np.random.default_rng(21)
    for repeat in range(6):
        array, chunked = make_random_chunks(generator, dtype, repeat % 3 == 0)
        view = make_view(generator)
        options = {"view": view, "background": 9, "output_spacing": 0.9, **GEOMETRY, **rule}
        if dtype == np.float32 and rule.get("mode") == "mean":
            with pytest.raises(ValueError, match="no mode mean of floating-point pixels"):
                mip(chunked, **options)
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pictures, whole = mip(chunked, **options), mip(array, geometry=True, **options)
        if not rule.get("depth"):
            pictures, whole = [pictures], [whole]
        for each, expected in zip(pictures, whole, strict=True):
            assert_same(each, expected)
            assert each["Background"] == expected["Background"] or np.isnan(each["Background"])


@pytest.mark.parametrize("name", ["mean", "exact minimum", "slab and box"])
def test_a_turn_by_another_rule(name):
    """With views along all axes."""
    array, chunked = make_random_chunks(np.random.default_rng(22), np.int16, False)
    options = {"frames": 7, "azimuth": 20, "elevation": 40, "rotation_axis": (0.6, 0.0, 0.8), **RULES[name], **GEOMETRY}
    frames, whole = turn(chunked, **options), turn(array, **options)
    assert_same(frames.frames, whole.frames)
    assert (frames.mode, frames.slab) == (whole.mode, whole.slab)
    assert (frames.depths is None) == (whole.depths is None)
    if frames.depths is not None:
        assert_same(frames.depths, whole.depths)


def test_places_of_chunks():
    array, chunked = make_random_chunks(np.random.default_rng(23), np.int16, False)
    picture, places = mip(chunked, "left", places=True, **GEOMETRY)
    expected, of_whole = mip(array, "left", places=True, **GEOMETRY)
    assert_array_equal(np.asarray(picture), expected)
    assert_array_equal(places, of_whole)
    assert_array_equal(turn(chunked, frames=3, places=True).places, turn(array, frames=3, places=True).places)
    with pytest.warns(UserWarning, match="there is only background"):
        mip(chunked, slab=(1e5, 2e5))


def test_rules_on_a_cluster(client):
    array = make_array(np.random.default_rng(24), (50, 40, 30), np.int16)
    chunked = dask.array.from_array(array, 8)
    for rule in (RULES["mean"], RULES["exact"]):
        for source in (chunked, chunked.persist()):
            assert_same(mip(source, "left", azimuth=20, **rule), mip(array, "left", azimuth=20, geometry=True, **rule))


def test_the_grid_is_as_the_filters():
    array = make_array(np.random.default_rng(2), (20, 30, 40))
    grid = {"size": [33, 22], "output_spacing": [0.9, 1.3], "output_origin": [2.0, -3.0]}
    whole = itk.shear_warp_mip_image_filter(make_image(array), **grid)
    assert_same(project(dask.array.from_array(array, 16), **grid), whole)
    assert_same(project(open_volume(array), **grid), whole)


@pytest.mark.parametrize("scheduler", ["threads", "processes"])
def test_schedulers_of_one_computer(scheduler):
    array = make_array(np.random.default_rng(3), (50, 40, 30))
    view = make_view(np.random.default_rng(3))
    with dask.config.set(scheduler=scheduler):
        assert_same(project(dask.array.from_array(array, 16), view), project_whole(array, view))


def test_cine_is_as_the_filters():
    array = make_array(np.random.default_rng(4), (20, 24, 28))
    chunked = dask.array.from_array(array, 12)
    turn = {"number_of_frames": 7, "rotation_axis": [0.0, 0.6, 0.8], "angular_range": 3.0, "start_angle": 0.3}
    whole = itk.shear_warp_mip_cine_image_filter(make_image(array, **GEOMETRY), rocking=True, **turn)
    assert_same(project_turn(chunked, rocking=True, **turn, **GEOMETRY), whole)
    frames = project_turn(chunked)
    whole = itk.shear_warp_mip_cine_image_filter(make_image(array))
    assert_same(frames, whole)
    assert frames["FrameAngles"] == whole["FrameAngles"]
    assert frames["BytesSent"] > 0
    views = [make_view(np.random.default_rng(n)) for n in range(3)]
    whole = itk.shear_warp_mip_cine_image_filter(make_image(array), transforms=views)
    assert_same(project_turn(chunked, views), whole)


def test_voxels_of_the_other_byte_order():
    array = make_array(np.random.default_rng(5), (9, 10, 11))
    assert_same(project(dask.array.from_array(array.astype(">u2"), 6)), project_whole(array))


def test_empty_chunks_take_no_part():
    array = make_array(np.random.default_rng(11), (9, 10, 11))
    chosen = np.arange(9) > 6
    holed = dask.array.from_array(array, 3)[dask.array.from_array(chosen, 3)].compute_chunk_sizes()
    assert 0 in holed.chunks[0]
    assert_same(project(holed), project_whole(array[chosen]))


def test_only_what_was_touched_is_sent():
    volume = dask.array.zeros((64, 64, 64), dtype=np.uint8, chunks=16)
    # each chunk; boxes of 2 x 2 x 2, with the seams to those before; then all
    assert project(volume)["BytesSent"] == 64 * 16 * 16 + 2 * (32 + 33) ** 2 + 64 * 64


@pytest.mark.parametrize("shape", [(5, 6, 1), (5, 1, 6), (7, 1, 1), (1, 1, 1)])
@pytest.mark.parametrize("arrange", [np.asarray, np.asfortranarray])
def test_thin_pictures_and_orders_in_memory(shape, arrange):
    array = make_array(np.random.default_rng(16), shape)
    for chunked in (dask.array.from_array(arrange(array), 2), open_volume(arrange(array))):
        assert np.array_equal(np.asarray(project(chunked)), array.max(axis=0))
    frames = project_turn(dask.array.from_array(arrange(array), 2), [IDENTITY])
    assert np.array_equal(np.asarray(frames), array.max(axis=0)[np.newaxis])


def test_images_keep_their_geometry():
    array = make_array(np.random.default_rng(17), (12, 11, 10))
    image = make_image(array, **GEOMETRY)
    view = make_view(np.random.default_rng(17))
    labelled = itk.xarray_from_image(image)
    for each in (image, labelled, labelled.transpose("x", "y", "z"), labelled.chunk(5)):
        volume = open_volume(each)
        assert np.array_equal(volume.array.compute(), array)
        assert np.allclose(volume.spacing, GEOMETRY["spacing"], rtol=1e-14)
        assert np.allclose(volume.origin, GEOMETRY["origin"], rtol=1e-14)
        assert np.array_equal(volume.direction, GEOMETRY["direction"])
    assert_same(project(open_volume(image), view), project_whole(array, view, **GEOMETRY))
    # a region that does not begin at 0
    region = image.GetLargestPossibleRegion()
    region.SetIndex([3, -2, 5])
    image.SetRegions(region)
    assert np.allclose(open_volume(image).origin, image.TransformIndexToPhysicalPoint([3, -2, 5]))
    # what is given goes before
    assert open_volume(image, spacing=(1, 2, 3)).spacing == (1, 2, 3)
    # without coordinates
    assert open_volume(xarray.DataArray(array, dims=tuple("zyx"))).spacing == (1, 1, 1)


def test_voxels_keep_their_image():
    array = open_volume(make_image(np.full((64, 256, 256), 7, np.int16), **GEOMETRY)).array
    others = [np.full((64, 256, 256), n, np.int16) for n in range(4)]
    assert (array == 7).all().compute() and len(others) == 4


def test_volumes_can_be_compared():
    volume = open_volume(np.ones((2, 2, 2), np.uint8))
    assert volume == volume
    assert volume != open_volume(np.ones((2, 2, 2), np.uint8))
    assert len({volume, volume}) == 1


CHUNKED = dask.array.zeros((8, 8, 8), dtype=np.uint8, chunks=-1)

# for volumes in chunks; test_front.py has the entries for other volumes
BAD = {
    "type": (lambda: project(CHUNKED.astype(np.int64)), TypeError, "voxels must be one of .* but they are int64"),
    "2D": (lambda: project(CHUNKED[0]), ValueError, "has the shape"),
    "empty": (lambda: project(CHUNKED[:0]), ValueError, "must not be empty"),
    "two spacings": (lambda: project(CHUNKED, spacing=(1, 2)), ValueError, "spacing must be three finite numbers"),
    "zero spacing": (lambda: project(CHUNKED, spacing=(1, 2, 0)), ValueError, "spacing is not supported"),
    "level": (lambda: project(CHUNKED, level=1), ValueError, "no levels"),
    "time": (lambda: project(CHUNKED, time=1), ValueError, "no levels, times and channels"),
    "channel": (lambda: project(open_volume(CHUNKED), channel=1), ValueError, "no levels, times and channels"),
    "oversampling": (lambda: project(CHUNKED, oversampling=3), ValueError, "oversampling must be 1 or 2"),
    "no oversampling": (lambda: project(CHUNKED, oversampling=-1), ValueError, "oversampling cannot be -1"),
    "fraction": (lambda: project(CHUNKED, background=1.5), ValueError, "background must be whole, .* but it is 1.5"),
    "no number": (
        lambda: project(CHUNKED, background=np.nan),
        ValueError,
        "background must be whole, .* but it is nan",
    ),
    "large": (lambda: project(CHUNKED, background=256), ValueError, "background must be whole, .* but it is 256"),
    "frames": (lambda: project_turn(CHUNKED, number_of_frames=-1), ValueError, "frames cannot be -1"),
    "masked": (lambda: project(dask.array.ma.masked_less(CHUNKED, 1)), TypeError, "loses its mask"),
    "zarr": (
        lambda: project(zarr.create_array({}, data=np.ones((8,) * 3))),
        TypeError,
        "this is a zarr.*Array: give an array",
    ),
    "DataArray": (lambda: project(xarray.DataArray(CHUNKED)), ValueError, "must have the dimensions z, y, x"),
    "output spacing": (lambda: project(CHUNKED, output_spacing=-1), ValueError, "output_spacing must be positive"),
    "size": (lambda: project(CHUNKED, size=(0, 4)), ValueError, "size must be positive"),
    "mode": (lambda: mip(CHUNKED, mode="least"), ValueError, "mode must be one of maximum, minimum"),
    "fading": (
        lambda: mip(CHUNKED, attenuation=0.1, local_maximum=3),
        ValueError,
        "attenuation, local_maximum cannot be given .* in chunks",
    ),
    "mean": (
        lambda: mip(CHUNKED.astype(np.float32), mode="mean"),
        ValueError,
        "Parts have no mode mean of floating-point pixels",
    ),
    "means": (lambda: turn(CHUNKED.astype(np.float64), mode="mean"), ValueError, "Parts have no mode mean"),
    "mean depth": (lambda: turn(CHUNKED, mode="mean", depth=True), ValueError, "depth needs another mode"),
    "exact": (lambda: mip(CHUNKED, exact=True, oversampling=2), ValueError, "exact pictures|Exact pictures"),
    "mask": (lambda: mip(CHUNKED, mask=np.ones((8,) * 3, bool)), ValueError, "mask cannot be given for .* in chunks"),
    "series": (lambda: turn(CHUNKED, series="1.2"), ValueError, "series is for a DICOM folder"),
    "unknown sizes": (lambda: project(CHUNKED[CHUNKED[:, 0, 0] == 0]), ValueError, "must be known"),
    "keyword": (lambda: project(CHUNKED, colour=1), TypeError, "colour"),
}


@pytest.mark.parametrize("spoil, kind, text", BAD.values(), ids=BAD)
def test_bad_input_is_named(spoil, kind, text):
    with pytest.raises(kind, match=text):
        spoil()


# the finest level of the OME-Zarr
WRITTEN = {"spacing": (2, 2, 4), "origin": (7, -50, 100)}


@pytest.fixture(scope="module", params=["0.4", "0.5"])
def written(request, tmp_path_factory):
    array = make_array(np.random.default_rng(6), (2, 40, 48, 64))
    image = ngff_zarr.to_ngff_image(
        array,
        dims=["c", "z", "y", "x"],
        scale={"z": 4.0, "y": 2.0, "x": 2.0},
        translation={"z": 100.0, "y": -50.0, "x": 7.0},
        axes_units=dict.fromkeys("zyx", "micrometer"),
    )
    path = tmp_path_factory.mktemp("written") / "image.ome.zarr"
    ngff_zarr.to_ngff_zarr(str(path), ngff_zarr.to_multiscales(image, [2, 4], chunks=16), version=request.param)
    return path, array


@pytest.fixture
def ome_zarr(written, tmp_path):
    """Three levels of a volume of 2 channels, with 64 voxels of 2 x 2 x 4 micrometres along x."""
    path, array = written
    return shutil.copytree(path, tmp_path / path.name), array


def test_ome_zarr(ome_zarr):
    path, array = ome_zarr
    view = make_view(np.random.default_rng(7))
    for source in (path, str(path), zarr.open_group(path, mode="r")):
        volume = open_volume(source, channel=1)
        assert volume.unit == "micrometer"
        with dask.config.set({"array.chunk-size": "30kB"}):
            picture = project(source, view, channel=1)
        assert_same(picture, project_whole(array[1], view, **WRITTEN))
    with pytest.raises(ValueError, match="has 2 along the axis c, but not number 2"):
        project(path, channel=2)
    with pytest.raises(ValueError, match="has no axis t"):
        project(path, time=1)
    with pytest.raises(ValueError, match="levels 0 to 2, but not 3"):
        project(path, level=3)


def test_ome_zarr_in_memory(ome_zarr):
    """For the viewer, and for modes that chunks do not have."""
    path, array = ome_zarr
    whole = make_image(array[1], **WRITTEN)
    for source in (path, zarr.open_group(path, mode="r"), open_volume(path, channel=1)):
        image = open_image(source, **({} if source.__class__.__name__ == "Volume" else {"level": 0, "channel": 1}))
        assert_same(image, whole)
        assert image["Unit"] == "micrometer" and image["HasOrientation"] == "0"
    masked = (mip(image, mask=each) for each in (open_volume(path, channel=0), array[0]))
    assert_array_equal(*map(np.asarray, masked))
    with pytest.raises(ValueError, match="a mask must be on the volume's grid: a corner is"):
        mip(image, mask=open_volume(path, origin=(0, 0, 0)))
    with pytest.raises(ValueError, match="has the levels 0, the finest, to 2: give one, as level=1"):
        open_image(path)
    viewer = show(path, level=1, channel=1, slab=(-20, 20), canvas=RenderCanvas(size=(80, 60)))
    assert viewer.code.startswith(f"mip(open_image({str(path)!r}, level=1, channel=1), ") and "slab=[-20" in viewer.code
    found = eval(viewer.code, {"mip": mip, "open_image": open_image})
    assert_array_equal(found, viewer.project())
    with pytest.raises(ValueError, match="no command"):
        print(viewer.command)
    viewer.close()


def test_an_opened_volume_keeps_its_place(ome_zarr):
    path, array = ome_zarr
    view = make_view(np.random.default_rng(14))
    volume = open_volume(path, channel=1, direction=GEOMETRY["direction"])
    persisted = volume.persist()
    assert persisted.array.dask is not volume.array.dask
    assert persisted.unit == "micrometer"
    place = WRITTEN | {"direction": GEOMETRY["direction"]}
    for each in (volume, persisted):
        assert_same(project(each, view), project_whole(array[1], view, **place))
    wider = project(persisted, view, spacing=(3, 4, 5))
    assert_same(wider, project_whole(array[1], view, **place | {"spacing": (3, 4, 5)}))
    with pytest.raises(ValueError, match="no levels"):
        project(volume, level=1)


def test_the_level_is_the_coarsest_that_is_fine_enough(ome_zarr):
    path, _ = ome_zarr
    for output_spacing, columns in ((None, 64), (1, 64), (2, 64), (3.9, 64), (4, 32), ((4, 9), 32), (8, 16), (100, 16)):
        assert open_volume(path, output_spacing=output_spacing).array.shape[2] == columns
    assert open_volume(path, level=1, output_spacing=1).array.shape[2] == 32
    level = open_volume(path, level=1)
    assert level.spacing[0] == 4
    # the centers of the voxels move with their size
    assert level.origin[0] == pytest.approx(8)


@contextmanager
def edit(path):
    """The metadata of the image, to be changed."""
    group = zarr.open_group(path, mode="r+")
    attributes = group.attrs.asdict()
    yield attributes.get("ome", attributes)["multiscales"][0]
    group.attrs.update(attributes)


def set_units(path, **units):
    with edit(path) as image:
        for axis in image["axes"]:
            axis.pop("unit", None)
            if units.get(axis["name"]):
                axis["unit"] = units[axis["name"]]


@pytest.mark.parametrize(
    "units, spacing, origin",
    [
        (dict.fromkeys("xyz"), (2, 2, 4), (7, -50, 100)),
        (dict.fromkeys("xyz", "cubit"), (2, 2, 4), (7, -50, 100)),
        ({"x": "micrometer", "y": "nanometer", "z": "millimeter"}, (2, 0.002, 4000), (7, -0.05, 100_000)),
        ({"x": "millimeter", "y": "inch", "z": "angstrom"}, (2, 50.8, 4e-7), (7, -1270, 1e-5)),
    ],
    ids=["none", "unknown", "metric", "others"],
)
def test_units_of_axes(ome_zarr, units, spacing, origin):
    path, _ = ome_zarr
    set_units(path, **units)
    volume = open_volume(path)
    assert volume.unit == units["x"]
    assert volume.spacing == pytest.approx(spacing, rel=1e-15)
    assert volume.origin == pytest.approx(origin, rel=1e-15)
    # levels are chosen by what they are in that unit
    finest = min(spacing)
    assert open_volume(path, output_spacing=2 * finest).array.shape[2] == 32


@pytest.mark.parametrize("z", [None, "cubit"])
def test_units_that_cannot_be_compared(ome_zarr, z):
    path, _ = ome_zarr
    set_units(path, x="micrometer", y="micrometer", z=z)
    with pytest.raises(ValueError, match=r"units .* which cannot be compared"):
        open_volume(path)


BROKEN = {
    "an axis without name": lambda image: image["axes"][1].pop("name"),
    "no datasets": lambda image: image.pop("datasets"),
    "empty datasets": lambda image: image.update(datasets=[]),
    "no path": lambda image: image["datasets"][0].pop("path"),
    "no such path": lambda image: image["datasets"][0].update(path="nowhere"),
    "no type": lambda image: image["datasets"][0]["coordinateTransformations"][0].pop("type"),
    "no scale": lambda image: image["datasets"][0]["coordinateTransformations"][0].pop("scale"),
    "a short scale": lambda image: image["datasets"][0]["coordinateTransformations"][0].update(scale=[1, 1, 1]),
    "a small affine": lambda image: image.update(coordinateTransformations=[{"type": "affine", "affine": TURN}]),
    "words as scale": lambda image: image["datasets"][0]["coordinateTransformations"][0].update(scale=["a"] * 4),
    "a number as transformations": lambda image: image["datasets"][0].update(coordinateTransformations=3),
    "too many axes": lambda image: image["axes"].insert(0, {"name": "t"}),
}


@pytest.mark.parametrize("spoil", BROKEN.values(), ids=BROKEN)
def test_broken_metadata_is_one_line(ome_zarr, spoil, tmp_path, capsys):
    path, _ = ome_zarr
    with edit(path) as image:
        spoil(image)
    with pytest.raises(ValueError, match=r"image\.ome\.zarr has broken metadata"):
        open_volume(path)
    check_error(capsys, "image.ome.zarr has broken metadata", path, tmp_path / "mip.mha")


def test_transformations_of_all_levels_come_after_those_of_each(ome_zarr):
    path, _ = ome_zarr
    before = open_volume(path, level=1)
    with edit(path) as image:
        image["coordinateTransformations"] = [
            {"type": "scale", "scale": [1.0, 2.0, 3.0, 4.0]},
            {"type": "translation", "translation": [0.0, 10.0, 20.0, 30.0]},
        ]
    after = open_volume(path, level=1)
    factors, offsets = np.array([4, 3, 2]), np.array([30, 20, 10])
    assert np.allclose(after.spacing, factors * before.spacing)
    assert np.allclose(after.origin, factors * before.origin + offsets)


# of the axes c, z, y, x: slices move along y, as of a tilted light sheet
SHEAR = [[1.0, 0, 0, 0, 0], [0, 0.5, 0, 0, 3], [0, 0.75, 1, 0, -7], [0, 0, 0, 1, 11]]
TURN = [[1.0, 0, 0, 0], [0, 0.8, 0.6, 0], [0, -0.6, 0.8, 0], [0, 0, 0, 1]]
MATRICES = {
    "affine": ([{"type": "affine", "affine": SHEAR}], SHEAR),
    "rotation": ([{"type": "rotation", "rotation": TURN}], np.column_stack([TURN, np.zeros(4)])),
    "sequence": (
        [{"type": "sequence", "transformations": [{"type": "affine", "affine": SHEAR}, {"type": "identity"}]}],
        SHEAR,
    ),
    "mirror": ([{"type": "scale", "scale": [1, 1, -1, 1]}], np.diag([1.0, 1, -1, 1, 0])[:4]),
}


@pytest.mark.parametrize("steps, matrix", MATRICES.values(), ids=MATRICES)
def test_a_file_states_how_its_volume_is_sheared(ome_zarr, steps, matrix):
    path, array = ome_zarr
    levels = [open_volume(path, level=level) for level in range(3)]
    with edit(path) as image:
        image["coordinateTransformations"] = steps
    for level, before in enumerate(levels):
        volume = open_volume(path, level=level, channel=1)
        outlines = [each.make_image() for each in (before, volume)]
        for index in ([0, 0, 0], [5, 0, 0], [0, 7, 0], [0, 0, 3], [4, 5, 6]):
            x, y, z = outlines[0].TransformIndexToPhysicalPoint(index)
            expected = (np.asarray(matrix) @ [0, z, y, x, 1])[:0:-1]
            assert list(outlines[1].TransformIndexToPhysicalPoint(index)) == pytest.approx(expected)
    view = make_view(np.random.default_rng(8))
    finest = open_volume(path, channel=1)
    place = {"spacing": finest.spacing, "origin": finest.origin, "direction": finest.direction}
    assert_same(project(path, view, channel=1), project_whole(array[1], view, **place))
    assert_same(open_image(path, level=0, channel=1), make_image(array[1], **place))


def test_the_level_of_a_sheared_volume_is_chosen_by_its_voxels(ome_zarr):
    path, _ = ome_zarr
    with edit(path) as image:
        image["coordinateTransformations"] = MATRICES["affine"][0]
    # along z 4 * |(0.5, 0.75)|; x and y stay 2
    assert open_volume(path).spacing == pytest.approx((2, 2, 4 * np.hypot(0.5, 0.75)))
    for output_spacing, columns in ((1, 64), (3.9, 64), (4, 32), (8, 16)):
        assert open_volume(path, output_spacing=output_spacing).array.shape[2] == columns


@pytest.mark.parametrize(
    "step, text",
    [
        ({"type": "mapAxis", "mapAxis": [0, 1, 3, 2]}, "has a transformation of type 'mapAxis', which cannot be read"),
        ({"type": "affine", "affine": SHEAR[1:] + SHEAR[:1]}, "other places for other points in time or channels"),
    ],
)
def test_places_that_cannot_be_read_are_refused(ome_zarr, step, text, tmp_path, capsys):
    path, _ = ome_zarr
    with edit(path) as image:
        image["coordinateTransformations"] = [step]
    with pytest.raises(OSError, match=text):
        open_volume(path)
    check_error(capsys, text, path, tmp_path / "mip.mha")


def find_chunks(path):
    return sorted(file for file in path.rglob("*") if file.is_file() and not file.name.startswith((".z", "zarr.json")))


def test_a_corrupt_chunk_is_named_and_a_missing_one_is_empty(ome_zarr):
    path, array = ome_zarr
    finest = zarr.open_group(path, mode="r")
    name = finest.attrs.asdict().get("ome", finest.attrs.asdict())["multiscales"][0]["datasets"][0]["path"]
    chunk = find_chunks(path / name)[0]
    chunk.write_bytes(b"no chunk")
    with pytest.raises(OSError, match=r"voxels \[0, 0:.*\] of .*image\.ome\.zarr.* cannot be read"):
        project(path, level=0)
    chunk.unlink()
    expected = array[0].copy()
    stored = zarr.open_group(path, mode="r")[name]
    lengths = stored.chunks[1:]
    expected[: lengths[0], : lengths[1], : lengths[2]] = 0
    assert_same(project(path, level=0), project_whole(expected, **WRITTEN))


def check_error(capsys, text, *arguments):
    """One line."""
    assert main([*map(str, arguments), "--quiet"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("itk_shearwarpmip: ") and error.count("\n") == 1
    assert text in error


def test_program(ome_zarr, tmp_path, capsys):
    path, array = ome_zarr
    output = tmp_path / "mip.mha"
    command = [sys.executable, "-m", "itk_shearwarpmip", path, output, "--channel", "1", "--quiet"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not done.stdout + done.stderr
    assert np.array_equal(np.asarray(itk.imread(output)), array[1].max(axis=0))

    assert main([str(path), str(output), "--frames", "5", "--level", "1"]) == 0
    assert "100%" in capsys.readouterr().out
    assert itk.imread(output).shape[0] == 5
    assert main([str(path), str(output), "--output-spacing", "3", "--quiet"]) == 0
    assert list(itk.imread(output).GetSpacing()) == [3, 3]
    check_error(capsys, "levels 0 to 2", path, output, "--level", 9)
    check_error(capsys, "none.zarr is no OME-Zarr", tmp_path / "none.zarr", output)
    with pytest.raises(SystemExit, match="2"):
        main([])
    assert "usage" in capsys.readouterr().err
    # the word of what it does
    output.unlink()
    assert main(["mip", str(path), str(output), "--channel", "1", "--quiet"]) == 0
    assert np.array_equal(np.asarray(itk.imread(output)), array[1].max(axis=0))
    check_error(capsys, "mip.mha' is another file: use shear-warp-mip\n", "mip", output, tmp_path / "other.mha")


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["--frames", -1], "frames cannot be -1"),
        (["--frames", 0], "frames must be from 1 to 65535, but it is 0."),
        (["--output-spacing", -1], "output_spacing must be positive and finite, but it is"),
        (["--time", 1], "has no axis t"),
        (["--scheduler", "nonsense:"], ""),
    ],
)
def test_errors_of_the_program_are_one_line(ome_zarr, arguments, text, tmp_path, capsys):
    path, _ = ome_zarr
    output = tmp_path / "mip.mha"
    check_error(capsys, text, path, output, *arguments)
    assert not output.exists()


@pytest.mark.parametrize(
    "name, options, text",
    [
        ("mip.xyz", [], "ITK writes no image of the name '"),
        ("none/mip.mha", [], "' is no folder that files can be written into"),
        ("", [], "ITK writes no image of the name ''"),
        ("turn.png", ["--frames", "3"], "--frames needs OUTPUT to end in .mha, .nrrd, .nii.gz or .tif: '"),
        ("turn.JPG", ["--frames", "3"], "/turn.JPG' would hold one frame"),
        ("turn.bmp", ["--frames", "3"], "/turn.bmp' would hold one frame"),
    ],
)
def test_outputs_that_cannot_be_written_are_refused_first(ome_zarr, name, options, text, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("itk_shearwarpmip.__main__._project", lambda options: pytest.fail("projected"))
    path, _ = ome_zarr
    check_error(capsys, text, path, tmp_path / name if name else "", *options)


def link_folder(path):
    (path.parent / "link").symlink_to(path)
    return path.parent / "link" / "mip.mha"


def link_level(path):
    """The image's finest level is elsewhere, with a file that is to be written."""
    level = next(each for each in path.iterdir() if each.is_dir())
    level.rename(path.parent / "elsewhere")
    level.symlink_to(path.parent / "elsewhere")
    return find_chunks(path.parent / "elsewhere")[0]


def link_chunk(path, how):
    other = path.parent / "other.mha"
    getattr(os, how)(find_chunks(path)[0], other)
    return other


OUTPUTS = {
    "the folder": lambda path: path,
    "another spelling": lambda path: path.parent / "nothing" / ".." / path.name,
    "a chunk": lambda path: find_chunks(path)[0],
    "new in it": lambda path: path / "mip.mha",
    "by a link to the folder": link_folder,
    "a link to a chunk": partial(link_chunk, how="symlink"),
    "a hard link to a chunk": partial(link_chunk, how="link"),
    "where a level is": link_level,
}


@pytest.mark.parametrize("spell", OUTPUTS.values(), ids=OUTPUTS)
def test_an_output_that_is_an_input_is_refused(ome_zarr, spell, capsys):
    path, _ = ome_zarr
    (path.parent / "nothing").mkdir()
    find_chunks(path)[-1].write_bytes(b"no chunk: it is not read")
    output = spell(path)

    def digest():
        return {each: hashlib.sha256(each.read_bytes()).digest() for each in path.parent.rglob("*") if each.is_file()}

    before = digest()
    for read in (str(path), f"file://{path}", f"simplecache::local://{path}"):
        assert main([read, str(output), "--quiet"]) == 1
        assert capsys.readouterr().err == f"itk_shearwarpmip: OUTPUT must not be in INPUT, but {output} is\n"
    assert digest() == before


def test_an_output_beside_the_input_is_replaced(ome_zarr, capsys):
    path, array = ome_zarr
    output = path.with_name(f"{path.name}.mha")
    (path / "loop").symlink_to(path)
    (path / "nowhere").symlink_to(path / "none")
    output.write_bytes(b"old")
    assert main([str(path), str(output), "--quiet"]) == 0, capsys.readouterr().err
    assert np.array_equal(np.asarray(itk.imread(output)), array[0].max(axis=0))


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *arguments):
        pass


def test_url(ome_zarr):
    path, array = ome_zarr
    handler = partial(_Quiet, directory=path.parent)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        try:
            url = f"http://127.0.0.1:{server.server_port}"
            assert np.array_equal(np.asarray(project(f"{url}/{path.name}", channel=1)), array[1].max(axis=0))
            with pytest.raises(ValueError, match="is no OME-Zarr"):
                project(f"{url}/none")
        finally:
            server.shutdown()


def test_views_at_once_on_a_cluster(client):
    array = make_array(np.random.default_rng(8), (80, 70, 60))
    chunked = dask.array.from_array(array, 32)
    views = [make_view(np.random.default_rng(n)) for n in range(2)]
    with ThreadPoolExecutor(2) as pool:
        pictures = list(pool.map(partial(project, chunked), views))
    for picture, view in zip(pictures, views):
        assert_same(picture, project_whole(array, view))
    # nothing stays on the workers
    deadline = time.monotonic() + 20
    while any(client.has_what().values()) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not any(client.has_what().values())


def count_tasks(stream, name):
    return sum(key_split(task["key"]) == name for task in stream.data)


def test_chunks_that_workers_have_are_projected_together(client):
    array = make_array(np.random.default_rng(12), (90, 60, 70))
    views = [make_view(np.random.default_rng(n)) for n in range(4)]
    # 6 x 4 x 5 chunks: two boxes along two axes
    persisted = dask.array.from_array(array, 16).persist()
    wait(persisted)
    for view in (*views, None):
        with get_task_stream(client) as stream:
            picture = project(persisted, view, **GEOMETRY)
        assert_same(picture, project_whole(array, view, **GEOMETRY))
        # of each box two for each worker, at most
        assert count_tasks(stream, "project_chunks") <= 4 * 2 * 2
        assert count_tasks(stream, "merge_chunks") == 4
        # the last box has none after it
        assert count_tasks(stream, "get_ends") <= 3
    frames = project_turn(persisted, views)
    assert_same(frames, itk.shear_warp_mip_cine_image_filter(make_image(array), transforms=views))


def test_boxes_of_chunks_follow_each_other(client):
    volume = make_wave_volume(((8,) * 4, (8,) * 6, (8,) * 6))
    # a worker that still imports what it needs is slow
    project(volume)
    # a slow worker has few tasks that others overtake; on a busy computer it has many
    overtaken = []
    while len(overtaken) < 3 and min(overtaken, default=9) > 8:
        with get_task_stream(client) as stream:
            project(volume)
        started = sorted(
            (task["startstops"][0]["start"], task["key"])
            for task in stream.data
            if key_split(task["key"]) == "project_chunks"
        )
        assert len(started) == 4 * 6 * 6
        boxes = [np.ravel_multi_index([n // 2 for n in place], (2, 3, 3)) for _, (_, *place) in started]
        overtaken.append(np.count_nonzero(np.maximum.accumulate(boxes) - boxes > 1))
    assert min(overtaken) <= 8, overtaken


def test_chunks_that_tasks_share(client):
    array = make_array(np.random.default_rng(15), (32, 48, 40))
    view = make_view(np.random.default_rng(15))
    assert_same(project(dask.array.from_array(array, 12).rechunk(8), view), project_whole(array, view))


def test_chunks_that_are_still_computed(client):
    array = make_array(np.random.default_rng(13), (20, 20, 20))
    chunks = dask.array.from_array(array, 10).map_blocks(slow, dtype=array.dtype, meta=array[:0, :0, :0])
    assert_same(project(chunks.persist()), project_whole(array))


def slow(chunk):
    time.sleep(0.2)
    return chunk


def test_one_worker_is_enough():
    array = make_array(np.random.default_rng(9), (40, 40, 40))
    with (
        dask.config.set(scheduler=None),
        LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as local,
        Client(local),
    ):
        picture = project(dask.array.from_array(array, 16))
    assert_same(picture, project_whole(array))


def make_waves(block_info=None):
    """Voxel values that tell their place: uint16 that overflows."""
    place = block_info[None]["array-location"]
    z, y, x = (np.arange(begin, end, dtype=np.uint16) for begin, end in place)
    return (z * 71)[:, None, None] + ((y * 53)[:, None] + x * 37)


def make_wave_volume(chunks):
    return dask.array.map_blocks(make_waves, chunks=chunks, dtype=np.uint16, meta=np.empty((0,) * 3, np.uint16))


def test_a_volume_larger_than_a_workers_memory(client):
    # 2.1 GB; a worker has 1 GB
    volume = make_wave_volume(((128,) * 8,) * 3)
    picture = project(volume)
    plane = make_waves({None: {"array-location": [(0, 1), (0, 1024), (0, 1024)]}})[0]
    expected = np.zeros_like(plane)
    for z in range(1024):
        np.maximum(expected, plane + np.uint16(71 * z % 65536), out=expected)
    assert np.array_equal(np.asarray(picture), expected)


def kill_worker_once(block, marker=None):
    time.sleep(0.05)
    if block[0, 0, 0] == 255 and not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return block


@needs_posix
def test_a_killed_worker_changes_nothing(client, tmp_path):
    array = make_array(np.random.default_rng(10), (64, 64, 64), np.uint8) // 2
    array[32, 32, 32] = 255
    marker = tmp_path / "killed"
    fragile = dask.array.from_array(array, 16).map_blocks(
        kill_worker_once, marker=str(marker), dtype=np.uint8, meta=np.empty((0,) * 3, np.uint8)
    )
    workers = set(client.run(os.getpid).values())
    view = make_view(np.random.default_rng(10))
    picture = project(fragile, view)
    assert marker.exists()
    client.wait_for_workers(2)
    assert set(client.run(os.getpid).values()) != workers
    assert_same(picture, project_whole(array, view))

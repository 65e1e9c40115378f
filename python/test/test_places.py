"""Where pixels come from, and what other volumes have there."""

from itertools import permutations, product

import itk
import numpy as np
import pytest
import SimpleITK
from itk_shearwarpmip import mip, open_image, sample, turn
from numpy.testing import assert_allclose, assert_array_equal
from samples import make_image, make_like, make_rotation

OBLIQUE = itk.array_from_matrix(make_rotation(0.2, -0.3, 0.4).GetMatrix())
SHEARED = OBLIQUE @ [[1, 0.6, 0], [0, 0.8, 0], [0, 0, 1]]
GEOMETRIES = {
    "plain": ((1, 1, 1), (0, 0, 0), np.eye(3)),
    "oblique": ((0.7, 0.9, 2.1), (12.0, -30.0, 5.5), OBLIQUE),
    "sheared": ((1.5, 0.4, 0.8), (-7.0, 3.0, 40.0), SHEARED),
}
SLOPE, OFFSET = np.array([2.0, -3.0, 0.5]), 100.0


def make_ramp(spacing, origin, direction, shape=(9, 11, 14), start=(0, 0, 0)):
    """An image whose values are a linear function of physical space."""
    image = make_image(np.zeros(shape), spacing, origin, direction)
    region = image.GetLargestPossibleRegion()
    region.SetIndex(start)
    image.SetRegions(region)
    indices = np.moveaxis(np.indices(shape)[::-1], 0, -1) + start
    points = indices @ (np.asarray(direction) * spacing).T + origin
    itk.array_view_from_image(image)[...] = points @ SLOPE + OFFSET
    return image


def find_center(image, indices):
    """The physical point of a voxel's center, from its place z, y, x in the array."""
    return list(image.TransformIndexToPhysicalPoint([*reversed(indices)]))


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_places_are_the_filters(geometry, exact, oblique_view, rng):
    image = make_image(rng.normal(size=(9, 11, 14)), *geometry)
    picture, depths, places = mip(image, oblique_view, exact=exact, depth=True, places=True, size=(23, 31))
    assert_array_equal(picture, mip(image, oblique_view, exact=exact, size=(23, 31)))
    made = itk.ShearWarpMIPImageFilter.New(
        image, Transform=oblique_view, ComputeDepth=True, Exact=exact, Size=(23, 31), DefaultPixelValue=np.min(image)
    )
    made.Update()
    assert_array_equal(depths, made.GetDepthOutput())
    assert places.shape == (31, 23, 3)
    assert places.dtype == np.float64
    has_value = ~np.isnan(depths)
    assert 150 < has_value.sum() < has_value.size
    for row, column in np.argwhere(has_value).tolist():
        assert_allclose(places[row, column], made.GetPhysicalPoint([column, row]), 1e-12, 1e-11)
    assert np.isnan(places[~has_value]).all()
    assert_array_equal(mip(image, oblique_view, exact=exact, places=True, size=(23, 31))[1], places)


@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_exact_values_are_samples_at_their_places(geometry, oblique_view, rng):
    image = make_image(rng.normal(size=(9, 11, 14)), *geometry)
    picture, places = mip(image, oblique_view, exact=True, places=True, background=-5.0)
    # depths are rounded to single precision
    assert_allclose(sample(image, places, outside=-5.0), picture, 0, 2e-5)


@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_point_source(geometry, oblique_view):
    image = make_image(np.zeros((9, 11, 14), np.uint16), *geometry)
    itk.array_view_from_image(image)[4, 7, 3] = 1000
    picture, places = mip(image, oblique_view, exact=True, places=True, output_spacing=0.05)
    brightest = np.unravel_index(np.argmax(picture), picture.shape)
    assert np.linalg.norm(places[brightest] - find_center(image, (4, 7, 3))) < 0.1


@pytest.mark.parametrize("order", [*permutations(range(3))])
def test_signed_permutations(order, rng):
    for signs in product((-1, 1), repeat=3):
        image = make_image(
            rng.permutation(5 * 6 * 7).reshape(5, 6, 7).astype(np.int16),
            (2, 2, 2),
            (8, -4, 16),
            (np.eye(3) * signs)[list(order)],
        )
        picture, places = mip(image, "anterior", places=True)
        assert_array_equal(sample(image, places), picture)
        assert_array_equal(sample(image, places, "nearest"), picture)
        indices = {int(value): index for index, value in np.ndenumerate(np.asarray(image))}
        for value, place in zip(np.ravel(picture), places.reshape(-1, 3), strict=True):
            assert place.tolist() == find_center(image, indices[value])


def test_turn(image):
    series = turn(image, frames=3, azimuth=20, elevation=10, places=True)
    assert series.depths is None
    assert series.places.shape == (*series.frames.shape, 3)
    grid = {"size": [*series.frames.GetLargestPossibleRegion().GetSize()][:2]}
    grid |= {"output_spacing": [*series.frames.GetSpacing()][:2], "output_origin": [*series.frames.GetOrigin()][:2]}
    for transform, places in zip(series.transforms, series.places, strict=True):
        assert_array_equal(mip(image, transform, places=True, **grid)[1], places)
    both = turn(image, frames=3, azimuth=20, elevation=10, places=True, depth=True)
    assert_array_equal(np.isnan(both.depths), np.isnan(series.places[..., 0]))


def test_sources():
    voxels = np.random.default_rng(5).integers(0, 255, (4, 5, 6), np.uint8)
    image = open_image(voxels, spacing=(1, 2, 3), origin=(5, 6, 7))
    simple = SimpleITK.GetImageFromArray(voxels)
    simple.SetSpacing((1, 2, 3))
    simple.SetOrigin((5, 6, 7))
    _, expected = mip(image, azimuth=30, places=True)
    where = {"spacing": (1, 2, 3), "origin": (5, 6, 7)}
    for source, place in ((voxels, where), (simple, {})):
        picture, places = mip(source, azimuth=30, places=True, **place)
        assert type(picture) is type(source)
        assert_array_equal(places, expected)
        assert_array_equal(sample(source, places, **place), sample(image, expected))


@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_ramp(geometry, rng):
    image = make_ramp(*geometry)
    indices = rng.uniform(0, np.array([13, 10, 8]), (200, 3))
    places = indices @ (np.asarray(geometry[2]) * geometry[0]).T + geometry[1]
    assert_allclose(sample(image, places), places @ SLOPE + OFFSET, 1e-12, 1e-11)
    # a part of an image begins elsewhere
    part = make_ramp(*geometry, start=(3, -4, 20))
    assert_allclose(
        sample(part, places + find_center(part, (20, -4, 3)) - geometry[1]),
        places @ SLOPE + OFFSET + (np.subtract(find_center(part, (20, -4, 3)), geometry[1]) @ SLOPE),
        1e-12,
        1e-11,
    )


@pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)
def test_itk_interpolates_alike(geometry, rng):
    image = make_image(rng.integers(0, 1000, (4, 5, 6)).astype(np.float64), *geometry)
    indices = rng.uniform(-1, np.array([6.5, 5.5, 4.5]), (500, 3))
    indices = indices[(np.abs(indices * 2 - np.rint(indices * 2)) > 0.01).all(axis=1)]
    places = indices @ (np.asarray(geometry[2]) * geometry[0]).T + geometry[1]
    for name, interpolation in (("LinearInterpolate", "linear"), ("NearestNeighborInterpolate", "nearest")):
        function = getattr(itk, f"{name}ImageFunction")[type(image), itk.D].New(InputImage=image)
        region = image.GetLargestPossibleRegion()
        expected = [
            function.Evaluate(place) if region.IsInside(image.TransformPhysicalPointToIndex(place)) else np.nan
            for place in places.tolist()
        ]
        assert_allclose(sample(image, places, interpolation), expected, 0, 1e-9)
        assert 50 < np.isnan(expected).sum() < 450


def test_rim_and_halves():
    voxels = np.arange(4, dtype=np.uint8).reshape(1, 1, 4) + 10
    places = [[x, 0, 0] for x in (-0.502, -0.5005, -0.5, 0, 0.5, 1.5, 2.5, 3.5, 3.5005, 3.502, np.nan, np.inf)]
    outside = [99]
    expected = outside + [10, 10, 10, 11, 12, 13, 13, 13] + outside * 3
    found = sample(voxels, places, "nearest", outside=99)
    assert found.dtype == np.uint8
    assert_array_equal(found, expected)
    expected = outside + [10, 10, 10, 10.5, 11.5, 12.5, 13, 13] + outside * 3
    assert_array_equal(sample(voxels, places, outside=99), expected)


def test_types_of_results():
    labels = np.ones((2, 2, 2), np.int16)
    place = np.zeros((4, 5, 3))
    for outside, dtype in ((0, np.int16), (-7.0, np.int16), (0.5, float), (40000, float), (np.nan, float)):
        found = sample(labels, place, "nearest", outside)
        assert (found.dtype, found.shape) == (dtype, (4, 5))
        assert sample(labels, place, outside=outside).dtype == float
    assert sample(labels.astype(np.float32), place, "nearest").dtype == np.float32
    assert sample(labels, np.empty((0, 3))).shape == (0,)
    assert sample(labels, [0, 0, 0]).shape == ()


def test_special_values():
    voxels = np.array([[[np.inf, 1, np.nan, 2, np.inf, np.inf, -np.inf, 0.1, 0.1]]])
    xs = [0, 0.5, 1, 1.5, 2, 3, 3.25, 4.5, 5.5, 6.5, 7.3]
    expected = [np.inf, np.inf, 1, np.nan, np.nan, 2, np.inf, np.inf, np.nan, -np.inf, 0.1]
    assert_array_equal(sample(voxels, [[x, 0, 0] for x in xs]), expected)


def test_labels_under_a_maximum():
    """The hot spot lies in one organ of another grid."""
    pet = open_image(np.zeros((10, 12, 14), np.float32), spacing=(4, 4, 4), direction=OBLIQUE)
    itk.array_view_from_image(pet)[3, 6, 8] = 20
    organs = make_image(np.zeros((30, 40, 50), np.uint8), (2, 2, 2), (-20, -20, -10))
    i, j, k = organs.TransformPhysicalPointToIndex(find_center(pet, (3, 6, 8)))
    itk.array_view_from_image(organs)[k - 1 : k + 2, j - 1 : j + 2, i - 1 : i + 2] = 7
    suv, places = mip(pet, azimuth=40, exact=True, places=True)
    found = sample(organs, places, "nearest", outside=0)
    brightest = np.unravel_index(np.argmax(suv), suv.shape)
    assert found[brightest] == 7
    assert {*np.unique(found)} == {0, 7}


def test_errors(image):
    with pytest.raises(ValueError, match="interpolation must be one of linear, nearest, but it is 'cubic'"):
        sample(image, [0, 0, 0], "cubic")
    for places in ([0, 0], 5.0):
        with pytest.raises(ValueError, match=r"places must be an array \(\.\.\., 3\), but its shape is"):
            sample(image, places)
    with pytest.raises(ValueError, match="places must be numbers"):
        sample(image, "here")
    with pytest.raises(ValueError, match="places must be True or False"):
        mip(image, places=1)
    with pytest.raises(TypeError, match="a volume is the path"):
        sample(None, [0, 0, 0])
    dask = pytest.importorskip("dask.array")
    assert_array_equal(sample(dask.ones((4, 5, 6)), [1, 1, 1.5]), 1)


def test_other_volumes_are_left_alone(image):
    before = itk.array_from_image(image)
    copy = make_like(before, image)
    sample(image, mip(copy, places=True)[1])
    assert_array_equal(image, before)


def test_constant(rng):
    assert_array_equal(sample(np.full((4, 5, 6), 123.456), rng.uniform(0, 3, (1000, 3))), 123.456)

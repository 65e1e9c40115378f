"""The filter against the brute-force oracle: identical pixels."""

import itk
import numpy as np
import oracle
import pytest
from numpy.testing import assert_array_equal
from samples import make_like, make_rotation

DTYPES = {"int16": itk.SS, "uint8": itk.UC, "uint16": itk.US, "float32": itk.F, "float64": itk.D}


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    matrix, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return matrix if np.linalg.det(matrix) > 0 else -matrix


def random_voxels(rng: np.random.Generator, shape, dtype: str) -> np.ndarray:
    if dtype.startswith("float"):
        return (rng.normal(size=shape) * 10.0 ** rng.integers(-3, 4)).astype(dtype)
    limits = np.iinfo(dtype)
    return rng.integers(limits.min, limits.max, shape, dtype, endpoint=True)


def random_image(rng: np.random.Generator, dtype: str):
    """A part of a larger image: oblique, anisotropic, with an index that does not start at zero."""
    size = rng.integers(1, 16, 3)
    start = rng.integers(1, 6, 3)
    whole = itk.image_from_array(random_voxels(rng, tuple((size + start + 2)[::-1]), dtype))
    whole.SetSpacing(rng.uniform(0.3, 3.0, 3).tolist())
    whole.SetOrigin(rng.uniform(-200.0, 200.0, 3).tolist())
    whole.SetDirection(itk.matrix_from_array(random_rotation(rng)))
    region = itk.ImageRegion[3]()
    region.SetIndex(start.tolist())
    region.SetSize(size.tolist())
    part = itk.extract_image_filter(whole, extraction_region=region)
    assert list(part.GetLargestPossibleRegion().GetIndex()) == start.tolist()
    return part


def random_view(rng: np.random.Generator, image):
    """Mostly rigid; sometimes with unequal scales and skew."""
    matrix = random_rotation(rng)
    if rng.random() < 0.3:
        matrix = matrix @ (np.diag(rng.uniform(0.5, 2.0, 3)) + rng.uniform(-0.2, 0.2, (3, 3)))
    view = itk.AffineTransform[itk.D, 3].New()
    view.SetMatrix(itk.matrix_from_array(matrix))
    view.SetTranslation(list(itk.ShearWarpMIPView.GetCenter(image)))
    return view


@pytest.mark.parametrize("dtype", DTYPES)
def test_random_views_of_random_images(dtype):
    rng = np.random.default_rng(47_696)
    axes = set()
    hits = misses = 0
    for _ in range(60):
        image = random_image(rng, dtype)
        view = random_view(rng, image)
        mip = itk.ShearWarpMIPImageFilter.New(image, Transform=view)
        if rng.random() < 0.5:
            mip.SetSize(rng.integers(1, 60, 2).tolist())
            mip.SetOutputSpacing(rng.uniform(0.2, 2.0, 2).tolist())
            mip.SetDefaultPixelValue(7)
        oversampling = int(rng.integers(1, 3))
        mip.SetOversampling(oversampling)
        mip.Update()
        output = mip.GetOutput()
        assert itk.template(output)[1][0] == DTYPES[dtype]

        pixels = itk.array_from_image(output)
        expected = oracle.project(image, view, output, mip.GetDefaultPixelValue(), oversampling)
        assert_array_equal(pixels, expected)
        missed = pixels == mip.GetDefaultPixelValue()
        misses += missed.sum()
        hits += (~missed).sum()
        axes.add(mip.GetPrincipalAxis())
        assert mip.GetPrincipalAxis() == oracle.principal_axis(oracle.view_to_index(view, image)[0][:, 2])
    assert axes == {0, 1, 2}
    assert hits > 10_000 and misses > 1_000


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("dtype", DTYPES)
def test_view_along_an_axis_is_the_plain_maximum(axis, dtype, rng):
    voxels = random_voxels(rng, (5, 6, 7), dtype)
    view = itk.AffineTransform[itk.D, 3].New()
    u, v = [other for other in range(3) if other != axis]
    matrix = np.zeros((3, 3))
    matrix[u, 0] = matrix[v, 1] = matrix[axis, 2] = 1.0
    view.SetMatrix(itk.matrix_from_array(matrix))

    pixels = itk.shear_warp_mip_image_filter(voxels, transform=view)

    assert_array_equal(pixels, voxels.max(axis=2 - axis))


@pytest.mark.parametrize("shear", [(0.5, 0.5), (-0.5, 0.5), (0.25, -0.5), (-0.75, -0.25)])
@pytest.mark.parametrize("dtype", DTYPES)
def test_positions_half_way_between_voxels(dtype, shear, rng):
    """Shears without rounding errors: samples and outer half voxels are ties, rounded by rule."""
    image = itk.image_from_array(random_voxels(rng, (8, 9, 10), dtype))
    view = itk.AffineTransform[itk.D, 3].New()
    matrix = np.eye(3)
    matrix[:2, 2] = shear
    view.SetMatrix(itk.matrix_from_array(matrix))
    mip = itk.shear_warp_mip_image_filter(image, transform=view, output_spacing=[0.5, 0.25])
    expected = oracle.project(image, view, mip)
    assert_array_equal(mip, expected)


@pytest.mark.parametrize("dtype", DTYPES)
def test_a_constant_stays_that_constant(dtype, image, oblique_view):
    value = 0.1 if dtype.startswith("float") else np.iinfo(dtype).max
    constant = make_like(np.full((9, 11, 14), value, dtype), image)
    pixels = np.asarray(itk.shear_warp_mip_image_filter(constant, transform=oblique_view))
    assert set(np.unique(pixels)) == {np.dtype(dtype).type(0), np.dtype(dtype).type(value)}


def test_oracle_notices_a_change(image, oblique_view):
    """One voxel, one pixel of the grid, one weight: the comparison is not blind."""
    output = itk.shear_warp_mip_image_filter(image, transform=oblique_view)
    pixels = itk.array_from_image(output)
    brighter = itk.image_duplicator(image)
    itk.array_view_from_image(brighter)[4, 5, 6] = 3000
    assert (oracle.project(brighter, oblique_view, output) != pixels).any()

    assert (oracle.project(image, oblique_view, output, oversampling=2) != pixels).any()

    output.SetOrigin([output.GetOrigin()[0] + 1e-3, output.GetOrigin()[1]])
    assert (oracle.project(image, oblique_view, output) != pixels).any()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_same_pixels_with_one_thread_and_two(axis, rng):
    image = itk.image_from_array(random_voxels(rng, (60, 70, 80), "uint16"))
    view = make_rotation(*{0: (0.1, np.pi / 2, 0.2), 1: (np.pi / 2, 0.1, 0.2), 2: (0.1, 0.2, 0.3)}[axis])
    before = itk.MultiThreaderBase.GetGlobalDefaultNumberOfThreads()
    results = []
    try:
        for threads in (1, 2):
            itk.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(threads)
            for units in (1, 2, 7):
                mip = itk.ShearWarpMIPImageFilter.New(image, Transform=view)
                mip.SetNumberOfWorkUnits(units)
                mip.Update()
                assert mip.GetPrincipalAxis() == axis
                results.append(itk.array_from_image(mip.GetOutput()))
    finally:
        itk.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(before)
    assert results[0].max() > 0
    for result in results[1:]:
        assert_array_equal(result, results[0])

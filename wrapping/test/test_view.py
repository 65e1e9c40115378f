"""View transforms from anatomical directions, and the factorization."""

import itk
import numpy as np
import pytest
from samples import make_image

Enums = itk.ShearWarpMIPViewEnums

# where u (right), v (down) and w (away) of the picture point: L is +x, P is +y, S is +z
AXES = {"Anterior": "LIP", "Posterior": "RIA", "Left": "PIR", "Right": "AIL", "Superior": "RPI", "Inferior": "LPS"}
VECTORS = {"L": (1, 0, 0), "R": (-1, 0, 0), "P": (0, 1, 0), "A": (0, -1, 0), "S": (0, 0, 1), "I": (0, 0, -1)}


def view_matrix(transform) -> np.ndarray:
    return itk.array_from_matrix(transform.GetMatrix())


@pytest.fixture
def patient():
    """A volume with marks: patient's left 200, head 150, nose (anterior) 100."""
    voxels = np.zeros((41, 31, 21), np.uint8)  # 41 along superior, 31 along posterior, 21 along left
    voxels[20, 15, 18] = 200
    voxels[38, 15, 10] = 150
    voxels[20, 1, 10] = 100
    return make_image(voxels, (2.0, 2.0, 1.0), (-20.0, -30.0, -20.0))


def find(pixels: np.ndarray, value: int) -> tuple[float, float]:
    """Mean row and column of the pixels of a mark, relative to the picture's center."""
    rows, columns = np.nonzero(np.abs(pixels.astype(int) - value) <= 10)
    assert rows.size
    return rows.mean() - (pixels.shape[0] - 1) / 2, columns.mean() - (pixels.shape[1] - 1) / 2


@pytest.mark.parametrize("name", AXES)
def test_six_directions(name, image):
    direction = getattr(Enums, f"Direction_{name}")
    view = itk.ShearWarpMIPView.MakeTransform(image, direction)
    expected = np.array([VECTORS[letter] for letter in AXES[name]], float).T
    np.testing.assert_allclose(view_matrix(view), expected, rtol=0, atol=1e-15)
    assert np.linalg.det(view_matrix(view)) == pytest.approx(1.0)

    corners = [image.TransformIndexToPhysicalPoint(index) for index in ([0, 0, 0], [13, 10, 8])]
    center = np.mean([list(corner) for corner in corners], axis=0)
    assert list(itk.ShearWarpMIPView.GetCenter(image)) == pytest.approx(center)
    assert list(view.TransformPoint([0.0, 0.0, 0.0])) == pytest.approx(center)


@pytest.mark.parametrize(
    "name, left, head, nose",
    [
        ("Anterior", (0, 16), (-18, 0), (0, 0)),
        ("Posterior", (0, -16), (-18, 0), (0, 0)),
        ("Left", (0, 0), (-18, 0), (0, -28)),
        ("Right", (0, 0), (-18, 0), (0, 28)),
        ("Superior", (0, -16), (0, 0), (-28, 0)),
        ("Inferior", (0, 16), (0, 0), (-28, 0)),
    ],
)
def test_marks_of_a_patient_are_where_a_physician_expects_them(name, left, head, nose, patient):
    view = itk.ShearWarpMIPView.MakeTransform(patient, getattr(Enums, f"Direction_{name}"))
    for value, place in ((200, left), (150, head), (100, nose)):
        only = itk.image_duplicator(patient)
        voxels = itk.array_view_from_image(only)
        voxels[voxels != value] = 0
        pixels = itk.array_from_image(itk.shear_warp_mip_image_filter(only, transform=view, size=[81, 81]))
        assert find(pixels, value) == pytest.approx(place, abs=0.51)


def test_azimuth_and_elevation(image):
    make = itk.ShearWarpMIPView.MakeTransform
    for azimuth, name in ((90, "Left"), (180, "Posterior"), (-90, "Right"), (270, "Right"), (360, "Anterior")):
        turned = make(image, Enums.Direction_Anterior, float(azimuth))
        direct = make(image, getattr(Enums, f"Direction_{name}"))
        assert turned.GetMatrix() == direct.GetMatrix()

    # 30 degrees left anterior oblique, 20 degrees cranial: the viewer is at left, anterior and above
    away = view_matrix(make(image, Enums.Direction_Anterior, 30.0, 20.0))[:, 2]
    azimuth, elevation = np.radians(30.0), np.radians(20.0)
    expected = [-np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), -np.sin(elevation)]
    np.testing.assert_allclose(away, expected, rtol=0, atol=1e-15)


def test_factorization(image, oblique_view):
    output = itk.shear_warp_mip_image_filter(image, transform=oblique_view, default_pixel_value=-2000)
    factorization = itk.ShearWarpFactorization(oblique_view, image, output)

    assert sorted(factorization.GetPermutation()) == [0, 1, 2]
    permutation = list(factorization.GetPermutation())
    assert factorization.GetPrincipalAxis() == permutation[2]
    assert all(abs(shear) <= 1 for shear in factorization.GetShear())
    assert all(translation >= 0 for translation in factorization.GetTranslation())

    # M_view P^-1 = M_warp M_shear, and the first two rows are the view of a voxel
    shear = itk.array_from_matrix(factorization.GetShearMatrix())
    warp = itk.array_from_matrix(factorization.GetWarpMatrix())
    view = itk.array_from_matrix(factorization.GetViewMatrix())
    np.testing.assert_allclose(warp[:2] @ shear[[0, 1, 3]], view[:2], rtol=0, atol=1e-12)

    index = np.array([3, 7, 2])
    physical = image.TransformIndexToPhysicalPoint(index.tolist())
    seen = list(oblique_view.GetInverseTransform().TransformPoint(physical))
    np.testing.assert_allclose(view @ [*index[permutation], 1.0], [*seen, 1.0], rtol=0, atol=1e-12)

    # output column and row to intermediate column and row
    map_ = itk.array_from_matrix(factorization.GetOutputToIntermediateMatrix())
    u, v = (output.GetOrigin()[n] + output.GetSpacing()[n] * (5, 6)[n] for n in (0, 1))
    np.testing.assert_allclose(warp @ map_ @ [5.0, 6.0, 1.0], [u, v, 1.0], rtol=0, atol=1e-12)

    size = np.array(list(image.GetLargestPossibleRegion().GetSize()))[permutation]
    spread = np.abs(list(factorization.GetShear())) * (size[2] - 1)
    intermediate = np.array(list(factorization.GetIntermediateSize()))
    assert (intermediate >= size[:2] + np.floor(spread)).all()
    assert (intermediate <= size[:2] + np.ceil(spread)).all()


def test_factorization_refuses_what_the_filter_refuses():
    verify = itk.ShearWarpFactorization.VerifyViewTransform
    verify(itk.TranslationTransform[itk.D, 3].New())
    with pytest.raises(RuntimeError, match="must be linear, but it is a BSplineTransform"):
        verify(itk.BSplineTransform[itk.D, 3, 3].New())

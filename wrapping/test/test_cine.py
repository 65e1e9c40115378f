"""The turning series as Python users call it."""

import itk
import numpy as np
import pytest
from numpy.testing import assert_array_equal

PIXEL_TYPES = [itk.UC, itk.SS, itk.US, itk.F, itk.D]


def single(image, transform, frames):
    """The single filter's picture on the grid of the frames."""
    spacing, origin = list(frames.GetSpacing())[:2], list(frames.GetOrigin())[:2]
    grid = {"size": list(itk.size(frames))[:2], "output_spacing": spacing, "output_origin": origin}
    return itk.shear_warp_mip_image_filter(image, transform=transform, **grid)


@pytest.mark.parametrize("pixel_type", PIXEL_TYPES)
def test_frames_are_the_single_filters_pictures(image, pixel_type):
    image = image.astype(pixel_type) if pixel_type is not itk.SS else image
    cine = itk.ShearWarpMIPCineImageFilter.New(image, NumberOfFrames=7, AngularRange=200.0)
    cine.Update()
    frames = cine.GetOutput()
    assert type(frames) is itk.Image[pixel_type, 3]
    pictures = itk.array_view_from_image(frames)
    assert pictures.shape[0] == 7
    for number, picture in enumerate(pictures):
        transform = cine.GetFrameTransform(number)
        assert_array_equal(picture, single(image, transform, frames))


def test_functional_interface(image):
    frames = itk.shear_warp_mip_cine_image_filter(
        image, number_of_frames=4, rotation_axis=[1.0, 0.0, 0.0], size=[30, 20], rocking=True
    )
    assert np.asarray(frames).shape == (4, 20, 30)
    assert list(frames.GetSpacing())[2] == 1.0


def test_list_of_transforms(image, oblique_view):
    other = itk.AffineTransform[itk.D, 3].New()
    other.Scale(0.8)
    for frames in (
        itk.shear_warp_mip_cine_image_filter(image, transforms=[oblique_view, other]),
        itk.shear_warp_mip_cine_image_filter(image, Transforms=(oblique_view, other)),
    ):
        pictures = itk.array_view_from_image(frames)
        assert len(pictures) == 2
        assert_array_equal(pictures[0], single(image, oblique_view, frames))
        assert_array_equal(pictures[1], single(image, other, frames))

    cine = itk.ShearWarpMIPCineImageFilter.New(image)
    cine.SetTransforms([oblique_view])
    cine.SetTransforms([other])
    cine.Update()
    assert itk.size(cine.GetOutput())[2] == 1
    cine.ClearTransforms()
    cine.Update()
    assert itk.size(cine.GetOutput())[2] == 36


def test_angles_and_transforms_are_in_the_meta_data(image):
    cine = itk.ShearWarpMIPCineImageFilter.New(image, NumberOfFrames=4, StartAngle=-90.0)
    cine.Update()
    dictionary = dict(cine.GetOutput())
    assert list(dictionary["FrameAngles"]) == [-90.0, 0.0, 90.0, 180.0]
    assert list(cine.GetFrameAngles()) == [-90.0, 0.0, 90.0, 180.0]
    matrices = np.reshape(list(dictionary["FrameTransforms"]), (4, 4, 4))
    point = cine.GetFrameTransform(2).TransformPoint([1.0, 2.0, 3.0])
    np.testing.assert_allclose(matrices[2] @ [1.0, 2.0, 3.0, 1.0], [*point, 1.0])


def test_modes_and_depth(image):
    cine = itk.ShearWarpMIPCineImageFilter.New(image, NumberOfFrames=2, ComputeDepth=True)
    cine.SetMode(itk.ShearWarpMIPImageFilterEnums.Mode_Minimum)
    cine.Update()
    depths = itk.array_view_from_image(cine.GetDepthOutput())
    assert depths.shape == np.asarray(cine.GetOutput()).shape
    assert np.isfinite(depths).any()


def test_docstrings():
    cine = itk.ShearWarpMIPCineImageFilter[itk.Image[itk.SS, 3], itk.Image[itk.SS, 3]]
    for documented in (itk.shear_warp_mip_cine_image_filter, cine):
        assert "a series that turns" in " ".join(documented.__doc__.split())
    for name in ("SetRotationAxis", "AddTransform", "GetFrameAngles", "SetSlabNear", "SetTransforms"):
        text = getattr(cine, name).__doc__
        assert len(text.split("----------")[-1].split()) > 8, text

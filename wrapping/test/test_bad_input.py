"""Bad input gives a clear Python exception, never a crash. Each case runs in a process of its own."""

import itk
import oracle
import pytest
from numpy.testing import assert_array_equal

PREAMBLE = """
from itk import ShearWarpFactorization as Factorization, ShearWarpMIPImageFilter as Filter, ShearWarpMIPView as View
from itk import shear_warp_mip_cine_image_filter as turn, shear_warp_mip_image_filter as project
voxels = np.ones((3, 4, 5), np.int16)
image = itk.image_from_array(voxels)
SS3, SS2 = itk.Image[itk.SS, 3], itk.Image[itk.SS, 2]
BSpline = itk.BSplineTransform[itk.D, 3, 3]
def affine(matrix):
    transform = itk.AffineTransform[itk.D, 3].New()
    transform.SetMatrix(itk.matrix_from_array(np.array(matrix, float)))
    return transform
def mask(shape):
    return itk.image_from_array(np.ones(shape, np.uint8))
def image_with(method, value):
    try:
        getattr(image, method)(value)
    except RuntimeError as error:
        assert "spacing" in str(error)
        raise
    return image
"""

# the exception of each call, and what it says
ERRORS = {
    "TemplateTypeError": {
        "project(itk.image_from_array(np.ones((3, 4), np.int16)))": "ShearWarpMIPImageFilter",
        "project(itk.Image[itk.RGBPixel[itk.UC], 3].New())": "ShearWarpMIPImageFilter",
        "project(itk.Image[itk.complex[itk.F], 3].New())": "ShearWarpMIPImageFilter",
    },
    "TypeError": {
        "project(None)": "input must be an itk.Image or an array with the axes z, y, x, but it is None",
        "project('volume.nrrd')": "but it is 'volume.nrrd'",
        "project(3)": "but it is 3",
        "project(input=None)": "but it is None",
        "project(voxels.astype(np.int32))": (
            "input must have voxels of float32, float64, int16, uint16, uint8, but they are int32: use astype()"
        ),
        "project(input=voxels.astype(np.int64))": "but they are int64",
        "project(voxels.astype(bool))": "but they are bool",
        "project(voxels.astype(np.float16))": "but they are float16",
        "project(voxels.astype(object))": "but they are object",
        "project(image, transform=itk.AffineTransform[itk.D, 2].New())": "SetTransform",
        "project(image, transform=itk.AffineTransform[itk.F, 3].New())": "SetTransform",
        "project(image, transform=np.eye(4))": "SetTransform",
        "project(image, size=[4, 5, 6])": "itkSize2",
        "project(image, size='large')": "itkSize2",
        "project(image, default_pixel_value=None)": "SetDefaultPixelValue",
        "project(image, mode='minimum')": "SetMode",
        "project(image, slab_near=None)": "SetSlabNear",
        "project(image, crop_lower=[1.0, 2.0])": "itkPointD3",
        "project(image, mask_image=voxels)": "mask_image must have voxels of uint8, but they are int16: use astype()",
        "project(image, mask_image=voxels > 0)": "mask_image must have voxels of uint8, but they are bool",
        "project(image, mask_image=image)": "Expecting argument of type itkImageUC3",
        "Filter.New(image).GetPhysicalPoint([0, 0, 0])": "itkIndex2",
        "View.MakeTransform(SS2.New(), 0)": "itkImageBase3",
        "View.MakeTransform(voxels, 0)": "itkImageBase3",
    },
    "RuntimeError": {
        "project()": "Input Primary is required but not set",
        "Filter[SS3, SS2].New().Update()": "Input Primary is required",
        "project(np.ones((0, 4, 5), np.int16))": "The input must not be empty",
        "project(SS3.New())": "The input must not be empty",
        "project(image_with('SetSpacing', [0.0, 1.0, 1.0]))": "Zero-valued spacing",
        "project(image_with('SetSpacing', [np.nan, 1.0, 1.0]))": (
            "spacing must be positive and finite, but it is [nan, 1, 1]"
        ),
        "project(image_with('SetOrigin', [0.0, np.inf, 0.0]))": "origin must be finite, but it is [0, inf, 0]",
        "project(image, transform=None)": "Transform is required but not set",
        "project(image, transform=affine(np.full((3, 3), np.nan)))": "Transform must be finite",
        "project(image, transform=affine(np.diag([1, 0, 1])))": "Transform must be invertible",
        "project(image, transform=BSpline.New())": "Transform must be linear, but it is a BSplineTransform",
        "project(image, output_spacing=[0.0, 1.0])": "OutputSpacing must be positive and finite, but it is [0, 1]",
        "project(image, output_spacing=-1.0)": "OutputSpacing must be positive and finite, but it is [-1, -1]",
        "project(image, output_spacing=[1.0, np.nan])": "OutputSpacing must be positive and finite, but it is [1, nan]",
        "project(image, output_origin=[np.inf, 0.0])": "OutputOrigin must be finite, but it is [inf, 0]",
        "project(image, size=[0, 5])": "Size must not be zero, but it is [0, 5]",
        "project(image, size=[-1, 5])": "Size must fit in memory",
        "project(image, size=[10**7, 10**7])": "Size must fit in memory",
        "project(image, output_spacing=1e-9)": "pixels, with an OutputSpacing of [1e-09, 1e-09], take",
        "project(image, oversampling=3)": "Oversampling must be 1 or 2, but it is 3",
        "project(image, slab_near=3.0, slab_far=2.0)": (
            "SlabNear must be less than infinity and not greater than SlabFar, but they are 3 and 2."
        ),
        "project(image, slab_far=np.nan)": "not greater than SlabFar, but they are -inf and nan.",
        "project(image, crop_lower=[5.0] * 3, crop_upper=[6.0, 4.0, 6.0])": (
            "CropLower must not be greater than CropUpper, but they are [5, 5, 5] and [6, 4, 6]."
        ),
        "project(image, depth_attenuation=-0.5)": "DepthAttenuation must be finite and not negative, but it is -0.5.",
        "project(image, depth_attenuation=np.inf)": "DepthAttenuation must be finite and not negative, but it is inf.",
        "project(voxels.astype(np.float32), local_maximum=True, local_maximum_threshold=np.nan)": (
            "LocalMaximumThreshold must be a number, but it is nan."
        ),
        "project(image, mask_image=mask((3, 4, 4)))": "MaskImage must have the input's region",
        "project(image_with('SetOrigin', [9.0] * 3), mask_image=mask((3, 4, 5)))": (
            "Inputs do not occupy the same physical space"
        ),
        "project(image, mask_image=itk.Image[itk.UC, 3].New())": "MaskImage must have the input's region",
        "project(image, ttype=(SS3, itk.Image[itk.UC, 3]))": "No suitable template parameter",
        "Filter.New(image).GetPhysicalPoint([0, 0])": "ComputeDepth must be on",
        "made = Filter.New(image); made.Update(); made.GetPhysicalPoint([0, 0])": "ComputeDepth must be on",
        "Filter.New(image, ComputeDepth=True).GetPhysicalPoint([0, 0])": "There is no depth at index",
        "turn(image, number_of_frames=0)": "NumberOfFrames must be from 1 to 65535, but it is 0.",
        "turn(image, rotation_axis=[0.0, 0.0, 0.0])": "RotationAxis must be finite and not zero, but it is [0, 0, 0].",
        "View.MakeTransform(None, 0)": "The image is required but not set",
        "View.MakeTransform(image, 9)": "Direction must be one of the six",
        "View.MakeTransform(image, 0, np.inf)": "must be finite, but they are inf and 0",
        "View.MakeTransform(image, 0, 0.0, np.nan)": "must be finite, but they are 0 and nan",
        "View.GetCenter(None)": "The image is required but not set",
        "Factorization(None, image, project(image))": "Transform is required",
        "Factorization(affine(np.eye(3)), None, project(image))": "required",
        "Factorization(affine(np.eye(3)), image, None)": "required",
        "Factorization.ComputeProjectedSpacing(affine(np.eye(3)), None)": "required",
    },
    "ValueError": {
        "project(np.ones(5, np.int16))": "its shape is (5,)",
        "project(np.ones((4, 5), np.int16))": "input must have the axes z, y, x, but its shape is (4, 5)",
        "project(np.ones((2, 3, 4, 5), np.int16))": "its shape is (2, 3, 4, 5)",
        "project(image, mask_image=np.ones((4, 5), np.uint8))": "its shape is (4, 5)",
    },
    "OverflowError": {
        "project(image, oversampling=-1)": "unsigned",
        "project(image, default_pixel_value=70_000)": "SetDefaultPixelValue",
        "project(image, local_maximum_threshold=40_000)": "SetLocalMaximumThreshold",
        "project(image, mask_label=-1)": "SetMaskLabel",
        "project(image, mask_label=256)": "SetMaskLabel",
    },
    "AttributeError": {
        "project(image, colour=3)": "SetColour",
    },
}


@pytest.mark.parametrize("exception, code", [(exception, code) for exception in ERRORS for code in ERRORS[exception]])
def test_bad_input_raises(exception, code, isolated):
    outcome = isolated(PREAMBLE + code)
    assert outcome.returncode == 1, f"exit code {outcome.returncode}: {outcome.stderr}"
    last = [line for line in outcome.stderr.splitlines() if line and not line.startswith((" ", "\t"))]
    assert any(line.startswith(exception) or f".{exception}:" in line for line in last), outcome.stderr
    assert ERRORS[exception][code] in outcome.stderr


@pytest.mark.parametrize(
    "name, value, text",
    [
        ("Size", [0, 3], "Size must not be zero"),
        ("OutputSpacing", [1.0, -1.0], "OutputSpacing must be positive"),
        ("OutputOrigin", [0.0, float("nan")], "OutputOrigin must be finite"),
        ("Transform", itk.BSplineTransform[itk.D, 3, 3].New(), "Transform must be linear"),
        ("Transform", None, "Transform is required"),
        ("Oversampling", 0, "Oversampling must be 1 or 2"),
        ("Input", itk.Image[itk.SS, 3].New(), "The input must not be empty"),
    ],
)
def test_filter_works_after_an_exception(name, value, text, image, oblique_view):
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view)
    getattr(mip, f"Set{name}")(value)
    with pytest.raises(RuntimeError, match=text):
        mip.Update()

    mip.SetInput(image)
    mip.SetTransform(oblique_view)
    mip.FitOutputGrid()
    mip.SetOversampling(1)
    mip.Update()
    assert_array_equal(mip.GetOutput(), oracle.project(image, oblique_view, mip.GetOutput()))

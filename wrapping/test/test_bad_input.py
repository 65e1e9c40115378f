"""Bad input gives a clear Python exception, never a crash. Each case runs in a process of its own."""

import itk
import numpy as np
import oracle
import pytest

PREAMBLE = """
from itk import shear_warp_mip_image_filter as project
voxels = np.ones((3, 4, 5), np.int16)
image = itk.image_from_array(voxels)
SS3, SS2 = itk.Image[itk.SS, 3], itk.Image[itk.SS, 2]
def affine(matrix):
    transform = itk.AffineTransform[itk.D, 3].New()
    transform.SetMatrix(itk.matrix_from_array(np.array(matrix, float)))
    return transform
def image_with(method, value):
    try:
        getattr(image, method)(value)
    except RuntimeError as error:
        assert "spacing" in str(error)
        raise
    return image
"""

# the code, the exception and what its message says
CASES = {
    "2D image": (
        "project(itk.image_from_array(np.ones((3, 4), np.int16)))",
        "TemplateTypeError",
        "ShearWarpMIPImageFilter",
    ),
    "RGB image": ("project(itk.Image[itk.RGBPixel[itk.UC], 3].New())", "TemplateTypeError", "ShearWarpMIPImageFilter"),
    "complex image": (
        "project(itk.Image[itk.complex[itk.F], 3].New())",
        "TemplateTypeError",
        "ShearWarpMIPImageFilter",
    ),
    "None": (
        "project(None)",
        "TypeError",
        "input must be an itk.Image or an array with the axes z, y, x, but it is None",
    ),
    "a string": ("project('volume.nrrd')", "TypeError", "but it is 'volume.nrrd'"),
    "a number": ("project(3)", "TypeError", "but it is 3"),
    "None as keyword": ("project(input=None)", "TypeError", "but it is None"),
    "nothing": ("project()", "RuntimeError", "Input Primary is required but not set"),
    "filter without input": (
        "itk.ShearWarpMIPImageFilter[SS3, SS2].New().Update()",
        "RuntimeError",
        "Input Primary is required",
    ),
    "1D array": ("project(np.ones(5, np.int16))", "ValueError", "its shape is (5,)"),
    "2D array": (
        "project(np.ones((4, 5), np.int16))",
        "ValueError",
        "input must have the axes z, y, x, but its shape is (4, 5)",
    ),
    "4D array": ("project(np.ones((2, 3, 4, 5), np.int16))", "ValueError", "its shape is (2, 3, 4, 5)"),
    "int32 array": (
        "project(voxels.astype(np.int32))",
        "TypeError",
        "input must have voxels of float32, float64, int16, uint16, uint8, but they are int32: use astype()",
    ),
    "int64 array": ("project(input=voxels.astype(np.int64))", "TypeError", "but they are int64"),
    "bool array": ("project(voxels.astype(bool))", "TypeError", "but they are bool"),
    "float16 array": ("project(voxels.astype(np.float16))", "TypeError", "but they are float16"),
    "object array": ("project(voxels.astype(object))", "TypeError", "but they are object"),
    "empty array": ("project(np.ones((0, 4, 5), np.int16))", "RuntimeError", "The input must not be empty"),
    "empty image": ("project(SS3.New())", "RuntimeError", "The input must not be empty"),
    "zero spacing of the image": (
        "project(image_with('SetSpacing', [0.0, 1.0, 1.0]))",
        "RuntimeError",
        "Zero-valued spacing",
    ),
    "NaN spacing of the image": (
        "project(image_with('SetSpacing', [np.nan, 1.0, 1.0]))",
        "RuntimeError",
        "spacing must be positive and finite, but it is [nan, 1, 1]",
    ),
    "infinite origin of the image": (
        "project(image_with('SetOrigin', [0.0, np.inf, 0.0]))",
        "RuntimeError",
        "origin must be finite, but it is [0, inf, 0]",
    ),
    "no transform": ("project(image, transform=None)", "RuntimeError", "Transform is required but not set"),
    "2D transform": ("project(image, transform=itk.AffineTransform[itk.D, 2].New())", "TypeError", "SetTransform"),
    "float transform": ("project(image, transform=itk.AffineTransform[itk.F, 3].New())", "TypeError", "SetTransform"),
    "matrix as transform": ("project(image, transform=np.eye(4))", "TypeError", "SetTransform"),
    "NaN matrix": (
        "project(image, transform=affine(np.full((3, 3), np.nan)))",
        "RuntimeError",
        "Transform must be finite",
    ),
    "singular matrix": (
        "project(image, transform=affine(np.diag([1, 0, 1])))",
        "RuntimeError",
        "Transform must be invertible",
    ),
    "B-spline transform": (
        "project(image, transform=itk.BSplineTransform[itk.D, 3, 3].New())",
        "RuntimeError",
        "Transform must be linear, but it is a BSplineTransform",
    ),
    "zero output spacing": (
        "project(image, output_spacing=[0.0, 1.0])",
        "RuntimeError",
        "OutputSpacing must be positive and finite, but it is [0, 1]",
    ),
    "negative output spacing": (
        "project(image, output_spacing=-1.0)",
        "RuntimeError",
        "OutputSpacing must be positive and finite, but it is [-1, -1]",
    ),
    "NaN output spacing": (
        "project(image, output_spacing=[1.0, np.nan])",
        "RuntimeError",
        "OutputSpacing must be positive and finite, but it is [1, nan]",
    ),
    "infinite output origin": (
        "project(image, output_origin=[np.inf, 0.0])",
        "RuntimeError",
        "OutputOrigin must be finite, but it is [inf, 0]",
    ),
    "zero size": ("project(image, size=[0, 5])", "RuntimeError", "Size must not be zero, but it is [0, 5]"),
    "negative size": ("project(image, size=[-1, 5])", "RuntimeError", "Size must fit in memory"),
    "huge size": ("project(image, size=[10**7, 10**7])", "RuntimeError", "Size must fit in memory"),
    "tiny output spacing": ("project(image, output_spacing=1e-9)", "RuntimeError", "Size must fit in memory"),
    "oversampling": ("project(image, oversampling=3)", "RuntimeError", "Oversampling must be 1 or 2, but it is 3"),
    "negative oversampling": ("project(image, oversampling=-1)", "OverflowError", "unsigned"),
    "three sizes": ("project(image, size=[4, 5, 6])", "TypeError", "itkSize2"),
    "text as size": ("project(image, size='large')", "TypeError", "itkSize2"),
    "default out of range": ("project(image, default_pixel_value=70_000)", "OverflowError", "SetDefaultPixelValue"),
    "None as default": ("project(image, default_pixel_value=None)", "TypeError", "SetDefaultPixelValue"),
    "text as mode": ("project(image, mode='minimum')", "TypeError", "SetMode"),
    "None as slab": ("project(image, slab_near=None)", "TypeError", "SetSlabNear"),
    "corner of two numbers": ("project(image, crop_lower=[1.0, 2.0])", "TypeError", "itkPointD3"),
    "mask of shorts": (
        "project(image, mask_image=voxels)",
        "TypeError",
        "mask_image must have voxels of uint8, but they are int16: use astype()",
    ),
    "mask of bool": ("project(image, mask_image=voxels > 0)", "TypeError", "but they are bool"),
    "2D mask": ("project(image, mask_image=np.ones((4, 5), np.uint8))", "ValueError", "its shape is (4, 5)"),
    "empty mask": (
        "project(image, mask_image=itk.Image[itk.UC, 3].New())",
        "RuntimeError",
        "MaskImage must have the input's region",
    ),
    "output of another type": (
        "project(image, ttype=(SS3, itk.Image[itk.UC, 3]))",
        "RuntimeError",
        "No suitable template parameter",
    ),
    "point without depth": (
        "itk.ShearWarpMIPImageFilter.New(image).GetPhysicalPoint([0, 0])",
        "RuntimeError",
        "ComputeDepth must be on",
    ),
    "point before the update": (
        "itk.ShearWarpMIPImageFilter.New(image, ComputeDepth=True).GetPhysicalPoint([0, 0])",
        "RuntimeError",
        "There is no depth at index",
    ),
    "point of three numbers": (
        "itk.ShearWarpMIPImageFilter.New(image).GetPhysicalPoint([0, 0, 0])",
        "TypeError",
        "itkIndex2",
    ),
    "unknown keyword": ("project(image, colour=3)", "AttributeError", "SetColour"),
    "view of None": (
        "itk.ShearWarpMIPView.MakeTransform(None, 0)",
        "RuntimeError",
        "The image is required but not set",
    ),
    "view of a 2D image": ("itk.ShearWarpMIPView.MakeTransform(SS2.New(), 0)", "TypeError", "itkImageBase3"),
    "view of an array": ("itk.ShearWarpMIPView.MakeTransform(voxels, 0)", "TypeError", "itkImageBase3"),
    "unknown direction": (
        "itk.ShearWarpMIPView.MakeTransform(image, 9)",
        "RuntimeError",
        "Direction must be one of the six",
    ),
    "infinite azimuth": (
        "itk.ShearWarpMIPView.MakeTransform(image, 0, np.inf)",
        "RuntimeError",
        "must be finite, but they are inf and 0",
    ),
    "NaN elevation": (
        "itk.ShearWarpMIPView.MakeTransform(image, 0, 0.0, np.nan)",
        "RuntimeError",
        "must be finite, but they are 0 and nan",
    ),
    "centre of None": ("itk.ShearWarpMIPView.GetCenter(None)", "RuntimeError", "The image is required but not set"),
    "factorization without transform": (
        "itk.ShearWarpFactorization(None, image, project(image))",
        "RuntimeError",
        "Transform is required",
    ),
    "factorization without image": (
        "itk.ShearWarpFactorization(affine(np.eye(3)), None, project(image))",
        "RuntimeError",
        "required",
    ),
    "factorization without output": (
        "itk.ShearWarpFactorization(affine(np.eye(3)), image, None)",
        "RuntimeError",
        "required",
    ),
    "bounds of None": (
        "itk.ShearWarpFactorization.ComputeProjectedSpacing(affine(np.eye(3)), None)",
        "RuntimeError",
        "required",
    ),
}


@pytest.mark.parametrize("code, exception, message", CASES.values(), ids=CASES)
def test_bad_input_raises(code, exception, message, isolated):
    outcome = isolated(PREAMBLE + code)
    assert outcome.code == 1, f"exit code {outcome.code}: {outcome.text}"
    last = [line for line in outcome.text.splitlines() if line and not line.startswith((" ", "\t"))]
    assert any(line.startswith(exception) or f".{exception}:" in line for line in last), outcome.text
    assert message in outcome.text


@pytest.mark.parametrize(
    "spoil, text",
    [
        (lambda mip: mip.SetSize([0, 3]), "Size must not be zero"),
        (lambda mip: mip.SetOutputSpacing([1.0, -1.0]), "OutputSpacing must be positive"),
        (lambda mip: mip.SetOutputOrigin([0.0, float("nan")]), "OutputOrigin must be finite"),
        (lambda mip: mip.SetTransform(itk.BSplineTransform[itk.D, 3, 3].New()), "Transform must be linear"),
        (lambda mip: mip.SetTransform(None), "Transform is required"),
        (lambda mip: mip.SetOversampling(0), "Oversampling must be 1 or 2"),
        (lambda mip: mip.SetInput(type(mip.GetInput()).New()), "The input must not be empty"),
    ],
    ids=["Size", "OutputSpacing", "OutputOrigin", "BSplineTransform", "None", "Oversampling", "empty"],
)
def test_filter_works_after_an_exception(spoil, text, image, oblique_view):
    mip = itk.ShearWarpMIPImageFilter.New(image, Transform=oblique_view)
    spoil(mip)
    with pytest.raises(RuntimeError, match=text):
        mip.Update()

    mip.SetInput(image)
    mip.SetTransform(oblique_view)
    mip.FitOutputGrid()
    mip.SetOversampling(1)
    mip.Update()
    pixels = itk.array_from_image(mip.GetOutput())
    np.testing.assert_array_equal(pixels, oracle.project(image, oblique_view, mip.GetOutput()))

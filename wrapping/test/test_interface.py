"""Docstrings and type stubs."""

import ast
from importlib import metadata
from pathlib import Path

import itk
import pytest

SETTERS = set(
    """SetTransform SetSize SetOutputSpacing SetOutputOrigin SetDefaultPixelValue SetMode SetSlabNear SetSlabFar
    SetCropLower SetCropUpper SetMaskImage SetMaskLabel SetLocalMaximum SetLocalMaximumThreshold SetDepthAttenuation
    SetComputeDepth SetReducedResampling SetOversampling SetNumberOfStreamDivisions""".split()
)
METHODS = SETTERS | set(
    """GetDepthOutput GetPhysicalPoint GetTransform GetSize GetOutputSpacing GetOutputOrigin GetDefaultPixelValue
    SetOutputParametersFromImage FitOutputGrid GetPrincipalAxis GetPreparationSeconds GetProjectionSeconds
    GetWarpSeconds ReleasePreparedVolume GetPreparedVolumeSizeInBytes""".split()
)


@pytest.mark.parametrize("dimension", [2, 3])
def test_docstrings(dimension):
    mip = itk.ShearWarpMIPImageFilter[itk.Image[itk.SS, 3], itk.Image[itk.SS, dimension]]
    for documented in (itk.shear_warp_mip_image_filter, mip):
        text = " ".join(documented.__doc__.split())
        assert "Maximum intensity projection (MIP) of a 3D image from any direction" in text
    for documented, text in (
        (mip.SetOutputSpacing, "units of view space"),
        (mip.SetTransform, "identity by default"),
        (mip.ReleasePreparedVolume, "Frees the memory"),
        (itk.ShearWarpMIPView.MakeTransform, "azimuth degrees"),
        (itk.ShearWarpFactorization, "principal axis"),
    ):
        assert text in " ".join(documented.__doc__.split())
    for name in SETTERS | {"GetSlabFar", "LocalMaximumOn", "GetDepthOutput", "GetPhysicalPoint"}:
        text = getattr(mip, name).__doc__
        assert len(text.split("----------")[-1].split()) > 8, text


def test_every_method_is_there_for_every_pixel_type():
    types = [pair[0] for pair in itk.ShearWarpMIPImageFilter.keys()]
    assert {itk.template(each)[1][0] for each in types} == {itk.UC, itk.SS, itk.US, itk.F, itk.D}
    assert len(itk.ShearWarpMIPImageFilter.keys()) == 10
    for mip in itk.ShearWarpMIPImageFilter.values():
        assert METHODS <= set(dir(mip))


def test_type_stubs():
    files = [Path(file.locate()) for file in metadata.files("itk-shearwarpmip")]
    stubs = [file for file in files if file.suffix == ".pyi"]
    assert any(stub.name.startswith("ShearWarpMIPImageFilter") for stub in stubs)
    assert any(stub.name.startswith("ShearWarpMIPView") for stub in stubs)
    enums = next(stub for stub in stubs if stub.name == "ShearWarpMIPImageFilterEnumsProxy.pyi")
    assert "Mode_Minimum" in enums.read_text()
    named = set()
    for stub in stubs:
        named |= {node.name for node in ast.walk(ast.parse(stub.read_text())) if isinstance(node, ast.FunctionDef)}
    assert METHODS <= named
    assert {"MakeTransform", "GetCenter"} <= named
    # every other stub that one imports is there
    for stub in stubs:
        for node in ast.walk(ast.parse(stub.read_text())):
            if isinstance(node, ast.ImportFrom) and node.level == 1 and "ShearWarp" in (node.module or ""):
                assert (stub.parent / f"{node.module}.pyi").exists() or (stub.parent / f"{node.module}.py").exists()

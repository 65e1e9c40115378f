"""The wheel."""

import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import itk
import pytest
from program import PROGRAM


@pytest.fixture(scope="module")
def files() -> list[Path]:
    return [Path(file.locate()) for file in metadata.files("itk-shearwarpmip")]


def test_metadata(files):
    assert metadata.requires("itk-shearwarpmip")[0].replace(" ", "") in ("itk==5.4.*", "itk<5.5,>=5.4")
    wheel = next(file for file in files if file.name == "WHEEL").read_text()
    assert "Tag: cp311-abi3-" in wheel
    assert "Root-Is-Purelib: false" in wheel
    # its types are its own
    assert any(file.parts[-2:] == ("itk_shearwarpmip", "py.typed") for file in files)


def test_needs_runtime_libraries_only(files):
    readelf = shutil.which("readelf")
    if not readelf:
        pytest.skip("readelf is not installed")
    # other libraries belong to the program, put in by auditwheel
    libraries = [file for file in files if ".so" in file.name and file.parent.name == "itk"]
    assert libraries
    for library in libraries:
        dynamic = subprocess.run([readelf, "-d", library], check=True, capture_output=True, text=True).stdout
        needed = {line.split("[")[1].rstrip("]").split(".so")[0] for line in dynamic.splitlines() if "(NEEDED)" in line}
        assert needed
        assert needed <= set("libc libm libstdc++ libgcc_s libpthread libdl ld-linux-x86-64 ld-linux-aarch64".split())


def test_program(files, tmp_path):
    program = next(file for file in files if file.parent.name in ("bin", "Scripts") and file.stem == "shear-warp-mip")
    version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout
    assert version.startswith(f"shear-warp-mip {metadata.version('itk-shearwarpmip')}, ITK 5.4.")
    subprocess.run([program, "--write-phantom", tmp_path / "head.nrrd"], check=True)
    assert itk.imread(tmp_path / "head.nrrd").GetImageDimension() == 3


def test_first_picture_loads_few_modules(tmp_path):
    """ITKTransform with what it needs takes half a second. Warnings of ITK's modules do not end Python."""
    subprocess.run([PROGRAM, "--write-phantom", tmp_path / "head.nrrd", "--phantom-size", "8", "8", "8"], check=True)
    code = (
        "import sys; from itk_shearwarpmip import mip, save_png; import itk; "
        "save_png(mip(sys.argv[1]), sys.argv[2]); print(*sorted(itk.loaded_lazy_modules))"
    )
    command = [sys.executable, "-W", "error", "-c", code, tmp_path / "head.nrrd", tmp_path / "mip.png"]
    modules = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    assert modules == ["ITKBridgeNumPy", "ITKCommon", "ShearWarpMIP"]


MAIN = "from itk_shearwarpmip.__main__ import main; main"
VIEWER, VIEWER_PACKAGES = "ImportError: the viewer.*", r".*install the wheel with its extra \[viewer\]$"


@pytest.mark.parametrize(
    "missing, code, text",
    [
        ("dask", "import itk_shearwarpmip as i; assert hasattr(i, 'mip'); i.mipp", "AttributeError"),
        (
            "dask",
            "from itk_shearwarpmip import open_volume",
            "ImportError: itk_shearwarpmip needs Dask: install the wheel",
        ),
        (
            "zarr",
            "from itk_shearwarpmip import mip; mip('a.zarr')",
            "ImportError: an OME-Zarr needs zarr: install the wheel",
        ),
        ("dask", f"{MAIN}(['a', 'b.mha'])", "itk_shearwarpmip: itk_shearwarpmip needs Dask: install the wheel"),
        ("aiohttp", f"{MAIN}(['http://a/b', 'c.mha'])", "itk_shearwarpmip: .*aiohttp"),
        ("rendercanvas", "import itk_shearwarpmip as i; i.show", f"{VIEWER}rendercanvas{VIEWER_PACKAGES}"),
        ("PIL", "import itk_shearwarpmip as i; i.show", f"{VIEWER}Pillow{VIEWER_PACKAGES}"),
        ("uvicorn", "import itk_shearwarpmip._server", f"{VIEWER}uvicorn{VIEWER_PACKAGES}"),
        ("anywidget", "import itk_shearwarpmip._notebook", f"{VIEWER}anywidget{VIEWER_PACKAGES}"),
    ],
    ids=["package", "function", "Zarr", "program", "URL", "canvas", "Pillow", "server", "notebook"],
)
def test_what_is_missing_is_named_where_it_is_needed(missing, code, text):
    code = f"import sys; sys.modules['{missing}'] = None; {code}"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert re.match(text, done.stderr.splitlines()[-1]), done.stderr
    assert done.returncode == 1 or len(done.stderr.splitlines()) == 1

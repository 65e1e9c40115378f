"""The Python of README.md and pages of doc/, as it is printed."""

import re
import shutil
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import itk
import itk_shearwarpmip
import nibabel
import numpy as np
import pytest
from rendercanvas.offscreen import RenderCanvas
from test_dicom import write_series

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="ffmpeg is not installed")
@pytest.mark.parametrize("document", ["README.md", "doc/learning.md", "doc/python.md", "doc/viewer.md"])
def test_python_of(document, tmp_path, monkeypatch):
    if document == "doc/learning.md":
        pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    array = np.random.default_rng(8).integers(0, 900, (20, 30, 40), np.int16)
    for name in ("angiogram", "ct", "pet"):
        itk.imwrite(itk.image_from_array(array), f"{name}.nrrd")
    itk.imwrite(itk.image_from_array((array > 800).astype(np.uint8)), "vessels.nrrd")
    nibabel.save(nibabel.Nifti1Image(array.T, np.eye(4)), "tof.nii.gz")
    write_series(tmp_path / "dicom-folder", t0008103e="Thorax")
    show = partial(itk_shearwarpmip.show, canvas=RenderCanvas(size=(640, 480)))
    monkeypatch.setattr(itk_shearwarpmip, "show", show, raising=False)
    names = {"array": array, "tensor": SimpleNamespace(cpu=lambda: array)}
    blocks = re.findall(
        r"^```python\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    assert blocks
    for block in blocks:
        exec(block, names)
    for name in re.findall(r'"([\w.-]+[.](?:png|gif))"', "".join(blocks)):
        assert Path(name).stat().st_size

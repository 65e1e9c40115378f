"""The example programs and the notebook. Each program runs once at least as a user runs it, with its own import."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import itk
import nbclient
import nbformat
import numpy as np
import pytest
from itk_shearwarpmip import open_volume
from numpy.testing import assert_array_equal
from PIL import Image
from program import PROGRAM
from samples import Outcome, make_image

EXAMPLES = Path(__file__).parents[2] / "examples"
PROGRAMS = ["channels_mip.py", "mip_pipeline.py"]


def run(program: str, *arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, EXAMPLES / program, *map(str, arguments)]
    return subprocess.run(command, check=False, capture_output=True, text=True, timeout=120)


@pytest.fixture
def run_forked(request) -> Callable[..., Outcome]:
    """Runs a program in a process that has imported itk already, where there is such a thing."""
    if not hasattr(os, "fork"):
        return run
    isolated = request.getfixturevalue("isolated")

    def run_program(program: str, *arguments) -> Outcome:
        path = str(EXAMPLES / program)
        command = [path, *map(str, arguments)]
        return isolated(f"import runpy, sys\nsys.argv = {command!r}\nrunpy.run_path({path!r}, run_name='__main__')")

    return run_program


@pytest.fixture(scope="module")
def volume(tmp_path_factory) -> Path:
    """A bright tube along the long axis at the patient's left, in noise; slices are 3 mm apart."""
    voxels = np.random.default_rng(1).normal(100.0, 5.0, (20, 30, 40))
    voxels[:, 13:17, 30:34] = 1000.0
    image = itk.image_from_array(voxels.astype(np.int32))
    image.SetSpacing([1.0, 1.0, 3.0])
    path = tmp_path_factory.mktemp("volume") / "tube.nrrd"
    itk.imwrite(image, path)
    return path


def test_mip_pipeline(volume, tmp_path):
    outcome = run("mip_pipeline.py", volume, tmp_path / "tube.png", "--sigma", 1.5)
    assert outcome.returncode == 0, outcome.stderr
    assert "tube.png" in outcome.stdout
    with Image.open(tmp_path / "tube.png") as picture:
        grey = np.asarray(picture.convert("L")).astype(float)
    left, right = np.array_split(grey[grey.shape[0] // 3 : -grey.shape[0] // 6], 2, axis=1)
    for panel in (left, right):
        profile = panel.mean(axis=0)
        assert profile.max() > 150
        assert profile.argmax() > 0.6 * profile.size  # the patient's left is on the right
    assert np.median(right) <= np.median(left)


# the pixel type of the file and its channels, their type, the type of the file
CHANNELS = {
    "colour": (itk.RGBPixel[itk.UC], 3, np.uint8, "nrrd"),
    "transparent": (itk.RGBAPixel[itk.UC], 4, np.uint8, "nrrd"),
    "bytes": (itk.VariableLengthVector[itk.UC], 3, np.uint8, "mha"),
    "shorts": (itk.VariableLengthVector[itk.SS], 5, np.int16, "nrrd"),
    "vectors": (itk.VariableLengthVector[itk.F], 2, np.float32, "nii"),
    "scalar": (itk.D, 1, np.float64, "nrrd"),
    "time": (itk.SS, 1, np.int16, "nii.gz"),
    "vectors in time": (itk.VariableLengthVector[itk.US], 2, np.uint16, "mha"),
}


@pytest.mark.parametrize("kind", CHANNELS)
def test_channels_mip(kind, run_forked, tmp_path):
    pixel_type, channels, dtype, extension = CHANNELS[kind]
    dimension = 4 if "time" in kind else 3
    times = 5 if dimension == 4 else 1
    voxels = np.random.default_rng(3).integers(3, 250, (times, 6, 7, 8, channels)).astype(dtype)
    array = voxels if dimension == 4 else voxels[0]
    is_long_vector = channels > 1 and "Pixel" not in pixel_type.__name__
    image = (
        itk.image_from_array(array, is_vector=True)
        if is_long_vector
        else itk.image_from_array(array[..., 0] if channels == 1 else array, ttype=itk.Image[pixel_type, dimension])
    )
    image.SetSpacing([0.5, 0.75, 2.0, 1.5][:dimension])
    image.SetOrigin([-3.0, 4.0, 50.0, 10.0][:dimension])
    source, target = (tmp_path / f"{name}.{extension}" for name in ("image", "mip"))
    itk.imwrite(image, source)

    run_it = run if kind == "colour" else run_forked
    outcome = run_it("channels_mip.py", source, target, "--azimuth", 25)
    assert outcome.returncode == 0, outcome.stderr
    assert f"{channels} channels, {times} time points" in outcome.stdout
    result = itk.imread(target, pixel_type)
    assert result.GetImageDimension() == dimension - 1
    pixels = itk.array_from_image(result)
    pixels = pixels.reshape(times, *pixels.shape[dimension - 3 :][:2], channels)
    for time, channel in np.ndindex(times, channels):
        array = np.ascontiguousarray(voxels[time, ..., channel])
        volume = make_image(array, (0.5, 0.75, 2.0), (-3.0, 4.0, 50.0))
        view = itk.ShearWarpMIPView.MakeTransform(volume, itk.ShearWarpMIPViewEnums.Direction_Anterior, 25.0)
        darkest = voxels.min().item()
        mip = itk.shear_warp_mip_image_filter(volume, transform=view, default_pixel_value=darkest)
        assert_array_equal(pixels[time, ..., channel], mip)
    assert list(result.GetSpacing()) == pytest.approx([*mip.GetSpacing(), 1.5][: dimension - 1])
    assert list(result.GetOrigin()) == pytest.approx([*mip.GetOrigin(), 10.0][: dimension - 1])


def test_channels_mip_refuses_an_unknown_format(volume, run_forked, tmp_path):
    outcome = run_forked("channels_mip.py", volume, tmp_path / "tube.avi")
    assert outcome.returncode == 1
    assert outcome.stderr == f"error: {tmp_path / 'tube.avi'} can't be written\n"


def test_light_sheet(tmp_path):
    outcome = run("light_sheet.py", tmp_path, "--size", 96, 160, 144, "--frames", 5)
    assert outcome.returncode == 0, outcome.stderr
    assert "pixels of 0.4 micrometres" in outcome.stdout
    assert "5 frames of " in outcome.stdout
    finest, coarse = (open_volume(tmp_path / "light-sheet.ome.zarr", level=level) for level in range(2))
    assert (finest.array.shape, coarse.array.shape) == ((96, 160, 144), (48, 80, 72))
    assert (finest.spacing, coarse.spacing) == ((0.4, 0.4, 0.8), (0.8, 0.8, 1.6))
    assert coarse.origin == pytest.approx((0.2, 0.2, 0.4))
    with Image.open(tmp_path / "mip.png") as picture:
        grey = np.asarray(picture)
    # thin lines on a dark ground, and no noise: bright pixels have bright neighbours
    bright = grey > 128
    assert 0.005 < bright.mean() < 0.4
    neighbours = sum(np.roll(bright, shift, axis) for shift in (-1, 1) for axis in (0, 1))
    assert (neighbours[bright] > 0).mean() > 0.95
    with Image.open(tmp_path / "turn.gif") as animation:
        assert animation.n_frames == 5


def test_light_sheet_refuses_bad_arguments(run_forked, tmp_path):
    (tmp_path / "file").write_text("")
    for arguments in ((tmp_path, "--workers", 0), (tmp_path / "file",)):
        outcome = run_forked("light_sheet.py", *arguments)
        assert outcome.returncode == 1
        assert outcome.stderr.startswith("error: ")
        assert outcome.stderr.count("\n") == 1


def test_skewed_stack(tmp_path):
    outcome = run("skewed_stack.py", tmp_path, "--size", 90, 50, 70)
    assert outcome.returncode == 0, outcome.stderr
    assert "pixels of 0.4 micrometres" in outcome.stdout
    difference = float(outcome.stdout.split("mean difference of the pictures: ")[1].split()[0])
    assert 0 < difference < 1
    with Image.open(tmp_path / "pictures.png") as picture:
        grey = np.asarray(picture).astype(int)
    rows = (len(grey) - 6) // 2
    above, below = grey[:rows], grey[-rows:]
    assert ((above > 64).mean() > 0.02) and (np.abs(above - below) > 32).mean() < 0.01


@pytest.mark.parametrize("arguments", [("--angle", 0), ("--size", 1, 4, 4)])
def test_skewed_stack_refuses_bad_arguments(arguments, run_forked, tmp_path):
    outcome = run_forked("skewed_stack.py", tmp_path, *arguments)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: ")
    assert outcome.stderr.count("\n") == 1


def test_vessel_tree(tmp_path):
    pytest.importorskip("torch")
    angiogram, tree = tmp_path / "angiogram.nrrd", tmp_path / "tree.png"
    subprocess.run([PROGRAM, "--write-phantom", angiogram, "--phantom-size", "64", "64", "32"], check=True)
    outcome = run("vessel_tree.py", angiogram, tree, "--steps", 30, "--views", 8)
    assert outcome.returncode == 0, outcome.stderr
    assert outcome.stdout.startswith("30 steps with 8 MIPs of ")
    assert float(outcome.stdout.split()[-1]) > 0.5
    with Image.open(tree) as picture:
        grey = np.asarray(picture.convert("L")).astype(float)
    expected, before, after = np.array_split(grey[20 : grey.shape[0] // 2], 3, axis=1)
    errors = [np.abs(each[:, :280] - expected[:, :280]).mean() for each in (before, after)]
    assert errors[1] < errors[0] / 2

    outcome = run("vessel_tree.py", tmp_path / "missing.nrrd", tree)
    assert outcome.returncode == 1
    assert outcome.stderr.startswith("error: ") and outcome.stderr.count("\n") == 1


def test_study_views(tmp_path):
    """A hot organ; the volumes of a study have different grids."""
    organ = np.array([22.0, -8.0, 31.0])
    for number in range(2):
        study = tmp_path / "studies" / f"patient{number}"
        study.mkdir(parents=True)
        for name, length, dtype in (("pet", 4.0, np.float32), ("ct", 2.0, np.int16), ("labels", 3.0, np.uint8)):
            shape = np.array([80, 100, 120]) // int(length)
            axes = (np.arange(n) * length - 40 for n in shape)
            z, y, x = np.meshgrid(*axes, indexing="ij")
            distance = np.sqrt((x - organ[0]) ** 2 + (y - organ[1]) ** 2 + (z - organ[2]) ** 2)
            values = {"pet": 20 * np.exp(-(distance**2) / 100), "ct": 3 * x, "labels": 1 + (distance < 12)}[name]
            image = make_image(values.astype(dtype), (length,) * 3, (-40.0,) * 3)
            itk.imwrite(image, study / f"{name}.nii.gz")

    outcome = run("study_views.py", tmp_path / "studies", tmp_path / "arrays")
    assert outcome.returncode == 0, outcome.stderr
    assert {each.name for each in (tmp_path / "arrays").iterdir()} == {"patient0.npz", "patient1.npz"}
    found = np.load(tmp_path / "arrays" / "patient1.npz")
    suv, ct, labels = found["suv"], found["ct"], found["labels"]
    assert len(suv) == 48 and suv.shape == ct.shape == labels.shape
    assert {*np.unique(labels)} == {0, 1, 2}
    for frame in range(48):
        brightest = np.unravel_index(np.argmax(suv[frame]), suv[frame].shape)
        assert labels[frame][brightest] == 2
        assert abs(ct[frame][brightest] - 3 * organ[0]) < 10
    lines = (EXAMPLES / "study_views.py").read_text().splitlines()
    assert len([line for line in lines if line.strip()]) < 20

    outcome = run("study_views.py")
    assert outcome.returncode == 1 and "study_views.py studies arrays" in outcome.stderr


@pytest.mark.parametrize("program", [*PROGRAMS, "light_sheet.py", "skewed_stack.py"])
def test_help(program, run_forked):
    outcome = run_forked(program, "--help")
    assert outcome.returncode == 0
    assert "usage:" in outcome.stdout and "image" in outcome.stdout


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(
    "name, text",
    [("missing.nrrd", "does not exist"), ("text.nrrd", "is not an image"), ("flat.mha", "has 2 dimensions, not 3")],
)
def test_errors_are_one_line(program, name, text, run_forked, tmp_path):
    (tmp_path / "text.nrrd").write_text("no image")
    itk.imwrite(itk.image_from_array(np.zeros((4, 5), np.uint8)), tmp_path / "flat.mha")
    outcome = run_forked(program, tmp_path / name, tmp_path / "out.png")
    assert outcome.returncode == 1
    assert outcome.stderr.startswith(f"error: {tmp_path / name} ")
    assert text in outcome.stderr
    assert outcome.stderr.count("\n") == 1


@pytest.mark.filterwarnings("ignore")
def test_notebook():
    notebook = nbformat.read(EXAMPLES / "shear_warp_mip.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    text = "".join(output.text for output in outputs if output.get("name") == "stdout")
    assert len(pictures) == 4
    assert "prepared for 3 of 12 views" in text
    assert float(text.rsplit(maxsplit=1)[1]) > 0.98

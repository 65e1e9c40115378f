"""Files are read by the program, in a process of its own: what can go wrong there is one clear error."""

import os
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path
from urllib.parse import quote

import itk
import numpy as np
import pytest
from itk_shearwarpmip import _program, mip, open_image
from numpy.testing import assert_array_equal
from program import HEED_INTERRUPTS, PROGRAM
from samples import make_oblique

pytestmark = pytest.mark.skipif(not PROGRAM, reason="needs the program shear-warp-mip: SHEARWARPMIP_PROGRAM=path")


@pytest.fixture
def volume(rng, tmp_path):
    path = tmp_path / "volume.nrrd"
    itk.imwrite(make_oblique(rng), path)
    return path


@pytest.fixture
def use_script(tmp_path, monkeypatch):
    """Has a script instead of the program."""

    def use(text):
        script = tmp_path / "script"
        script.write_text("#!/bin/sh\n" + text)
        script.chmod(script.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("SHEARWARPMIP_PROGRAM", str(script))

    return use


@pytest.fixture(autouse=True)
def nothing_is_left(monkeypatch, tmp_path_factory):
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield
    assert not any(folder.iterdir())


NAMES = ["a b.nrrd", "Gefäß 体积.nrrd", "-x.nrrd", "it's.nrrd", 'q".nrrd', "--view.nrrd", "cannot write.nrrd"]


@pytest.mark.parametrize("name", [*NAMES, "a\u2028b.nrrd"])
def test_names(name, volume, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    expected = np.asarray(open_image(volume))
    volume.rename(tmp_path / name)
    assert_array_equal(open_image(name), expected)
    assert_array_equal(open_image(tmp_path / name), expected)
    (tmp_path / name).write_text("text")
    with pytest.raises(OSError, match="is no image of DICOM") as caught:
        open_image(name)
    assert f"'{name}'" in str(caught.value)


@pytest.mark.filterwarnings("ignore:.*how large its voxels are along z")
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.uint16, np.float32, np.float64])
@pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".nii.gz", ".tif"])
def test_each_format_has_the_same_voxels(dtype, suffix, tmp_path, rng):
    if (dtype, suffix) in ((np.float64, ".tif"), (np.int16, ".tif")):
        pytest.skip("ITK does not write it")
    voxels = rng.integers(0, 200, (5, 6, 7)).astype(dtype)
    itk.imwrite(itk.image_from_array(voxels), tmp_path / f"x{suffix}")
    image = open_image(tmp_path / f"x{suffix}")
    assert np.asarray(image).dtype == dtype
    assert_array_equal(image, voxels)
    # they are the image's own
    image[2, 3, 4] = 7
    assert np.asarray(image)[2, 3, 4] == 7


def test_geometry_has_all_digits(rng, tmp_path):
    image = make_oblique(rng)
    itk.imwrite(image, tmp_path / "x.mha")
    read = open_image(tmp_path / "x.mha")
    for name in ("GetSpacing", "GetOrigin"):
        assert list(getattr(read, name)()) == list(getattr(image, name)())
    assert_array_equal(read.GetDirection(), image.GetDirection())
    assert mip(tmp_path / "x.mha", azimuth=30)["FrameTransforms"] == mip(image, azimuth=30)["FrameTransforms"]


def test_points_in_time(rng, tmp_path):
    voxels = rng.integers(0, 200, (3, 5, 6, 7)).astype(np.int16)
    itk.imwrite(itk.image_from_array(voxels), tmp_path / "x.nii")
    with pytest.raises(ValueError, match="has 3 points in time: give the number of one, as time=0"):
        open_image(tmp_path / "x.nii")
    for time_, expected in enumerate(voxels):
        assert_array_equal(open_image(tmp_path / "x.nii", time=time_), expected)
        assert_array_equal(open_image(tmp_path / "x.nii", volume=time_ + 1), expected)
    with pytest.raises(ValueError, match=r"^volume 4 is not in '.*x.nii', which has points in time 1 to 3"):
        open_image(tmp_path / "x.nii", volume=4)
    for wrong in (3, -1, 1.5, "a", True):
        with pytest.raises(ValueError, match=r"time must be a whole number (from 0 to 2|of at least 0)"):
            mip(tmp_path / "x.nii", time=wrong)


def test_neighbours_are_not_read_instead(tmp_path):
    for name, value in (("x.nii", 3), ("x.nii.gz", 5)):
        itk.imwrite(itk.image_from_array(np.full((3, 4, 5), value, np.int16)), tmp_path / name)
    assert (np.asarray(open_image(tmp_path / "x.nii")) == 3).all()
    with pytest.raises(OSError, match=r"x\.nii"):
        open_image(tmp_path / "x.nii.gz")


@pytest.mark.filterwarnings("ignore:.*how large its voxels are along z")
@pytest.mark.parametrize("suffix", [".nii", ".nii.gz", ".mha", ".nrrd", ".vtk", ".gipl", ".tif", ".mrc"])
def test_cut_files_are_refused(suffix, tmp_path, rng):
    path = tmp_path / f"x{suffix}"
    itk.imwrite(itk.image_from_array(rng.integers(0, 200, (5, 6, 7)).astype(np.uint8)), path, suffix == ".mha")
    assert open_image(path).shape == (5, 6, 7)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(OSError, match=rf"x\{suffix}'"):
        open_image(path)


def test_missing_program(volume, monkeypatch, tmp_path):
    monkeypatch.setenv("SHEARWARPMIP_PROGRAM", str(tmp_path / "none"))
    with pytest.raises(FileNotFoundError, match=r"SHEARWARPMIP_PROGRAM names '.*none', which is no program"):
        open_image(volume)
    monkeypatch.delenv("SHEARWARPMIP_PROGRAM")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(_program.sysconfig, "get_path", lambda _: str(tmp_path))
    with pytest.raises(FileNotFoundError, match=r"the program shear-warp-mip, .* is missing: install the wheel again"):
        open_image(volume)
    (tmp_path / "shear-warp-mip").symlink_to(PROGRAM)
    assert open_image(volume).shape == (9, 11, 14)


def test_killed_program(volume, use_script):
    use_script("kill -9 $$")
    with pytest.raises(RuntimeError, match="was ended by SIGKILL; is there too little memory"):
        open_image(volume)


def test_failure_without_words(volume, use_script):
    use_script("echo odd >&2; exit 3")
    with pytest.raises(RuntimeError, match="ended with 3: odd"):
        open_image(volume)
    use_script("exit 0")
    with pytest.raises(RuntimeError, match="wrote no volume"):
        open_image(volume)


def test_words_of_the_program_have_names_of_keywords(volume, use_script):
    use_script(
        "echo \"shear-warp-mip: warning: --series-x and '--a b' of INPUT\" >&2\n"
        "echo 'shear-warp-mip: --overlay-window: LOW; see --help' >&2; exit 1"
    )
    with pytest.warns(UserWarning) as said, pytest.raises(ValueError, match=r"^overlay_window: LOW$"):
        open_image(volume)
    (warning,) = (each for each in said if each.category is UserWarning)
    assert str(warning.message) == "series_x and '--a b' of the source"
    assert warning.filename == __file__


def test_full_disk(volume, use_script, monkeypatch, tmp_path):
    # the memory is full, the disk is not
    use_script(
        'case "$*" in *write-volume=-\\ *) '
        "echo \"shear-warp-mip: cannot write all of 'x.nrrd'; is the disk full?\" >&2; exit 1;; esac\n"
        f'exec "{PROGRAM}" "$@"'
    )
    assert open_image(volume).shape == (9, 11, 14)
    use_script("echo \"shear-warp-mip: cannot write all of 'x.nrrd'; is the disk full?\" >&2; exit 1")
    with pytest.raises(OSError, match=r"needs more room than '.*' has: set TMPDIR to another folder"):
        open_image(volume)


def test_without_files_in_memory(volume, monkeypatch):
    expected = np.asarray(open_image(volume))
    monkeypatch.delattr(os, "memfd_create")
    assert_array_equal(open_image(volume), expected)


def test_sources_are_known(volume):
    assert open_image(volume)["SourceFiles"] == quote(str(volume))


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(os.name != "posix", reason="has signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGKILL"] if hasattr(os, "memfd_create") else ["SIGINT"])
@pytest.mark.parametrize("is_deaf", [False, True])
def test_end_of_python_ends_the_reading(name, volume, tmp_path, use_script, is_deaf):
    """A signal for Python only: Ctrl-C ends the program too, and nothing is left behind."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    trap = "trap '' TERM\n" if is_deaf else ""
    use_script(
        f'{trap}echo "$@" > "{tmp_path}/arguments"; echo $$ > "{tmp_path}/pid.new"; mv "{tmp_path}/pid.new" "{tmp_path}/pid"\n'
        f"while kill -0 $PPID; do sleep 0.1; done"
    )
    code = f"""
        {HEED_INTERRUPTS}
        from itk_shearwarpmip import _program, open_image
        _program._SECONDS_TO_END = 0.5
        try:
            open_image({str(volume)!r})
        except KeyboardInterrupt:
            print("interrupted")
        """
    command = [sys.executable, "-c", textwrap.dedent(code)]
    environment = os.environ | {"TMPDIR": str(folder)}
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    while not (tmp_path / "pid").exists():
        assert child.poll() is None
        time.sleep(0.05)
    child.send_signal(getattr(signal, name))
    assert child.communicate(timeout=60)[0] == ("interrupted\n" if name == "SIGINT" else "")
    pid = int((tmp_path / "pid").read_text())
    assert any(not is_running(pid) or time.sleep(0.1) for _ in range(100))
    assert not any(folder.iterdir())
    written = Path((tmp_path / "arguments").read_text().partition("--write-volume=")[2].split()[0])
    assert written == Path("-") or not written.parent.exists()


def test_folder_that_is_not_readable(volume, tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root reads all")
    volume.chmod(0)
    with pytest.raises(OSError, match="cannot read"):
        open_image(volume)


def test_read_only_folders_are_read(volume, tmp_path):
    folder = tmp_path / "disc"
    folder.mkdir()
    shutil.move(volume, folder)
    folder.chmod(0o555)
    assert open_image(folder / volume.name).shape == (9, 11, 14)
    folder.chmod(0o755)

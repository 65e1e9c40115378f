"""Images, and what tests of the filters and of the package share."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import NamedTuple

import itk
import numpy as np
import pytest

needs_posix = pytest.mark.skipif(os.name != "posix", reason="Windows has no such signals and modes of files")
needs_proc = pytest.mark.skipif(not os.path.exists("/proc/self"), reason="only Linux lists processes in /proc")

# Runs each snippet of code in a forked child: a crash ends only the child, and itk is imported once.
_FORK_SERVER = """
import json, os, signal, sys, tempfile, traceback
import itk, numpy as np
# itk loads its libraries when a name is used: here, and not in each child
itk.ShearWarpMIPImageFilter
itk.shear_warp_mip_image_filter
itk.image_from_array(np.zeros((2, 2, 2), np.uint8))
itk.ImageFileReader
for line in sys.stdin:
    with tempfile.TemporaryFile("w+", errors="replace") as out, tempfile.TemporaryFile("w+", errors="replace") as err:
        child = os.fork()
        if child == 0:
            signal.alarm(300)  # ends a child that hangs
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            status = 0
            try:
                exec(json.loads(line), {"itk": itk, "np": np})
            except SystemExit as end:
                status = end.code or 0
                if isinstance(end.code, str):
                    print(end.code, file=sys.stderr)
                    status = 1
            except BaseException:
                traceback.print_exc()
                status = 1
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0)
        err.seek(0)
        print(json.dumps([code, out.read(), err.read()]), flush=True)
"""


class Outcome(NamedTuple):
    """As subprocess.CompletedProcess."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture(scope="session")
def isolated() -> Callable[[str], Outcome]:
    """Runs code in a process of its own; gives its exit code (negative: signal), and what it printed."""
    if not hasattr(os, "fork"):
        pytest.skip("Windows forks no process")
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
    server = subprocess.Popen(
        [sys.executable, "-c", _FORK_SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )

    def run(code: str) -> Outcome:
        print(json.dumps(code), file=server.stdin, flush=True)
        return Outcome(*json.loads(server.stdout.readline()))

    yield run
    server.communicate()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20021)


def make_rotation(x=0.0, y=0.0, z=0.0):
    transform = itk.Euler3DTransform[itk.D].New()
    transform.SetRotation(x, y, z)
    return transform


def make_image(array, spacing=(1, 1, 1), origin=(0, 0, 0), direction=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    image = itk.image_from_array(array)
    image.SetSpacing(spacing)
    image.SetOrigin(origin)
    image.SetDirection(itk.matrix_from_array(np.array(direction, float)))
    return image


def make_like(array, image):
    """An image of these voxels where the other one lies."""
    result = itk.image_from_array(array)
    result.CopyInformation(image)
    result.SetRegions(image.GetLargestPossibleRegion())
    return result


def make_oblique(rng):
    """A small anisotropic, oblique image of signed shorts: 14 x 11 x 9 voxels."""
    direction = itk.array_from_matrix(make_rotation(0.2, -0.3, 0.4).GetMatrix())
    return make_image(rng.integers(-1000, 1000, (9, 11, 14), np.int16), (0.7, 0.9, 2.1), (12.0, -30.0, 5.5), direction)


@pytest.fixture
def image(rng):
    return make_oblique(rng)


@pytest.fixture
def oblique_view(image):
    """A view of ``image`` along none of its axes."""
    return itk.ShearWarpMIPView.MakeTransform(image, itk.ShearWarpMIPViewEnums.Direction_Anterior, 35.0, 20.0)

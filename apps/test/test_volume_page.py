"""Uses a page that holds a volume in a headless Chromium, and compares its pixels to the program's.

CINE_ENGINE      the engine, a .wasm
SHEAR_WARP_MIP   the program

See also browser.py.
"""

import base64
import gzip
import os
import pathlib
import subprocess

import numpy as np
import pytest
from browser import MINUS, Page, driver, used, write_page  # noqa: F401
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

pytestmark = pytest.mark.skipif("CINE_ENGINE" not in os.environ, reason="CINE_ENGINE names the engine")

ANTERIOR = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
"""Rows of the matrix from u, v, w to the patient."""
AXES = np.array([[0.7, 0.02, 0.1], [-0.1, 0.9, 0.05], [0.0, 0.1, 1.3]])
"""Columns of an oblique, sheared volume, in mm."""
SIDES = {
    "anterior": (1, 0, 0, 0, 0, -1, 0, 1, 0),
    "posterior": (-1, 0, 0, 0, 0, -1, 0, -1, 0),
    "left": (0, 1, 0, 0, 0, -1, -1, 0, 0),
    "right": (0, -1, 0, 0, 0, -1, 1, 0, 0),
    "superior": (-1, 0, 0, 0, 1, 0, 0, 0, -1),
    "inferior": (1, 0, 0, 0, 1, 0, 0, 0, 1),
}
"""u, v, w."""


def make_voxels(bits=16, shape=(30, 36, 40)):
    """Noise with a bright ball and one voxel that is brighter, at (z, y, x) = (20, 9, 28)."""
    generator = np.random.default_rng(bits)
    most = 2**bits - 1
    voxels = generator.integers(1, most // 3, shape)
    z, y, x = np.mgrid[: shape[0], : shape[1], : shape[2]]
    voxels[(x - 12) ** 2 + (y - 20) ** 2 + (z - 11) ** 2 < 30] += most // 3
    voxels[20, 9, 28] = most - 5
    return voxels.astype(np.uint8 if bits == 8 else np.uint16)


def split_planes(voxels):
    return b"".join((voxels >> shift & 255).astype(np.uint8).tobytes() for shift in range(0, 8 * voxels.itemsize, 8))


def make_series(voxels, axes=AXES, /, **changes):
    size = np.array(voxels.shape[::-1])
    start = np.array([-20.0, 5.0, 100.0])
    center = axes @ ((size - 1) / 2) + start
    bits = 8 * voxels.itemsize
    volume = {
        "size": size.tolist(),
        "toPhysical": np.column_stack([axes, start]).tolist(),
        "view": np.column_stack([ANTERIOR, center]).tolist(),
        "center": center.tolist(),
        "axis": [0, 0, 1],
        "mode": "maximum",
        "slab": None,
        "exact": False,
        "hasOrientation": True,
        "spacing": 0.8,
        "whole": {"size": size.tolist(), "spacing": np.linalg.norm(axes, axis=0).tolist()},
        "command": ["shear-warp-mip", "INPUT"],
    }
    volume |= {key: changes.pop(key) for key in volume.keys() & changes.keys()}
    return {
        "title": "Head </script>",
        "bits": bits,
        "slope": 0.5 if bits == 16 else 4.0,
        "intercept": -100.5 if bits == 16 else -104.0,
        "background": 0,
        "inverted": False,
        "window": [0, 20000] if bits == 16 else [0, 500],
        "rate": 12,
        "labels": True,
        "volume": volume,
    } | changes


class VolumePage(Page):
    LOADED = "window.cine && cine.shown"

    def show(self, voxels=None, /, axes=AXES, engine=None, planes=None, **changes):
        self.voxels = make_voxels() if voxels is None else voxels
        self.series = make_series(self.voxels, axes, **changes)
        self.volume = self.series["volume"]
        path = self.folder / "volume.html"
        engine = pathlib.Path(os.environ["CINE_ENGINE"]).read_bytes() if engine is None else engine
        write_page(path, self.series, engine, split_planes(self.voxels) if planes is None else planes)
        self.open(path)
        self.settle()

    def settle(self):
        self.wait("cine.settled")

    def values(self):
        """The stored values on display."""
        columns, rows, text = self.run("""(() => {
          const {values, picture} = cine;
          const bytes = new Uint8Array(values.buffer);
          const parts = [];
          for (let n = 0; n < bytes.length; n += 30000) {
            parts.push(String.fromCharCode(...bytes.subarray(n, n + 30000)));
          }
          return [picture[0], picture[1], btoa(parts.join(''))];
        })()""")
        return np.frombuffer(base64.b64decode(text), self.voxels.dtype).reshape(rows, columns)

    @property
    def view(self):
        """Columns u, v, w, one after the other."""
        return tuple(np.reshape(self.run("cine.view"), (3, 4))[:, :3].T.ravel())

    def project(self, *options):
        """The program's picture of the page's view."""
        volume = self.volume
        header = [
            "NRRD0005", f"type: uint{8 * self.voxels.itemsize}", "dimension: 3", "space: left-posterior-superior",
            "sizes: {} {} {}".format(*volume["size"]), "endian: little", "encoding: raw", "kinds: domain domain domain",
        ]  # fmt: skip
        columns = np.array(volume["toPhysical"]).T
        header.append("space directions: " + " ".join("({!r},{!r},{!r})".format(*each) for each in columns[:3].tolist()))
        header.append("space origin: ({!r},{!r},{!r})".format(*columns[3].tolist()))
        source = self.folder / "volume.nrrd"
        source.write_bytes("\n".join([*header, "", ""]).encode() + self.voxels.tobytes())
        matrix = np.reshape(self.run("cine.view"), (3, 4))
        numbers = " ".join(map(repr, [*matrix[:, :3].ravel().tolist(), *matrix[:, 3].tolist()]))
        view = self.folder / "view.tfm"
        view.write_text(
            f"#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
            f"Parameters: {numbers}\nFixedParameters: 0 0 0\n"
        )
        columns, rows, spacing = self.run("cine.picture")[:3]
        target = self.folder / "picture.nrrd"
        grid = ["--size", columns, rows, "--output-spacing", repr(spacing)]
        subprocess.run(
            [os.environ["SHEAR_WARP_MIP"], source, target, "--transform", view, *map(str, grid), "--background", "0",
             *map(str, options)], check=True, capture_output=True,
        )  # fmt: skip
        head, _, data = target.read_bytes().partition(b"\n\n")
        return np.frombuffer(gzip.decompress(data) if b"encoding: gzip" in head else data, self.voxels.dtype).reshape(rows, columns)

    def check(self, *options):
        """Each pixel: its value, and its grey in the page's window."""
        self.settle()
        values = self.values()
        np.testing.assert_array_equal(values, self.project(*options))
        low, high = self.window
        real = self.series["slope"] * values.astype(float) + self.series["intercept"]
        grey = np.floor(255 * np.clip((real - low) / (high - low), 0, 1) + 0.5)
        grey[values == 0] = 0
        np.testing.assert_array_equal(self.pixels(), grey)
        return values


@pytest.fixture
def page(driver, tmp_path):
    with used(VolumePage(driver, tmp_path)) as page:
        yield page


@pytest.mark.parametrize("bits", [8, 16])
def test_pixels(page, bits):
    page.show(make_voxels(bits))
    assert page.check().any()

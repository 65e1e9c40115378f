"""Uses a page that holds a volume in a headless Chromium, and compares its pixels to the program's.

CINE_ENGINE      the engine, a .wasm
SHEAR_WARP_MIP   the program

See also browser.py.
"""

import base64
import gzip
import json
import os
import pathlib
import shlex
import subprocess

import numpy as np
import pytest
from browser import MINUS, Page, pack, used, write_page
from selenium.webdriver.common.action_chains import ActionChains
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
        "backgroundVoxel": 0,
        "command": ["shear-warp-mip", "INPUT"],
    }
    volume |= {key: changes.pop(key) for key in volume.keys() & changes.keys()}
    return {
        "title": "Head </script>",
        "bits": bits,
        "slope": 0.5 if bits == 16 else 4.0,
        "intercept": -1024.5 if bits == 16 else -104.0,
        "background": 0,
        "inverted": False,
        "window": [-500, 20000] if bits == 16 else [0, 500],
        "rate": 12,
        "labels": True,
        "volume": volume,
    } | changes


ENCODE = """() => {
  const bytes = new Uint8Array(cine.values.buffer);
  const parts = [];
  for (let n = 0; n < bytes.length; n += 30000) {
    parts.push(String.fromCharCode(...bytes.subarray(n, n + 30000)));
  }
  return btoa(parts.join(''));
}"""


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
        return self.decode(self.run(f"({ENCODE})()"))

    def decode(self, text):
        columns, rows = self.run("cine.picture.slice(0, 2)")
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
        header.append(
            "space directions: " + " ".join("({!r},{!r},{!r})".format(*each) for each in columns[:3].tolist())
        )
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
        return self.read_picture(target)

    def read_picture(self, path):
        head, _, data = path.read_bytes().partition(b"\n\n")
        columns, rows = self.run("cine.picture.slice(0, 2)")
        return np.frombuffer(gzip.decompress(data) if b"encoding: gzip" in head else data, self.voxels.dtype).reshape(
            rows, columns
        )

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


BRIGHT = (28, 9, 20)
"""The voxel that make_voxels() makes brightest."""


def find_place(page, index):
    """Of a voxel, in the patient."""
    return np.array(page.volume["toPhysical"]) @ [*index, 1]


def find_pixel(page, place):
    """The pixel of the picture that shows a place: column and row, not rounded."""
    matrix = np.reshape(page.run("cine.view"), (3, 4))
    u, v, _ = np.linalg.solve(matrix[:, :3], place - matrix[:, 3])
    spacing, _, *origin = page.run("cine.picture.slice(2)")
    return (np.array([u, v]) - origin) / spacing


def find_on_stage(page, pixel):
    """Right of and below the stage's middle."""
    box, stage = page.box, page.stage.rect
    columns, rows = page.run("cine.picture.slice(0, 2)")
    return (
        box["left"] + (pixel[0] + 0.5) * box["width"] / columns - stage["x"] - stage["width"] / 2,
        box["top"] + (pixel[1] + 0.5) * box["height"] / rows - stage["y"] - stage["height"] / 2,
    )


def click(page, x, y):
    page.point_at(x, y)
    ActionChains(page.driver).click().perform()
    page.settle()


def click_bright(page):
    click(page, *find_on_stage(page, np.round(find_pixel(page, find_place(page, BRIGHT)))))


def replace_text(page, name, change):
    """Opens the page again, whose script with this id is changed."""
    path = page.folder / "volume.html"
    head, tail = path.read_text("utf-8").split(f'id="{name}">')
    text, end = tail.split("</script>", 1)
    path.write_text(f'{head}id="{name}">{change(text)}</script>{end}', "utf-8")
    page.open(path)


def inject(page, script):
    """Runs a script before the pages' own ones, until the end of the test."""
    return page.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})["identifier"]


@pytest.fixture
def injected(page):
    scripts = []
    yield lambda script: scripts.append(inject(page, script))
    for each in scripts:
        page.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", {"identifier": each})


@pytest.mark.parametrize("bits", [8, 16])
def test_pixels(page, bits):
    page.show(make_voxels(bits))
    assert page.driver.title == page.text("title") == page.series["title"]
    assert page.check().any()
    page.drag(57, 31)
    turned = page.check()
    page.press("t")
    page.drag(-40, 70)
    assert (page.check() != turned).any()


def test_first_view(page):
    """With another middle, oblique, and with a slab, which stays where it is in the patient."""
    c, s = np.cos(0.4), np.sin(0.4)
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ ANTERIOR
    voxels = make_voxels()
    center = np.array(make_series(voxels)["volume"]["center"])
    view = np.column_stack([matrix, center + matrix @ [3.0, -4.0, 10.0]])
    page.show(voxels, view=view.tolist(), slab=[-20.0, -4.0], mode="minimum")
    assert page.run("cine.state.slab") == pytest.approx([-10, 6])
    np.testing.assert_allclose(page.run("[3, 7, 11].map((n) => cine.view[n])"), center)
    page.check("--mode", "minimum", "--slab", *page.run("cine.state.slab"))
    assert page.text("view-name") == "LAO 22.9°"
    assert page.text("mode-name") == "Minimum"
    assert page.text("slab-name") == f"Slab 16.0 mm at {MINUS}2.0 mm"


def test_first_view_with_a_scale(page):
    """Nothing is cut off."""
    center = np.array(make_series(make_voxels())["volume"]["center"])
    page.show(view=np.column_stack([0.6 * np.array(ANTERIOR), center]).tolist())
    assert page.text("view-name") == "Anterior" == page.element("view").find_element("css selector", ":checked").text
    page.drag(70, 50)
    values = page.check()
    assert not any(edge.any() for edge in (values[0], values[-1], values[:, 0], values[:, -1]))


def test_picture_is_on_voxels(page):
    """Pixels of a first view along the axes have the voxels' values, not means of neighbours."""
    voxels = make_voxels(shape=(24, 31, 36))
    page.show(voxels, np.diag([0.8, 0.8, 0.8]))
    values = page.check()
    first = find_pixel(page, find_place(page, (0, 0, 23)))
    np.testing.assert_allclose(first, np.round(first), atol=1e-6)
    x, y = np.round(first).astype(int)
    np.testing.assert_array_equal(values[y : y + 24, x : x + 36], voxels.max(axis=1)[::-1])


def test_picture_of_very_long_voxels(page):
    page.show(make_voxels(), np.diag([0.01, 0.01, 20.0]), spacing=0.01)
    columns, rows, spacing = page.run("cine.picture.slice(0, 3)")
    assert max(columns, rows) <= 4097 and columns * spacing > 600


def test_drag_turns_about_the_long_axis(page):
    page.show()
    degrees = 180 / page.stage.rect["height"]
    page.drag(-100)
    page.settle()
    assert page.text("view-name") == f"LAO {100 * degrees:.1f}°"
    page.drag(0, 30)
    page.settle()
    assert page.text("view-name") == f"LAO {100 * degrees:.1f}° CRA {30 * degrees:.1f}°"
    page.drag(0, 250)
    page.drag(0, 250)
    page.settle()
    assert page.text("view-name") == f"LAO {100 * degrees:.1f}° CRA 90°"
    page.drag(0, -250)
    for _ in range(5):
        page.drag(-400)
    page.settle()
    azimuth = (2100 * degrees + 180) % 360 - 180
    assert page.text("view-name").startswith(f"{'LAO' if azimuth > 0 else 'RAO'} {abs(azimuth):.1f}°")
    assert page.window == page.series["window"] and page.run("cine.zoom") == 1
    assert page.run("cine.point") is None


def test_trackball(page):
    """Goes on over the poles."""
    page.show()
    page.press("t")
    assert page.text("message") == "Turning as a trackball"
    page.drag(0, 260)
    page.drag(0, 260)
    page.settle()
    down = np.radians(520 * 180 / page.stage.rect["height"])
    expected = [1, 0, 0, 0, -np.sin(down), -np.cos(down), 0, np.cos(down), -np.sin(down)]
    np.testing.assert_allclose(page.view, expected, atol=1e-9)
    page.drag(100)
    page.settle()
    assert "roll" in page.text("view-name")
    page.press("t")
    assert page.text("message") == "Turning about the long axis"
    roll = page.text("view-name").split("roll")[1]
    page.drag(60)
    page.settle()
    assert page.text("view-name").split("roll")[1] == roll
    page.check()


def test_small_angle_has_a_name(page):
    center = np.array(make_series(make_voxels())["volume"]["center"])
    c, s = np.cos(6e-4), np.sin(6e-4)
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ ANTERIOR
    page.show(view=np.column_stack([matrix, center]).tolist())
    assert page.text("view-name") == "Anterior"


@pytest.mark.parametrize("is_trackball", [False, True])
def test_mirrored_view(page, is_trackball):
    """Has no roll, says so, and its front follows the pointer."""
    center = np.array(make_series(make_voxels())["volume"]["center"])
    page.show(view=np.column_stack([np.array(ANTERIOR) * (-1, 1, 1), center]).tolist())
    assert page.text("view-name") == "Anterior mirrored" and page.element("view").get_property("value") == ""
    if is_trackball:
        page.press("t")
    front = -np.array(page.view[6:])
    page.drag(40)
    page.drag(0, 20)
    page.check()
    u, v, _ = np.reshape(page.view, (3, 3))
    assert u @ front > 0.1 and v @ front > 0.05
    if not is_trackball:
        degrees = 180 / page.stage.rect["height"]
        assert page.text("view-name") == f"LAO {40 * degrees:.1f}° CRA {20 * degrees:.1f}° mirrored"


@pytest.mark.parametrize("zero", [0.0, -0.0, 1e-17, -1e-17])
def test_half_turn_is_positive(page, zero):
    """Also where it is rounded."""
    center = np.array(make_series(make_voxels())["volume"]["center"])
    c, s = np.cos(0.1), np.sin(0.1)
    page.show(view=np.column_stack([[[-1, zero, 0], [zero, c, -s], [0, -s, -c]], center]).tolist())
    assert page.text("view-name").startswith("LAO 180° CRA 84.3°")


def test_page_without_a_title(page):
    page.show(title="")
    assert page.canvas.get_attribute("aria-label").startswith("Anterior. Patient: ")
    assert page.save_picture()[0] == "anterior.png"


def test_keys_turn(page):
    page.show()
    for keys, name in (
        ([Keys.ARROW_LEFT] * 3, "LAO 15°"),
        ([Keys.ARROW_DOWN] * 2, "LAO 15° CRA 10°"),
        ([Keys.ARROW_UP] * 3 + [Keys.ARROW_RIGHT] * 4, "RAO 5° CAU 5°"),
        ([Keys.ARROW_UP] * 20, "RAO 5° CAU 90°"),
    ):
        page.press(*keys)
        page.settle()
        assert page.text("view-name") == name
    spoken = page.canvas.get_attribute("aria-label")
    assert spoken.startswith(f"{page.series['title']}. RAO 5° CAU 90°. Patient: right at the left, left at the right")
    page.wait("document.getElementById('spoken').textContent === 'RAO 5° CAU 90°'")


LETTERS = {
    "anterior": "RLHF",
    "posterior": "LRHF",
    "left": "APHF",
    "right": "PAHF",
    "superior": "LRAP",
    "inferior": "RLAP",
}


@pytest.mark.parametrize("how", ["keys", "list"])
def test_named_views(page, how):
    page.show()
    page.drag(50, 50)
    for number, (name, axes) in enumerate(SIDES.items(), 1):
        if how == "keys":
            page.press(str(number))
        else:
            Select(page.element("view")).select_by_value(name)
        page.settle()
        assert page.view == axes
        assert page.text("view-name") == name.capitalize()
        assert page.element("view").get_property("value") == name
        assert "".join(page.text(f"{side}-letter") for side in ("left", "right", "top", "bottom")) == LETTERS[name]
        page.check()
    page.drag(20)
    page.settle()
    assert page.element("view").get_property("value") == ""


def test_list_that_was_clicked_leaves_the_keys(page):
    page.show()
    page.element("view").click()
    page.press(Keys.ARROW_DOWN, Keys.ENTER)
    page.settle()
    assert page.text("view-name") == "Posterior"
    page.press("4")
    page.settle()
    assert page.text("view-name") == "Right"
    # one that was reached with Tab keeps them
    with page.held(Keys.SHIFT):
        page.press(Keys.TAB)
    page.press(Keys.TAB)
    assert page.run("document.activeElement.id") == "view"
    page.press(Keys.ARROW_DOWN)
    page.settle()
    assert page.text("view-name") == "Superior"
    assert page.run("document.activeElement.id") == "view"


def test_volume_without_orientation(page):
    page.show(hasOrientation=False)
    assert page.text("left-letter") == "" and "Patient" not in page.canvas.get_attribute("aria-label")
    click_bright(page)
    assert page.text("point-position").startswith("x ")


def test_title_is_the_mode(page):
    for title in ("Maximum intensity projection", "Case 7"):
        page.show(title=title)
        page.press("m")
        assert page.text("title") == page.driver.title == title.replace("Maximum", "Minimum")
        page.press("r")
        assert page.text("title") == title


def test_point_whose_value_is_cut(page):
    voxels = np.minimum(make_voxels(8), 100)
    x, y, z = BRIGHT
    voxels[z - 2 : z + 3, y - 2 : y + 3, x - 2 : x + 3] = 100
    page.show(voxels, cut=[-1, 100])
    click_bright(page)
    assert page.text("point-value") == "\u2265 296"


def test_modes(page):
    """Each has its own window."""
    page.show()
    first = page.window
    page.press("+")
    widened = page.window
    page.press("m")
    values = page.check("--mode", "minimum")
    assert page.text("mode-name") == "Minimum"
    seen = np.sort(values[values > 0])
    low, high = (seen[int(fraction * (seen.size - 1) + 0.5)] for fraction in (0.01, 0.998))
    slope, intercept = page.series["slope"], page.series["intercept"]
    assert page.window == pytest.approx([slope * low + intercept, slope * high + intercept])
    page.press("-", "m")
    page.check("--mode", "mean")
    assert page.text("mode-name") == "Mean"
    page.press("m")
    page.check()
    assert page.text("mode-name") == "" and page.window == widened
    page.press("w")
    Select(page.element("mode")).select_by_value("minimum")
    page.settle()
    assert page.window[1] - page.window[0] == pytest.approx(slope * (high - low) / 1.1)
    page.element("width").send_keys(Keys.ESCAPE)
    page.press("r")
    page.settle()
    assert page.text("mode-name") == "" and page.window == first
    page.press("m")
    page.settle()
    assert page.window == pytest.approx([slope * low + intercept, slope * high + intercept])


def test_window_of_a_uniform_body(page):
    """It is white, as the program shows it."""
    voxels = np.full((30, 36, 40), 20000, np.uint16)
    voxels[3, 4, 5] = 7
    page.show(voxels)
    page.press("m")
    page.check("--mode", "minimum")
    value = page.series["slope"] * 20000 + page.series["intercept"]
    assert page.window == pytest.approx([value - 1, value])


def slab_of(page):
    page.settle()
    return page.run("cine.state.slab")


def test_slab(page):
    page.show()
    page.press("]")
    assert slab_of(page) is None and page.text("message") == "There is no slab: press , for one"
    page.press(".")
    assert slab_of(page) is None
    page.press(",")
    half = slab_of(page)
    page.press(*"," * 3)
    near, far = slab_of(page)
    assert near == pytest.approx(-far) and [near, far] == pytest.approx([0.8**3 * each for each in half])
    page.check("--slab", near, far)
    page.press("]", "]", "[")
    assert slab_of(page) == pytest.approx([near + (far - near) / 4, far + (far - near) / 4])
    page.check("--slab", *slab_of(page))
    page.press("[", ">")
    assert slab_of(page) == pytest.approx([1.25 * near, 1.25 * far])
    page.press("<")
    assert slab_of(page) == pytest.approx([near, far])
    page.wheel(120)
    page.wheel(120)
    assert slab_of(page) == pytest.approx([near + (far - near) / 2, far + (far - near) / 2])
    assert page.run("cine.zoom") == 1
    page.wheel(-120, Keys.CONTROL)
    assert page.run("cine.zoom") == pytest.approx(1.2)
    page.press(*"." * 20)
    assert slab_of(page) is None and page.text("slab-name") == ""
    page.wheel(120)
    assert page.run("cine.zoom") == pytest.approx(1)


def test_slab_by_number(page):
    page.show()
    page.press("w")
    assert not page.element("slab-thickness").is_enabled()
    page.element("slab").click()
    near, far = slab_of(page)
    assert near == -far < 0
    page.type("slab-thickness", "8.5")
    page.type("slab-position", "-3")
    assert slab_of(page) == [-7.25, 1.25]
    page.check("--slab", -7.25, 1.25)
    assert page.text("slab-name") == f"Slab 8.5 mm at {MINUS}3.0 mm"
    assert float(page.element("slab-position-slider").get_property("value")) == -3
    for name, text in (("slab-thickness", "0"), ("slab-thickness", "-1"), ("slab-position", "")):
        page.type(name, text)
        assert slab_of(page) == [-7.25, 1.25]
        assert "the thickness must be above 0" in page.text("slab-problem")
        page.type("slab-thickness", "8.5")
        page.type("slab-position", "-3")
        assert page.text("slab-problem") == ""
    page.driver.execute_script("arguments[0].focus()", page.element("slab-position-slider"))
    page.press(Keys.END)
    assert slab_of(page)[0] > 10
    page.element("slab").click()
    assert slab_of(page) is None
    page.check()
    page.screenshot("volume-box")


def test_slab_of_a_small_volume(page):
    page.show(make_voxels(), AXES * 1e-6, spacing=0.8e-6)
    page.press("w")
    page.element("slab").click()
    near, far = slab_of(page)
    assert float(page.element("slab-thickness").get_property("value")) == pytest.approx(far - near, rel=1e-3)


def test_pick(page):
    page.show()
    click_bright(page)
    place = find_place(page, BRIGHT)
    point = page.run("cine.point")
    assert point["index"] == list(BRIGHT)
    assert np.abs(np.array(point["position"]) - place).max() < 0.8
    picked = np.round(find_pixel(page, point["position"])).astype(int)
    value = 0.5 * page.values()[picked[1], picked[0]] - 1024.5
    assert page.text("point-value") == f"{value:.1f}"
    position = [float(each.split()[1]) for each in page.text("point-position").removesuffix(" mm").split("  ")]
    np.testing.assert_allclose(position, np.abs(place), atol=0.8)
    assert [each[0] for each in page.text("point-position").split("  ")] == ["R" if place[0] < 0 else "L", "P", "H"]
    assert page.text("point-index") == "voxel 28, 9, 20"

    def require_cross():
        box = page.box_of("#cross")
        x, y = find_on_stage(page, find_pixel(page, page.run("cine.point.position")))
        stage = page.stage.rect
        expected = stage["x"] + stage["width"] / 2 + x, stage["y"] + stage["height"] / 2 + y
        assert (box["left"] + box["width"] / 2, box["top"] + box["height"] / 2) == pytest.approx(expected, abs=0.51)

    require_cross()
    page.screenshot("volume-pick")
    page.drag(90, 40)
    page.settle()
    require_cross()
    page.press("z", "z")
    page.drag(-60, 30, MouseButton.MIDDLE)
    require_cross()
    _, marked = page.save_picture()
    page.press(Keys.ESCAPE)
    assert page.run("cine.point") is None
    assert not page.element("cross").is_displayed() and not page.element("point").is_displayed()
    name, plain = page.save_picture()
    assert name.startswith("Head _-script_-rao-") or name.startswith("Head __script_-rao-")
    changed = np.argwhere((marked != plain).any(axis=2))
    assert 60 < len(changed) < 400 and np.ptp(changed, axis=0).max() <= 32


def test_pick_says_what_it_lacks(page):
    page.show()
    click(page, 200, 0)
    assert page.text("message") == "There is nothing at this point" and page.run("cine.point") is None
    page.press("m", "m")
    page.settle()
    click_bright(page)
    assert page.text("message") == "A mean has no point" and page.run("cine.point") is None
    page.press(Keys.ARROW_LEFT)
    assert page.text("message") == ""


def test_double_click_leaves_no_point(page):
    page.show()
    page.drag(100, 20)
    click(page, 0, 0)
    assert page.run("cine.point")
    page.double_click()
    page.settle()
    assert page.view == SIDES["anterior"] and page.run("cine.point") is None
    # also if the point comes after the reset
    page.driver.execute_script("""
      const {x, y, width, height} = document.getElementById('stage').getBoundingClientRect();
      for (const name of ['click', 'dblclick']) {
        stage.dispatchEvent(new MouseEvent(name, {clientX: x + width / 2, clientY: y + height / 2}));
      }
    """)
    page.settle()
    assert page.run("cine.point") is None


@pytest.mark.parametrize("is_known", [False, True])
def test_index_in_the_whole_volume(page, is_known):
    """Of a volume that was cropped by (10, 20, 30) and halved."""
    voxels = make_voxels()
    volume = make_series(voxels)["volume"]
    matrix = np.array(volume["toPhysical"])
    axes = matrix[:, :3] / 2
    start = matrix[:, 3] - axes @ [0.5, 0.5, 0.5] - axes @ [10, 20, 30]
    whole = {"size": [200, 210, 220], "spacing": np.linalg.norm(axes, axis=0).tolist()}
    if is_known:
        whole["toPhysical"] = np.column_stack([axes, start]).tolist()
    page.show(voxels, whole=whole)
    click_bright(page)
    index = page.run("cine.point.index")
    if is_known:
        assert np.abs(np.array(index) - (2 * np.array(BRIGHT) + [10.5, 20.5, 30.5])).max() <= 1.5
        assert page.text("point-index") == "voxel {}, {}, {}".format(*index)
    else:
        assert page.text("point-index") == "voxel 28, 9, 20 of the reduced volume"


def test_exact_at_rest(page):
    page.show()
    page.drag(40, 20)
    plain = page.check()
    page.press("e")
    assert page.text("message") == "Exact at rest"
    exact = page.check("--exact")
    assert (exact != plain).any()
    assert page.text("mode-name") == "exact"
    page.press("m")
    page.check("--exact", "--mode", "minimum")
    assert page.text("mode-name") == "Minimum, exact"
    page.press("m")
    page.check("--mode", "mean")
    page.press("m", "w")
    page.settle()
    page.element("exact").click()
    np.testing.assert_array_equal(page.check(), plain)


def test_movement_has_the_plain_picture(page):
    page.show(exact=True)
    assert page.run("cine.isExact")
    seen = page.driver.execute_async_script("""
      const done = arguments[0];
      const seen = [];
      const look = () => {
        seen.push([performance.now(), cine.isExact]);
        if (seen.length > 1 && cine.isExact && !seen.at(-2)[1]) { done(seen); } else { requestAnimationFrame(look); }
      };
      document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft', bubbles: true}));
      seen.push([performance.now(), true]);
      look();
    """)
    plain = [when for when, is_exact in seen if not is_exact]
    assert plain and seen[-1][0] - seen[0][0] >= 115


def move(page):
    """Turns by a key; whether the first picture is coarse, and its stored values."""
    is_coarse, text = page.driver.execute_async_script(f"""
      const [done] = arguments;
      const {{state}} = cine;
      // at once when the picture is drawn, before a later one
      const observer = new MutationObserver(() => {{
        if (cine.state !== state) {{
          observer.disconnect();
          done([cine.isCoarse, ({ENCODE})()]);
        }}
      }});
      observer.observe(document.querySelector('canvas'), {{attributes: true}});
      document.body.dispatchEvent(new KeyboardEvent('keydown', {{key: 'ArrowLeft', bubbles: true}}));
    """)
    return is_coarse, page.decode(text)


SLOW = """
  const {get, set} = Object.getOwnPropertyDescriptor(Worker.prototype, 'onmessage');
  Object.defineProperty(Worker.prototype, 'onmessage', {get, set(react) {
    set.call(this, (event) => {
      if ('milliseconds' in event.data) {
        event.data.milliseconds = 99;
      }
      react(event);
    });
  }});
"""
"""Pictures seem to take long."""


def test_slow_pictures_move_with_half_the_resolution(page, injected):
    """Of maxima, until they rest."""
    voxels = make_voxels()
    page.show(voxels)
    assert not move(page)[0]
    injected(SLOW)
    page.show(voxels)
    assert not page.run("cine.isCoarse")
    is_coarse, values = move(page)
    assert is_coarse
    half = voxels.reshape(15, 2, 18, 2, 20, 2).max(axis=(1, 3, 5))
    matrix = np.array(page.volume["toPhysical"])
    matrix[:, 3] += matrix[:, :3].sum(axis=1) / 2
    matrix[:, :3] *= 2
    page.voxels, page.volume = half, {"size": half.shape[::-1], "toPhysical": matrix.tolist()}
    np.testing.assert_array_equal(values, page.project())
    page.voxels, page.volume = voxels, page.series["volume"]
    assert (page.check() != values).any()
    page.press("m")
    page.settle()
    assert not move(page)[0]
    page.check("--mode", "minimum")


def test_thin_slab_moves_with_the_full_resolution(page, injected):
    """Between voxels of half the resolution it would have holes."""
    injected(SLOW)
    page.show(make_voxels(), np.diag([1.0, 1.0, 1.0]), spacing=1.0, slab=[-3, 3])
    assert move(page)[0]
    page.press(*"," * 8)
    page.settle()
    assert not move(page)[0]


def test_plays_a_turn(page):
    page.show()
    page.press(Keys.ARROW_DOWN, " ")
    assert page.run("cine.playing") and page.element("play").get_attribute("aria-label") == "Pause"
    seen = page.driver.execute_async_script("""
      const done = arguments[0];
      const read = () => [performance.now(), Math.atan2(cine.view[4], cine.view[0])];
      const first = read();
      setTimeout(() => done([first, read()]), 1500);
    """)
    turned = np.degrees(seen[1][1] - seen[0][1]) % 360
    assert turned == pytest.approx((seen[1][0] - seen[0][0]) * 360 / 8000, abs=10)
    page.drag(1)
    assert not page.run("cine.playing")
    page.settle()
    assert page.text("view-name").endswith("CRA 5°")
    page.check()


def test_plays_while_the_window_changes(page):
    page.show()
    page.press(" ")
    page.drag(30, 30, MouseButton.RIGHT)
    assert page.window != page.series["window"] and page.run("cine.playing")


def test_one_request_at_a_time(page, injected):
    injected("""
      window.open = 0;
      window.most = 0;
      const send = Worker.prototype.postMessage;
      Worker.prototype.postMessage = function (...message) {
        window.most = Math.max(window.most, ++window.open);
        ++window.asked;
        send.apply(this, message);
      };
      const {get, set} = Object.getOwnPropertyDescriptor(Worker.prototype, 'onmessage');
      Object.defineProperty(Worker.prototype, 'onmessage', {get, set(react) {
        set.call(this, (event) => { window.open -= event.data.fraction === undefined; react(event); });
      }});
    """)
    page.show()
    page.driver.execute_script("""
      window.asked = 0;
      for (let n = 0; n < 9; ++n) {
        document.body.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft', bubbles: true}));
      }
    """)
    page.settle()
    assert page.run("[open, most, asked]") == [0, 1, 2]  # the first and the last
    assert page.text("view-name") == "LAO 45°"


def test_command(page, tmp_path, injected):
    """It makes this picture."""
    injected("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    page.show(command=["shear-warp-mip", "INPUT", "--background", "0", "--series", "it's one"])
    page.press("c")
    page.wait("window.copied")
    first, window = page.run("copied"), "--window -500 20000"
    columns, rows = page.run("cine.picture.slice(0, 2)")
    grid = f"--size {columns} {rows} --output-spacing 0.8"
    start = "shear-warp-mip INPUT mip.png --background 0 --series 'it'\\''s one'"
    assert first == f"{start} --view anterior {grid} {window}"
    assert page.text("message") == "The command is copied"
    page.drag(-33, 45)
    page.press("m", *"," * 8)
    page.settle()
    page.press("+", "e", "c")
    page.settle()
    page.wait(f"copied !== {json.dumps(first)}")
    words = shlex.split(page.run("copied"))
    assert {"--azimuth", "--elevation", "--mode", "--slab", "--exact"} < set(words) and "--view" not in words
    words[:3] = [os.environ["SHEAR_WARP_MIP"], page.folder / "volume.nrrd", page.folder / "command.nrrd"]
    del words[words.index("--series") : words.index("--series") + 2]
    expected = page.check("--mode", "minimum", "--exact", "--slab", *slab_of(page))
    subprocess.run(words, check=True)
    np.testing.assert_array_equal(page.read_picture(page.folder / "command.nrrd"), expected)
    copied = page.run("copied")
    page.press("t")
    page.drag(40, 60)
    page.drag(40, -60)
    page.press("c")
    assert page.text("message") == "No command alone makes this view: it needs a file of the transform"
    assert page.run("copied") == copied


def test_command_after_playing(page, injected):
    injected("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    injected("""
      const ask = window.requestAnimationFrame;
      window.requestAnimationFrame = (react) => ask((now) => react(now + 1 / 3000));
    """)
    page.show()
    page.press(" ")
    page.wait("cine.view[4] > 0.2")
    page.press(" ", "c")
    page.wait("document.getElementById('message').textContent")
    assert page.text("message") == "The command is copied" and "--azimuth" in page.run("copied")


def test_command_before_the_picture_of_a_mode(page, injected):
    """It does not have the window of another mode."""
    injected("navigator.clipboard.writeText = async (text) => { window.copied = text; }")
    page.show()
    page.driver.execute_script("""
      for (const key of ['m', 'c']) {
        document.body.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true}));
      }
    """)
    page.wait("window.copied")
    assert "--mode minimum" in page.run("copied") and "--window" not in page.run("copied")


def test_constant_picture_is_black_if_it_is_background(page):
    voxels = np.full((20, 22, 24), 5, np.uint16)
    for background in 5, 4:
        page.show(voxels, backgroundVoxel=background, window=[100, 200])
        page.press("m")
        values = page.check("--mode", "minimum")
        assert page.text("mode-name") == "Minimum" and (values == 5).any()
        assert page.pixels().max() == (0 if background == 5 else 255)


def test_window_leaves_out_voxels_of_background(page):
    voxels = make_voxels()
    voxels[:, :, 7:] = 9
    page.show(voxels, backgroundVoxel=9)
    page.press("m")
    values = page.check("--mode", "minimum")
    seen = np.sort(values[(values > 0) & (values != 9)])
    assert 0 < seen.size < (values == 9).sum()
    stored = np.array([seen[int(fraction * (seen.size - 1) + 0.5)] for fraction in (0.01, 0.998)])
    assert page.window == pytest.approx(page.series["slope"] * stored + page.series["intercept"])


def test_help_says_what_the_page_holds(page):
    page.show()
    page.press("?")
    text = "This page holds 40 \u00d7 36 \u00d7 30 voxels, whose values are rounded to steps of 0.5. It loads nothing and sends nothing."
    assert page.text("about").startswith(text)
    page.press("?")


def test_minus_as_it_is_typeset(page):
    page.show()
    low, high = page.window
    page.press(MINUS)
    assert np.diff(page.window) == pytest.approx((high - low) / 1.1)


def test_reset(page):
    page.show(slab=[-5, 5], azimuth=0)
    first = page.check("--slab", "-5", "5")
    page.drag(50, 50)
    page.press("t", "m", "e", "z", "i", ".", "+", "l")
    page.settle()
    click_bright(page)
    assert not page.element("labels").is_displayed()
    page.press("r")
    assert page.element("labels").is_displayed()
    np.testing.assert_array_equal(page.check("--slab", "-5", "5"), first)
    assert page.run("cine.zoom") == 1 and not page.run("cine.inverted") and page.run("cine.point") is None
    page.drag(0, 300)
    page.drag(0, 300)
    page.settle()
    assert page.text("view-name") == "CRA 90°"  # about the axis again


def test_presets_of_the_volume(page):
    page.show()
    page.press("w")
    names = [each.text for each in Select(page.element("preset")).options if each.get_attribute("hidden") is None]
    assert names == ["Automatic", "Full range", "Lung", "Bone", "Angio", "Brain"]
    Select(page.element("preset")).select_by_visible_text("Full range")
    least, most = page.voxels.min(), page.voxels.max()
    assert page.window == pytest.approx([0.5 * least - 1024.5, 0.5 * most - 1024.5])
    page.check()


def test_touch(page):
    page.show()
    page.touch([(500, 300), (480, 300), (450, 300)])
    page.settle()
    assert page.text("view-name") == f"LAO {50 * 180 / page.stage.rect['height']:.1f}°"
    view = page.view
    page.touch([(480, 300), (440, 300), (400, 300)], [(520, 300), (560, 300), (600, 300)])
    assert page.run("cine.zoom") == pytest.approx(5) and page.view == view
    page.press("r", "1")
    page.settle()
    stage = page.stage.rect
    x, y = find_on_stage(page, np.round(find_pixel(page, find_place(page, BRIGHT))))
    page.touch([(round(stage["x"] + stage["width"] / 2 + x), round(stage["y"] + stage["height"] / 2 + y))])
    page.wait("cine.point")
    assert page.run("cine.point.index") == list(BRIGHT)


def test_second_finger(page):
    """Ends the turn; the finger that remains moves the picture."""
    page.show()

    def send(kind, **fingers):
        points = [{"x": x, "y": y, "id": int(name[1:])} for name, (x, y) in fingers.items()]
        page.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    send("touchStart", f1=(500, 300))
    send("touchMove", f1=(480, 300))
    page.settle()
    view = page.view
    assert page.text("view-name") == f"LAO {20 * 180 / page.stage.rect['height']:.1f}°"
    send("touchStart", f1=(480, 300), f2=(580, 300))
    send("touchMove", f1=(430, 300), f2=(630, 300))
    page.wait("cine.zoom > 1.99")
    assert page.run("cine.zoom") == pytest.approx(2)
    left = page.box["left"]
    send("touchEnd", f1=(430, 300))
    send("touchMove", f2=(600, 300))
    page.wait(f"document.querySelector('canvas').getBoundingClientRect().left === {left} - 30")
    assert page.run("cine.zoom") == pytest.approx(2)
    send("touchEnd")
    page.settle()
    assert page.view == view and page.run("cine.point") is None
    # a drag that the browser ends is no click, and the next one turns again
    send("touchStart", f3=(500, 300))
    send("touchCancel")
    assert page.element("stage").get_attribute("class") == ""
    page.touch([(500, 300), (520, 300)])
    page.settle()
    assert page.text("view-name") == "Anterior" and page.run("cine.point") is None


def test_drag_that_loses_the_pointer(page):
    """Ends, though the button is still down."""
    page.show()
    chain = ActionChains(page.driver, duration=0).move_to_element(page.stage).click_and_hold().move_by_offset(-20, 0)
    chain.perform()
    page.settle()
    turned = page.text("view-name")
    assert turned.startswith("LAO") and page.element("stage").get_attribute("class") == "turning"
    page.driver.execute_script(
        """
      const [stage] = arguments;
      for (let n = 0; n < 100; ++n) {
        if (stage.hasPointerCapture(n)) { stage.releasePointerCapture(n); }
      }
    """,
        page.stage,
    )
    ActionChains(page.driver, duration=0).move_by_offset(-20, 0).perform()
    ActionChains(page.driver, duration=0).move_by_offset(-20, 0).perform()
    page.settle()
    assert page.text("view-name") == turned and page.element("stage").get_attribute("class") == ""
    ActionChains(page.driver).release().perform()


@pytest.mark.parametrize("scale", [1.5, 2])
def test_screen_with_small_pixels(page, scale):
    """The picture is sharp, and a click finds what is below it."""
    page.set_screen(1000, 720, scale, mobile=False)
    page.show()
    assert page.run("devicePixelRatio") == scale
    page.drag(33, 20)
    page.settle()
    page.press("l")
    seen, grey = page.screenshot(f"volume-scale-{scale}"), page.pixels()
    box, place = page.box, find_pixel(page, find_place(page, BRIGHT))
    assert seen.shape[1] == 1000 * scale
    columns = slice(grey.shape[1] // 4, 3 * grey.shape[1] // 4)
    for row in range(grey.shape[0] // 4, 3 * grey.shape[0] // 4):
        y = round(scale * (box["top"] + (row + 0.5) * box["height"] / grey.shape[0]))
        x = [round(scale * (box["left"] + (n + 0.5) * box["width"] / grey.shape[1])) for n in range(grey.shape[1])]
        np.testing.assert_array_equal(seen[y, x][columns, 0], grey[row, columns])
    click(page, *find_on_stage(page, np.round(place)))
    assert page.run("cine.point.index") == list(BRIGHT)


def test_screen_whose_pixels_change(page, injected):
    """As by a move of the window to another screen."""
    injected("""
      const match = window.matchMedia.bind(window);
      window.matchMedia = (query) => (query.includes('resolution') ? (window.resolution = match(query)) : match(query));
    """)
    page.show(make_voxels(shape=(60, 72, 80)))
    page.press(*"zzz", key=Keys.SHIFT)
    for scale in (2, 1, 2):
        page.driver.execute_script(
            """
            Object.defineProperty(window, 'devicePixelRatio', { value: arguments[0], configurable: true });
            resolution.dispatchEvent(new Event('change'));
            """,
            scale,
        )
        assert page.run("resolution.media") == f"(resolution: {scale}dppx)"
        assert page.run("document.querySelector('canvas').classList.contains('enlarged')") == (scale == 2)


def test_memory_does_not_grow(page, injected):
    """While the picture turns."""
    injected("""
      const {get, set} = Object.getOwnPropertyDescriptor(Worker.prototype, 'onmessage');
      Object.defineProperty(Worker.prototype, 'onmessage', {get, set(react) {
        set.call(this, (event) => { window.engineBytes = event.data.bytes; react(event); });
      }});
    """)
    page.show()
    count = """
      const plain = project;
      project = (request) => ({ ...plain(request), bytes: fine.exports.memory.buffer.byteLength });
    """
    replace_text(page, "worker", lambda text: text + count)
    page.settle()

    def measure(turns):
        page.driver.execute_async_script(
            """
            const [turns, done] = arguments;
            let n = 0;
            let state = null;
            const step = () => {
              if (cine.state !== state) {
                if (n === turns) { done(); return; }
                ({state} = cine);
                const key = ['ArrowLeft', 'ArrowUp', 'ArrowLeft', 'ArrowDown'][n++ % 4];
                document.body.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true }));
              }
              setTimeout(step);
            };
            step();
            """,
            turns,
        )
        page.settle()
        page.driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
        usage = page.driver.execute_cdp_cmd("Runtime.getHeapUsage", {})
        return usage["usedSize"] + usage["backingStorageSize"], page.run("engineBytes")

    before, engine = measure(40)
    after, engine_after = measure(200)
    assert engine_after == engine > 0
    assert after - before < 200 * page.values().nbytes / 20


@pytest.mark.parametrize("width", [320, 375])
def test_narrow_screen(page, width):
    page.set_screen(width, 640, scale=1, mobile=True)
    page.show()
    page.press("w")
    page.screenshot(f"volume-narrow-{width}")
    boxes = page.run("""[...document.querySelectorAll('#controls > *, #display-box, #display-box *')]
      .filter((e) => e.offsetParent).map((e) => e.getBoundingClientRect().toJSON())""")
    assert all(0 <= box["left"] and box["right"] <= width and box["bottom"] <= 640 for box in boxes)


def test_keyboard_reaches_everything(page):
    page.show()
    names = []
    for _ in range(8):
        page.press(Keys.TAB)
        names.append(page.run("document.activeElement.getAttribute('aria-label')"))
        assert page.run("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    assert names == "Play, View, Window and display, Invert, Reset, Save picture, Full screen, Help".split(", ")
    page.press("?")
    page.screenshot("volume-help")
    help_text = page.text("help-box")
    assert "slab nearer, farther" in help_text and "frame" not in help_text


@pytest.mark.parametrize("address", ["https://example.org/", "data:,x"])
def test_may_load_nothing(page, address):
    page.show()
    assert page.run(f"fetch('{address}').then(() => 'loaded', () => 'refused')") == "refused"
    messages = page.logs()[0]
    assert any("Content Security Policy" in message for message in messages)


def problem(page):
    page.wait("!document.getElementById('problem').hidden")
    return page.text("problem")


def cut(text):
    return text[: len(text) // 2 // 4 * 4]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("voxels", cut),
        ("voxels", lambda text: text[:-3]),
        ("voxels", lambda text: f"{text[:900]}{'A' * 40}{text[940:]}"),
        ("voxels", lambda text: f"{text[:900]}*{text[901:]}"),
        ("voxels", lambda text: ""),
        ("engine", cut),
        ("engine", lambda text: pack(b"no engine")),
        ("series", cut),
    ],
)
def test_damaged_page(page, name, change):
    page.show()
    with pytest.raises(AssertionError):
        replace_text(page, name, change)
    what = {
        "voxels": "its volume cannot be read (",
        "engine": "its engine cannot be read (",
        "series": "it is cut short.",
    }
    assert problem(page).startswith(f"This page is damaged: {what[name]}")
    assert not page.element("loading").is_displayed()


@pytest.mark.parametrize("change", [-1, 1])
def test_wrong_length(page, change):
    planes = split_planes(make_voxels())
    with pytest.raises(AssertionError):
        page.show(planes=planes[:change] if change < 0 else planes + b"\1")
    assert problem(page).startswith("This page is damaged: its volume cannot be read (it is")


@pytest.mark.parametrize("end", ['id="series">', 'id="engine">', 'id="voxels">'])
def test_file_that_is_cut(page, end):
    page.show()
    path = page.folder / "volume.html"
    text = path.read_text("utf-8")
    path.write_text(text[: text.index(end) + len(end) + 100], "utf-8")
    with pytest.raises(AssertionError):
        page.open(path)
    assert problem(page).startswith("This page is damaged: ")


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("delete window.WebAssembly", "no WebAssembly with SIMD"),
        ("WebAssembly.validate = () => false", "no WebAssembly with SIMD"),
        ("delete window.DecompressionStream", "no DecompressionStream"),
        ("Worker.prototype.postMessage = function () { setTimeout(() => this.onerror(new Event('error'))); }",
         "The volume cannot be shown: the browser has ended its engine"),
    ],
)  # fmt: skip
def test_browser_that_cannot(page, injected, script, words):
    injected(script)
    with pytest.raises(AssertionError):
        page.show()
    assert words in problem(page)


FAIL_WHEN_TURNED = """
  const plain = project;
  project = (request) => {
    if (request.view[4] > 0.2 && request.view[4] < 0.8) {
      %s
    }
    return plain(request);
  };
"""
"""Of the worker: the engine's trap, or an error of the browser, for pictures from between 12 and 53 degrees."""


@pytest.mark.parametrize("failure", ["fine.call('Project', -8, -8, 0, 0, 0, 0, 0);", "new Float64Array(2 ** 40);"])
def test_engine_that_stops_in_a_drag(page, failure):
    page.show()
    replace_text(page, "worker", lambda text: text + FAIL_WHEN_TURNED % failure)
    page.settle()
    page.press(" ")
    assert page.run("cine.playing")
    words = problem(page)
    assert words.startswith("The engine of this page has stopped, perhaps for want of memory.") and "smaller" in words
    assert not page.run("cine.playing")
    page.screenshot("volume-stopped")
    # what was seen remains
    turned = page.view
    page.drag(40, 10)
    page.press("m", "r", Keys.ARROW_LEFT)
    assert page.view == turned and problem(page) == words


def test_too_little_memory(page):
    """For voxels of 4 GB and of more."""
    for size in ([1500, 1500, 950], [4096, 4096, 129]):
        with pytest.raises(AssertionError):
            page.show(size=size, spacing=10)
        assert problem(page).startswith("There is too little memory for this volume.")

"""Uses a page of frames in a headless Chromium as a viewer would, and compares its pixels to the series'.

CINE_PAGE  a finished page: checked as well, in what holds for every series

See also browser.py.
"""

import base64
import io
import os
import pathlib

import numpy as np
import pytest
from browser import MINUS, Page, used, write_page
from PIL import Image
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

MOST_PIXELS_PER_FRAME = 48
WIDTH, HEIGHT, FRAMES, BLOCK = 96, 64, 36, 16


def encode_png(pixels):
    png = io.BytesIO()
    Image.fromarray(pixels).save(png, "PNG")
    return base64.b64encode(png.getvalue()).decode()


def encode(frame):
    """8 bits as a gray PNG, 16 bits as red and green."""
    if frame.dtype == np.uint16:
        frame = np.stack([frame >> 8, frame & 255, np.zeros_like(frame)], axis=-1).astype(np.uint8)
    return encode_png(frame)


def make_frames(bits, count=FRAMES):
    """Blocks of one value each, another in each frame; the last block row has a value for each pixel."""
    generator = np.random.default_rng(count)
    values = generator.integers(1, 2**bits, (count, HEIGHT // BLOCK, WIDTH // BLOCK))
    frames = values.repeat(BLOCK, axis=1).repeat(BLOCK, axis=2)
    frames[:, -BLOCK:] = generator.integers(0, 2**bits, (count, BLOCK, WIDTH))
    return frames.astype(np.uint8 if bits == 8 else np.uint16)


def make_series(frames, /, **changes):
    bits = 8 * frames.itemsize
    return {
        "title": "Maximum intensity </projection>",
        "width": frames.shape[2],
        "height": frames.shape[1],
        "spacing": [0.5, 1.0],
        "frames": [encode(frame) for frame in frames],
        "bits": bits,
        "slope": 1.0 if bits == 8 else 0.1,
        "intercept": 0.0 if bits == 8 else -1024.0,
        "window": [20, 220] if bits == 8 else [-500, 4500],
        "angles": [n * 360 / len(frames) for n in range(len(frames))],
        "rate": 30,
        "loop": "turn",
        "inverted": False,
    } | changes


def expected(series, frame, window, inverted=False):
    low, high = window
    value = series["slope"] * frame.astype(float) + series["intercept"]
    gray = np.floor(255 * np.clip((value - low) / (high - low), 0, 1) + 0.5)
    gray[frame == series.get("background")] = 0
    return (255 - gray if inverted else gray).astype(np.uint8)


class FramesPage(Page):
    LOADED = "window.cine && cine.loaded === JSON.parse(document.getElementById('series').textContent).frames.length"

    def show(self, frames=None, /, motion=False, **changes):
        """A series of these frames, or of some of 8 bits."""
        self.frames = make_frames(8) if frames is None else frames
        self.series = make_series(self.frames, **changes)
        path = self.folder / "cine.html"
        write_page(path, self.series)
        self.open(path, motion)

    def check(self, frame=0, window=None, inverted=False):
        """Each pixel, in the window of the series if no other is given."""
        gray = expected(self.series, self.frames[frame], window or self.series["window"], inverted)
        np.testing.assert_array_equal(self.pixels(), gray)

    @property
    def frame(self):
        return self.run("cine.frame")

    def find(self, x, y):
        """The point of the picture that is so far right of and below the stage's middle, in mm of the series."""
        box, stage = self.box, self.stage.rect
        across = (stage["x"] + stage["width"] / 2 + x - box["left"]) / box["width"]
        along = (stage["y"] + stage["height"] / 2 + y - box["top"]) / box["height"]
        return np.array([across * WIDTH * 0.5, along * HEIGHT])


@pytest.fixture
def page(driver, tmp_path):
    with used(FramesPage(driver, tmp_path)) as page:
        yield page


def pixels_per_frame(page):
    return min(MOST_PIXELS_PER_FRAME, 2 * page.box["width"] / FRAMES)


@pytest.mark.parametrize("bits", [8, 16])
def test_every_pixel_of_every_frame(page, bits):
    page.show(make_frames(bits))
    assert page.driver.title == page.text("title") == page.series["title"]
    for n in range(FRAMES):
        assert page.frame == n
        assert page.text("frame-number") == f"{n + 1} / {FRAMES}"
        assert page.text("angle") == f"{10 * n}°"
        page.check(n)
        page.press(Keys.ARROW_RIGHT)
    assert page.frame == 0


def test_low_bytes_of_16_bits(page):
    values = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(1, HEIGHT, WIDTH) + 30000
    page.show(values, slope=1.0, intercept=0.0, window=[30250, 30280], angles=[0])
    page.check()


def test_png_of_16_bits(page):
    values = make_frames(16, 1)
    page.show(values, frames=[encode_png(values[0])])
    page.check()


def test_on_screen(page):
    """The picture has its aspect in millimetres, and each block has its gray where it belongs."""
    page.show()
    box = page.box
    assert box["width"] / box["height"] == pytest.approx(WIDTH * 0.5 / HEIGHT, abs=0.01)
    assert box["height"] == page.run("document.getElementById('stage').clientHeight")
    centers = np.arange(BLOCK // 2, WIDTH, BLOCK), np.arange(BLOCK // 2, HEIGHT - BLOCK, BLOCK)
    columns = (box["left"] + (centers[0] + 0.5) * box["width"] / WIDTH).astype(int)
    rows = (box["top"] + (centers[1] + 0.5) * box["height"] / HEIGHT).astype(int)
    page.press("i")
    seen = page.screenshot("on-screen")[np.ix_(rows, columns)].astype(int)
    blocks = page.frames[0][np.ix_(centers[1], centers[0])]
    wanted = expected(page.series, blocks, page.series["window"], True)
    inner = (slice(1, None), slice(1, -1))  # without what is written in the corners
    assert np.abs(seen[inner] - wanted[inner][..., None]).max() <= 1


def test_drag_turns(page):
    """What is in front follows the pointer: the angle falls to the right. A turn goes on and on."""
    page.show()
    step = pixels_per_frame(page)
    page.drag(-5 * step)
    assert page.frame == 5
    page.check(5)
    page.drag(8 * step)
    assert page.frame == FRAMES - 3
    page.drag(-4 * step)
    assert page.frame == 1
    page.drag(0, 100)
    assert page.frame == 1
    assert page.window == page.series["window"]


def test_drag_through_list(page):
    page.show(make_frames(8, 7), loop="none", angles=None)
    page.drag(2 * MOST_PIXELS_PER_FRAME)
    assert page.frame == 2 and page.text("angle") == ""
    page.drag(-300)
    assert page.frame == 0
    page.press(Keys.ARROW_LEFT)
    assert page.frame == 0
    page.drag(340)
    assert page.frame == 6
    page.press(Keys.ARROW_RIGHT)
    assert page.frame == 6


def test_drag_swings(page):
    """To and fro in the angle, whatever way the series goes: 0, 10, 20, 30, 20, 10."""
    angles = [0, 10, 20, 30, 20, 10]
    page.show(make_frames(8, 6), loop="swing", angles=angles)
    page.press(Keys.END)
    page.drag(-MOST_PIXELS_PER_FRAME)
    assert angles[page.frame] == 20
    page.drag(-300)
    assert angles[page.frame] == 30
    page.drag(2 * MOST_PIXELS_PER_FRAME)
    assert angles[page.frame] == 10
    page.drag(300)
    assert angles[page.frame] == 0


@pytest.mark.parametrize("bits", [8, 16])
def test_window(page, bits):
    page.show(make_frames(bits))
    low, high = page.series["window"]
    level, width = (low + high) / 2, high - low

    def check(new_level, new_width):
        assert page.window == pytest.approx([new_level - new_width / 2, new_level + new_width / 2], rel=1e-9)
        page.check(0, page.window)

    page.press("+")
    check(level, width * 1.1)
    assert page.text("window-width") == ("Width 220" if bits == 8 else "Width 5500.0")
    page.press("r")
    check(level, width)
    page.press("+", "+", "-", Keys.ARROW_UP)
    check(level - 0.055 * width, width * 1.1)
    page.press("r")
    page.drag(150, 0, MouseButton.RIGHT)
    check(level, width * 2)
    page.press("r")
    page.drag(0, 60, MouseButton.RIGHT)
    check(level + 0.2 * width, width)
    assert page.frame == 0
    page.double_click()
    check(level, width)
    assert page.frame == 0


def test_window_does_not_get_lost(page):
    page.show()
    for _ in range(4):
        page.drag(-450, -250, MouseButton.RIGHT)
    low, high = page.window
    assert 0 <= (low + high) / 2 <= 255 and high - low == pytest.approx(1)
    for _ in range(6):
        page.drag(450, 250, MouseButton.RIGHT)
    low, high = page.window
    assert 0 <= (low + high) / 2 <= 255 and high - low == pytest.approx(2 * 255)


@pytest.mark.parametrize("inverted", [False, True])
def test_invert_and_background(page, inverted):
    frames = make_frames(8)
    frames[:, 40:, :30] = 77
    page.show(frames, background=77, inverted=inverted)

    def require(shown_inverted):
        page.check(inverted=shown_inverted)
        pressed = page.element("invert").get_attribute("aria-pressed")
        assert pressed == ("true" if shown_inverted else "false")

    assert (page.pixels()[40:, :30] == (255 if inverted else 0)).all()
    require(inverted)
    page.press("i")
    require(not inverted)
    page.press("r")
    require(inverted)
    page.element("invert").click()
    require(not inverted)


def test_colours(page):
    frames = np.random.default_rng(7).integers(0, 256, (FRAMES, HEIGHT, WIDTH, 3)).astype(np.uint8)
    page.show(frames, bits=24, window=[0, 255], letters=["RA LP H F"] * FRAMES)
    for number in (0, 1, 2):
        assert (page.colours() == frames[number]).all()
        page.press(Keys.ARROW_RIGHT)
    page.press("i", "+", "-", Keys.ARROW_UP)
    page.drag(90, 40, MouseButton.RIGHT)
    assert page.frame == 3 and (page.colours() == frames[3]).all()
    assert page.window == [0, 255] and not page.run("cine.inverted")
    assert page.text("window-width") == page.text("window-level") == page.text("value") == ""
    assert page.text("place").endswith(" mm")
    assert not page.element("invert").is_displayed()
    page.press("w")
    assert not page.element("preset").is_displayed()
    assert page.element("labels-shown").is_displayed()
    page.screenshot("colours")
    page.press("w", "?")
    assert "window" not in page.text("help-box").replace("full screen", "")
    page.press("?", "r")
    assert page.frame == 0 and (page.colours() == frames[0]).all()
    page.press("l")
    _, saved = page.save_picture()
    assert {*map(tuple, saved.reshape(-1, 3))} - {(0, 0, 0)} <= {*map(tuple, frames[0].reshape(-1, 3))}


def point_at_pixel(page, column, row):
    box, stage = page.box, page.stage.rect
    x = box["left"] + (column + 0.5) * box["width"] / WIDTH - stage["x"] - stage["width"] / 2
    y = box["top"] + (row + 0.5) * box["height"] / HEIGHT - stage["y"] - stage["height"] / 2
    page.point_at(x, y)


def test_value_under_pointer(page):
    frames = make_frames(16)
    frames[:, 50:] = 5
    page.show(frames, background=5)
    point_at_pixel(page, 69, 20)
    assert page.text("value") == f"{0.1 * frames[0][20, 69] - 1024:.1f}".replace("-", MINUS)
    assert page.text("place") == f"{0.5 * (69 - 47.5):.1f}, {MINUS}{31.5 - 20:.1f} mm"
    page.press(Keys.ARROW_RIGHT)
    assert page.text("value") == f"{0.1 * frames[1][20, 69] - 1024:.1f}".replace("-", MINUS)
    point_at_pixel(page, 70, 60)
    assert page.text("value") == "no data"
    page.point_at(-490, 0)
    assert page.text("value") == page.text("place") == ""


def test_value_that_is_cut(page):
    frames = make_frames(8)
    frames[:, :20] = 1
    frames[:, 20:40] = 200
    frames[:, 40:] = 199
    for cut, texts in {(1, 200): ["\u2264 1", "\u2265 200", "199"], (-1, -1): ["1", "200", "199"]}.items():
        page.show(frames, cut=cut)
        for row, text in zip((10, 30, 50), texts):
            point_at_pixel(page, 60, row)
            assert page.text("value") == text


def record_play(page, changes):
    """The frames that pass while it plays, in their order."""
    return page.driver.execute_async_script(
        """
      const [changes, done] = arguments;
      const seen = [cine.frame];
      const look = () => {
        if (cine.frame !== seen.at(-1)) { seen.push(cine.frame); }
        if (seen.length > changes) { done(seen); } else { requestAnimationFrame(look); }
      };
      look();
    """,
        changes,
    )


def test_plays_by_itself_and_wraps(page):
    page.show(make_frames(8, 8), motion=True)
    assert page.run("cine.playing")
    seen = record_play(page, 20)
    steps = np.diff(seen) % 8
    assert np.median(steps) == 1
    assert (np.diff(seen) < 0).any()
    page.press(" ")
    assert not page.run("cine.playing")
    stopped = page.frame
    page.check(stopped)
    assert page.run("new Promise((done) => setTimeout(() => done(cine.frame), 300))") == stopped
    page.element("play").click()
    assert page.run("cine.playing")
    page.drag(100)
    assert not page.run("cine.playing")


def test_list_plays_to_and_fro(page):
    page.show(make_frames(8, 5), motion=True, loop="none", angles=None)
    seen = record_play(page, 16)
    assert {0, 4} <= set(seen)
    assert np.median(np.abs(np.diff(seen))) == 1 and np.abs(np.diff(seen)).max() < 4


def test_reduced_motion_waits(page):
    page.show()
    assert not page.run("cine.playing")
    assert page.element("play").get_attribute("aria-label") == "Play"
    assert page.run("new Promise((done) => setTimeout(() => done(cine.frame), 300))") == 0
    page.press(" ")
    page.wait("cine.frame > 2")
    assert page.element("play").get_attribute("aria-label") == "Pause"


def test_speed(page):
    page.show(rate=12)
    assert page.text("rate") == "12 fps"
    speed = page.element("speed")
    page.driver.execute_script("arguments[0].focus()", speed)
    page.press(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert page.run("cine.rate") == 14 and page.frame == 0
    page.press("r")
    assert page.run("cine.rate") == 12


def test_position(page):
    page.show()
    position = page.element("position")
    position.click()
    assert abs(page.frame - (FRAMES - 1) / 2) <= 1
    page.press(Keys.HOME, Keys.ARROW_LEFT)
    assert page.frame == FRAMES - 1
    assert position.get_attribute("aria-valuetext") == "Frame 36 of 36, 350°"


def test_touch(page):
    page.show()
    step = pixels_per_frame(page)
    page.touch([(500, 300), (500 - 2 * step, 300), (500 - 4 * step, 305)])
    assert page.frame == 4
    assert page.window == page.series["window"]
    box = page.box
    page.touch([(480, 300), (440, 300), (400, 300)], [(520, 300), (560, 300), (600, 300)])
    assert page.frame == 4 and page.window == page.series["window"]
    assert page.run("cine.zoom") == pytest.approx(5)
    assert page.box["width"] == pytest.approx(5 * box["width"], abs=1)
    assert page.box["left"] - 500 == pytest.approx(5 * (box["left"] - 500), abs=3)
    before = page.box
    page.touch([(480, 300), (480, 330)], [(520, 300), (520, 330)])
    assert page.box["top"] - before["top"] == pytest.approx(30, abs=1)
    assert page.box["width"] == before["width"] and page.frame == 4
    page.press("r")
    assert page.box == box


def test_keyboard_reaches_everything(page):
    page.show()
    names = []
    for _ in range(11):
        page.press(Keys.TAB)
        names.append(page.run("document.activeElement.getAttribute('aria-label')"))
        assert page.run("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    buttons = "Play, Previous frame, Next frame, Frame, Speed in frames per second, Window and display"
    assert names == f"{buttons}, Invert, Reset, Save picture, Full screen, Help".split(", ")
    page.screenshot("focus")
    page.press("?")
    assert page.run("document.getElementById('help-box').open")
    page.screenshot("help")
    assert "slab" not in page.text("help-box")
    page.press("i")
    assert not page.run("cine.inverted")
    page.press("h")
    assert not page.run("document.getElementById('help-box').open")
    page.press("f")
    page.wait("document.fullscreenElement !== null", 5)
    page.press("f")
    page.wait("document.fullscreenElement === null", 5)


def test_wheel_goes_through_frames(page):
    page.show()
    page.wheel(120)
    assert page.frame == 1
    page.wheel(-120)
    page.wheel(-120)
    assert page.frame == FRAMES - 1
    page.wheel(30)
    assert page.frame == FRAMES - 1
    page.wheel(30)
    assert page.frame == 0  # a notch is 50
    assert page.window == page.series["window"] and page.run("cine.zoom") == 1


@pytest.mark.parametrize("at", [(0, 0), (150, -200), (-180, 90)])
def test_zoom_keeps_the_point_below_the_pointer(page, at):
    page.show()
    box, point = page.box, page.find(*at)
    for n in range(1, 5):
        page.wheel(-120, Keys.CONTROL, at)
        assert page.run("cine.zoom") == pytest.approx(1.2**n)
        assert page.box["width"] == pytest.approx(1.2**n * box["width"], abs=1)
        np.testing.assert_allclose(page.find(*at), point, atol=0.13)  # a pixel
    page.wheel(120, Keys.CONTROL, at)
    np.testing.assert_allclose(page.find(*at), point, atol=0.13)  # a pixel
    assert page.frame == 0
    for _ in range(30):
        page.wheel(-240, Keys.CONTROL, at)
    assert page.run("cine.zoom") == 32
    page.double_click()
    assert page.box == box
    page.press("z", "z", "Z")
    assert page.run("cine.zoom") == pytest.approx(1.2)
    np.testing.assert_allclose(page.find(0, 0), [WIDTH * 0.25, HEIGHT / 2], atol=0.1)


@pytest.mark.parametrize("how", [{"button": MouseButton.MIDDLE}, {"key": Keys.SHIFT}])
def test_pan(page, how):
    page.show()
    page.press("z")
    box = page.box
    page.drag(60, -44, **how)
    assert (page.box["left"] - box["left"], page.box["top"] - box["top"]) == pytest.approx((60, -44), abs=1)
    assert page.box["width"] == box["width"]
    assert page.frame == 0 and page.window == page.series["window"]
    page.press(Keys.ARROW_LEFT, Keys.ARROW_DOWN, key=Keys.SHIFT)
    assert (page.box["left"] - box["left"], page.box["top"] - box["top"]) == pytest.approx((20, -4), abs=1)
    for _ in range(4):
        page.drag(450, -250, **how)
    np.testing.assert_allclose(page.find(0, 0), [0, HEIGHT], atol=0.1)  # a corner stays in the middle


def test_value_under_pointer_of_a_zoomed_picture(page):
    frames = make_frames(16)
    page.show(frames)
    page.press("z", "z", "z")
    page.drag(-100, 60, MouseButton.MIDDLE)
    column, row = (page.find(-100, 60) // [0.5, 1]).astype(int)
    assert page.text("value") == f"{0.1 * frames[0][row, column] - 1024:.1f}".replace("-", MINUS)


@pytest.mark.parametrize("zooms", [0, 1, 4, 9])
def test_scale_bar_follows_the_zoom(page, zooms):
    page.show()
    spacing_on_screen = page.box["width"] / (WIDTH * 0.5)
    page.press("z" * zooms)
    length = page.box_of("#scale-bar")["width"]
    shown = float(page.text("scale-length").removesuffix(" mm"))
    assert zooms > 0 or shown == 10
    assert length == pytest.approx(shown * spacing_on_screen * 1.2**zooms, rel=0.01)
    assert 60 < length <= page.stage.rect["width"] / 4


@pytest.mark.parametrize("labels", [None, True, False])
def test_letters(page, labels):
    letters = [f"{left} {right} H F" for left, right in ["RL", "AP", "LR", "PA"]] + ["LA RP HA FP"]
    page.show(make_frames(8, 5), letters=letters, **({} if labels is None else {"labels": labels}))
    if labels is False:
        assert page.text("left-letter") == page.text("scale-length") == ""
        page.press("l")
    spoken = ["right at the left, left at the right", "anterior at the left, posterior at the right"]
    for n, expected_letters in enumerate(letters):
        sides = [page.text(f"{side}-letter") for side in ("left", "right", "top", "bottom")]
        assert sides == expected_letters.split()
        label = page.canvas.get_attribute("aria-label")
        assert label.startswith(f"{page.series['title']}. Frame {n + 1} of 5, {72 * n}°. Patient: ")
        assert n > 1 or f"Patient: {spoken[n]}, head at the top, feet at the bottom" in label
        page.press(Keys.ARROW_RIGHT)
    assert "left anterior at the left" in label
    page.press("l")
    assert page.text("left-letter") == page.text("scale-length") == ""
    page.press("w")
    page.element("labels-shown").click()
    assert page.text("left-letter") == "R" and page.text("scale-length") == "10 mm"


def test_series_without_letters(page):
    page.show()
    assert page.text("left-letter") == "" and "Patient" not in page.canvas.get_attribute("aria-label")


def test_names_of_segments(page):
    page.show(segments=[["liver <b>", "#ff0080"], ["cyst", "#00ff00"]])
    entries = page.driver.find_elements(By.CSS_SELECTOR, "#segments li")
    assert [entry.text for entry in entries] == ["■liver <b>", "■cyst"]
    marks = [entry.find_element(By.TAG_NAME, "b").value_of_css_property("color") for entry in entries]
    assert marks == ["rgba(255, 0, 128, 1)", "rgba(0, 255, 0, 1)"]


def names_of_presets(page):
    return [each.text for each in page.driver.find_elements(By.CSS_SELECTOR, "#preset option:not([hidden])")]


def test_presets(page):
    frames = make_frames(16, 3)
    frames[:, 0, 0] = 0
    page.show(frames, background=0, slope=0.1, intercept=-1024)
    page.press("w")
    assert names_of_presets(page) == ["Automatic", "Full range", "Lung", "Bone", "Angio", "Brain"]
    preset = Select(page.element("preset"))
    assert preset.first_selected_option.text == "Automatic"
    values = 0.1 * frames[frames > 0] - 1024
    for name, (level, width) in {
        "Lung": (-600, 1500),
        "Bone": (300, 1500),
        "Angio": (300, 600),
        "Brain": (40, 80),
        "Full range": ((values.min() + values.max()) / 2, np.ptp(values)),
        "Automatic": (2000, 5000),
    }.items():
        preset.select_by_visible_text(name)
        assert page.window == pytest.approx([level - width / 2, level + width / 2])
        page.check(0, page.window)
        assert float(page.element("width").get_property("value")) == pytest.approx(width)
    page.press(Keys.ESCAPE, "+")
    assert not page.run("document.getElementById('display-box').open")
    assert page.window == pytest.approx([-750, 4750])
    assert page.element("preset").get_property("value") == ""


def test_constant_series_has_a_window(page):
    page.show(np.full((2, HEIGHT, WIDTH), 9, np.uint8))
    page.press("w")
    Select(page.element("preset")).select_by_visible_text("Full range")
    assert page.window == [20, 220] and not page.pixels().any()


def test_typed_window(page):
    page.show()
    page.press("w")
    assert names_of_presets(page) == ["Automatic", "Full range"]  # without the presets of CT
    page.type("level", "-10.5")
    assert page.window == [-110.5, 89.5]
    page.type("width", "51")
    assert page.window == [-36, 15]
    page.check(0, [-36, 15])
    assert page.frame == 0 and not page.run("cine.inverted")
    for name, text in (("width", "0"), ("width", "-5"), ("width", ""), ("width", "1e400"), ("width", "1e-300"),
                       ("level", ""), ("level", "ir"), ("level", "1e308")):  # fmt: skip
        page.type(name, text)
        assert "the width must be above 0" in page.text("typed-problem"), (name, text)
        assert page.window == [-36, 15]
        page.type("level", "-10.5")
        page.type("width", "51")
        assert page.text("typed-problem") == ""
    page.press(Keys.ESCAPE, "i")
    assert page.run("cine.inverted")


def show_rows(page, count, rows, motion=False):
    page.show(
        make_frames(8, count * rows),
        motion=motion,
        elevations=[-30, 30, 0][:rows],
        angles=[n * 360 / count for n in range(count)],
        letters=[f"R L H{row} F{n}" for row in range(rows) for n in range(count)],
    )


def test_rows_of_elevations(page):
    show_rows(page, 6, 3)
    lowest, highest, middle = range(3)

    def require(row, frame):
        assert (page.run("cine.row"), page.frame) == (row, frame)
        page.check(6 * row + frame)
        assert page.text("frame-number") == f"{frame + 1} / 6" and page.text("angle") == f"{60 * frame}°"
        assert page.text("elevation") == f"elevation {[MINUS + '30', '30', '0'][row]}°"
        assert page.text("top-letter") == f"H{row}" and page.text("bottom-letter") == f"F{frame}"
        spoken = page.element("position").get_attribute("aria-valuetext")
        assert spoken == f"Frame {frame + 1} of 6, {60 * frame}°, {page.text('elevation')}"

    require(middle, 0)
    page.press(Keys.ARROW_RIGHT, Keys.ARROW_UP)
    require(highest, 1)
    page.press(Keys.ARROW_UP)
    require(highest, 1)
    page.press(Keys.ARROW_DOWN, Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    require(lowest, 1)
    page.drag(0, 96)  # what is in front goes down: from above
    require(middle, 1)
    page.drag(-MOST_PIXELS_PER_FRAME, 96)
    require(highest, 2)
    page.drag(0, -250)
    require(lowest, 2)
    page.press(Keys.END, Keys.ARROW_RIGHT)
    require(lowest, 0)
    page.press("r")
    require(middle, 0)
    assert page.window == page.series["window"]


def test_rows_play(page):
    show_rows(page, 4, 2, motion=True)
    page.press(Keys.ARROW_UP)
    assert page.run("cine.playing")
    assert set(record_play(page, 12)) == {0, 1, 2, 3}
    assert page.run("cine.row") == 1


@pytest.mark.parametrize("zoomed", [False, True])
def test_saved_picture(page, zoomed):
    page.show(title="a/b.nrrd", letters=["RA LP H F"] * FRAMES)
    page.press(Keys.ARROW_RIGHT)
    if zoomed:
        page.press("z", "z", "z")
        page.drag(-100, 60, MouseButton.MIDDLE)
    boxes = page.run("[...document.querySelectorAll('#labels > *')].map((e) => e.getBoundingClientRect().toJSON())")
    bar = page.box_of("#scale-bar")
    name, labelled = page.save_picture()
    page.press("l")
    _, plain = page.save_picture()
    assert name == "a_b.nrrd-2.png"
    stage, box = page.stage.rect, page.box
    assert plain.shape == (stage["height"], stage["width"], 3) == labelled.shape

    # each pixel of the canvas that is seen, in its middle
    columns = np.floor(box["left"] + (np.arange(WIDTH) + 0.5) * box["width"] / WIDTH).astype(int)
    rows = np.floor(box["top"] + (np.arange(HEIGHT) + 0.5) * box["height"] / HEIGHT).astype(int)
    seen = np.ix_((0 <= rows) & (rows < plain.shape[0]), (0 <= columns) & (columns < plain.shape[1]))
    assert zoomed == (seen[0].size * seen[1].size < WIDTH * HEIGHT)
    got = plain[np.ix_(rows[seen[0].ravel()], columns[seen[1].ravel()])]
    assert (got == page.pixels()[seen][..., None]).all()

    changed = (labelled != plain).any(axis=2)
    assert len(boxes) == 5
    for each in boxes:
        part = (slice(max(0, int(each["top"]) - 3), int(each["bottom"]) + 4),
                slice(max(0, int(each["left"]) - 3), int(each["right"]) + 4))  # fmt: skip
        assert changed[part].any()
        changed[part] = False
    assert not changed.any()
    bottom = int(bar["bottom"])
    line = labelled[bottom - 1 : bottom + 1, int(bar["left"]) + 1 : int(bar["right"]) - 1].max(axis=(0, 2))
    assert line.size > 60 and (line > 150).all()


def test_saved_picture_has_the_screens_resolution(page):
    page.set_screen(400, 500, scale=2, mobile=False)
    page.show(make_frames(8, 2))
    page.press("l")
    _, picture = page.save_picture()
    page.run("document.querySelectorAll('.note').forEach((note) => { note.style.visibility = 'hidden'; })")
    assert picture.shape[:2] == (2 * page.stage.rect["height"], 800)
    shown = page.screenshot("saved-at-2")[: picture.shape[0]].astype(int)
    assert shown.std() > 50 and np.abs(shown - picture).mean() < 1


@pytest.mark.parametrize("width", [320, 375])
def test_narrow_screen(page, width):
    page.set_screen(width, 640, scale=1, mobile=True)
    show_rows(page, 4, 2)
    page.press("w")
    page.screenshot(f"narrow-{width}")
    boxes = page.run("""[...document.querySelectorAll('#controls > *, #display-box')].filter((e) => !e.hidden)
      .map((e) => e.getBoundingClientRect().toJSON())""")
    assert all(0 <= box["left"] and box["right"] <= width and box["bottom"] <= 640 for box in boxes)
    assert len({box["top"] for box in boxes[:-1] if box["height"] > 36}) == 1  # the buttons are one row


def test_dark_and_light(page):
    colours = {}
    for scheme in ("dark", "light"):
        page.show(make_frames(8, 2))
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        page.press("w")
        seen = page.screenshot(f"{scheme}")
        colours[scheme] = seen[-4, 4].mean(), page.run("getComputedStyle(document.getElementById('stage')).color")
    assert colours["dark"][0] < 60 < 200 < colours["light"][0]
    assert colours["dark"][1] == colours["light"][1]  # on the picture, which is black at its edges


def test_damaged_frame_is_reported(page):
    frames = make_frames(8, 3)
    wide = encode(np.zeros((HEIGHT, WIDTH + 1), np.uint8))
    with pytest.raises(AssertionError, match="Frame 2 cannot be shown: it has another size or depth"):
        page.show(frames, frames=[encode(frames[0]), wide, encode(frames[2])])


@pytest.mark.skipif("CINE_PAGE" not in os.environ, reason="CINE_PAGE names a finished page")
def test_finished_page(page):
    page.open(pathlib.Path(os.environ["CINE_PAGE"]))
    before = page.screenshot("finished-page")
    assert (before == page.screenshot("finished-page")).all()
    assert before[..., 0].std() > 0
    canvas = page.canvas.screenshot_as_png
    page.drag(-200)
    assert page.frame != 0
    assert page.canvas.screenshot_as_png != canvas
    page.screenshot("finished-page-turned")

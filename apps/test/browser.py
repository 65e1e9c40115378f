"""The web page in a headless Chromium.

CINE_SCREENSHOTS  folder that keeps what was seen

Needs Debian's chromium, chromium-driver, python3-selenium, python3-pil, python3-numpy and python3-pytest.
"""

import base64
import contextlib
import gzip
import io
import json
import os
import pathlib
import urllib.parse

import numpy as np
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.command import Command
from selenium.webdriver.support.ui import WebDriverWait

ROOT = pathlib.Path(__file__).parents[2]

MINUS = "\N{MINUS SIGN}"


def write_page(path, series, engine=b"", voxels=b""):
    """Fills the page as the program does: a series, and of a volume the engine and byte planes of its voxels."""
    page = "@page.html@"
    for part in ("page.html", "page.css", "viewer.js", "frames.js", "volume.js", "worker.js"):
        assert page.count(f"@{part}@") == 1
        page = page.replace(f"@{part}@", (ROOT / "page" / part).read_text("utf-8"))
    texts = {"SERIES": json.dumps(series).replace("<", "\\u003c")}
    texts |= {name: pack(data) if data else "" for name, data in (("ENGINE", engine), ("VOXELS", voxels))}
    for mark, text in texts.items():
        assert page.count(f"@{mark}@") == 1
        page = page.replace(f"@{mark}@", text)
    path.write_text(page, "utf-8")


def pack(data):
    return base64.b64encode(gzip.compress(data, 1)).decode()


class Page:
    LOADED = ""
    """Script: whether all is loaded."""

    def __init__(self, driver, folder):
        self.driver, self.folder = driver, folder

    def open(self, path, motion=False):
        preference = "no-preference" if motion else "reduce"
        features = [{"name": "prefers-reduced-motion", "value": preference}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        self.driver.get("about:blank")
        self.logs()
        self.driver.get(path.resolve().as_uri())
        self.wait(f"({self.LOADED}) || !document.getElementById('problem').hidden")
        assert self.text("problem") == "", self.text("problem")
        self.stage = self.element("stage")
        self.canvas = self.driver.find_element(By.TAG_NAME, "canvas")

    def element(self, name):
        return self.driver.find_element(By.ID, name)

    def run(self, script):
        return self.driver.execute_script(f"return {script}")

    def wait(self, condition, seconds=30):
        WebDriverWait(self.driver, seconds, 0.05).until(lambda driver: self.run(condition), condition)

    def text(self, name):
        return self.element(name).text

    @property
    def window(self):
        return self.run("cine.window")

    def box_of(self, selector):
        return self.run(f"document.querySelector('{selector}').getBoundingClientRect().toJSON()")

    @property
    def box(self):
        return self.box_of("canvas")

    def colours(self):
        """What the canvas has."""
        text = self.run("""(() => {
          const canvas = document.querySelector('canvas');
          const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', {willReadFrequently: true});
          copy.drawImage(canvas, 0, 0);
          const {data} = copy.getImageData(0, 0, canvas.width, canvas.height);
          return [canvas.width, canvas.height, btoa(String.fromCharCode(...data))];
        })()""")
        rgba = np.frombuffer(base64.b64decode(text[2]), np.uint8).reshape(text[1], text[0], 4)
        assert (rgba[..., 3] == 255).all()
        return rgba[..., :3]

    def pixels(self):
        """One gray value a pixel."""
        colours = self.colours()
        assert (colours[..., :1] == colours).all()
        return colours[..., 0]

    def screenshot(self, name):
        png = self.driver.get_screenshot_as_png()
        if "CINE_SCREENSHOTS" in os.environ:
            folder = pathlib.Path(os.environ["CINE_SCREENSHOTS"])
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{name}.png").write_bytes(png)
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))

    @contextlib.contextmanager
    def held(self, key):
        if key:
            ActionChains(self.driver).key_down(key).perform()
        yield
        if key:
            ActionChains(self.driver).key_up(key).perform()

    def drag(self, right, down=0, button=MouseButton.LEFT, key=None):
        actions = ActionBuilder(self.driver, duration=20)
        mouse = actions.pointer_action
        mouse.move_to(self.stage)
        mouse.pointer_down(button)
        for n in range(1, 5):
            mouse.move_to(self.stage, round(right * n / 4), round(down * n / 4))
        mouse.pointer_up(button)
        with self.held(key):
            actions.perform()

    def press(self, *keys, key=None):
        with self.held(key):
            ActionChains(self.driver).send_keys(*keys).perform()

    def wheel(self, delta, key=None, at=(0, 0)):
        """At pixels right of and below the stage's middle."""
        with self.held(key):
            origin = ScrollOrigin.from_element(self.stage, *at)
            ActionChains(self.driver).scroll_from_origin(origin, 0, delta).perform()

    def point_at(self, x, y):
        """So far right of and below the stage's middle."""
        ActionChains(self.driver, duration=0).move_to_element_with_offset(self.stage, round(x), round(y)).perform()

    def double_click(self):
        ActionChains(self.driver).double_click(self.stage).perform()

    def set_screen(self, width, height, scale, mobile):
        """Until the end of the test."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": mobile}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def type(self, name, text):
        field = self.element(name)
        field.clear()
        field.send_keys(text, Keys.ENTER)

    def save_picture(self):
        """By the key; the name of the file that was downloaded, and its pixels."""
        behavior = {"behavior": "allow", "downloadPath": str(self.folder.resolve())}
        self.driver.execute_cdp_cmd("Browser.setDownloadBehavior", behavior)
        self.press("s")
        (path,) = WebDriverWait(self.driver, 10, 0.05).until(lambda driver: [*self.folder.glob("*.png")])
        picture = np.asarray(Image.open(path).convert("RGB"))
        path.unlink()
        return path.name, picture

    def touch(self, *fingers):
        """Each finger is a list of positions; all go on together."""

        def send(kind, points):
            touches = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
            self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

        send("touchStart", [finger[0] for finger in fingers])
        for points in list(zip(*fingers))[1:]:
            send("touchMove", points)
        send("touchEnd", [])

    def logs(self):
        """Messages of the console, and the addresses that were asked for."""
        messages = [entry["message"] for entry in self.driver.get_log("browser")]
        events = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        sent = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
        return messages, [parameters["request"]["url"] for parameters in sent]


@contextlib.contextmanager
def used(page):
    """Afterwards the browser is as before; the console has no messages, and nothing was loaded from elsewhere."""
    yield page
    page.driver.execute(Command.W3C_CLEAR_ACTIONS)
    page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    messages, requests = page.logs()
    assert not messages
    assert {urllib.parse.urlsplit(url).scheme for url in requests} <= {"file", "data", "blob", "about"}

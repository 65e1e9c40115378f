"""The viewer's page: who is let in, and what Chromium shows.

VIEWER_SCREENSHOTS    folder that keeps what was seen
"""

import base64
import contextlib
import io
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time
import urllib.parse

import chromium
import httpx
import itk
import numpy as np
import pytest
from itk_shearwarpmip import _scene, show
from itk_shearwarpmip.__main__ import main, view
from PIL import Image
from samples import make_image, needs_posix, needs_proc
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect


@pytest.fixture(scope="module")
def volume():
    """A tube along z with a bright sphere on the patient's left, in front: 64 x 64 x 48 voxels."""
    z, y, x = np.mgrid[:48, :64, :64]
    voxels = np.full(z.shape, 100, np.uint16)
    voxels += (np.hypot(x - 32, y - 32) < 5).astype(np.uint16) * 400
    voxels += ((x - 50) ** 2 + (y - 12) ** 2 + (z - 30) ** 2 < 25).astype(np.uint16) * 900
    return make_image(voxels, (1.0, 1.0, 1.5), (-40.0, 10.0, 25.0))


HEADERS = {"referrer-policy": "no-referrer", "cache-control": "no-store", "x-content-type-options": "nosniff"}


@pytest.fixture
def open_page(volume):
    """Opens a page without a browser; closes it in the end."""
    with contextlib.ExitStack() as stack:

        def open_one(**page):
            viewer = show(volume, page={"no_browser": True, **page}, block=False)
            stack.callback(viewer.close)
            return viewer

        yield open_one


@pytest.fixture
def viewer(open_page, monkeypatch):
    monkeypatch.setattr("webbrowser.open", pytest.fail)
    return open_page()


def connect_to(viewer, **options):
    return connect(viewer.url.replace("http", "ws"), **options)


# ---- Who is let in


@pytest.mark.parametrize(
    "name", ["", "index.html", "renderview.js", "viewer.js", "renderview-client.js", "renderview.css"]
)
def test_page(viewer, name):
    answer = httpx.get(viewer.url + name)
    assert answer.status_code == 200 and answer.text
    assert {key: answer.headers[key] for key in HEADERS} == HEADERS
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy


def test_token_is_new_each_time(viewer, open_page):
    first = viewer.url
    viewer.close()
    viewer.close()
    second = open_page()
    tokens = [url.split("/")[3] for url in (first, second.url)]
    assert tokens[0] != tokens[1] and min(map(len, tokens)) >= 40
    assert httpx.get(second.url).status_code == 200
    second.close()
    with pytest.raises(httpx.ConnectError):
        httpx.get(second.url)


@pytest.mark.parametrize("change", ["", "x", "{}x", "x{}", "{}/a/b", "../{}", "{}"], ids=str)
def test_wrong_token(viewer, change):
    host, token = viewer.url.split("/")[2:4]
    for path in (f"/{change.format(token)}", f"/{change.format(token[:-1])}/", f"/{change.format(token.swapcase())}/"):
        answer = httpx.get(f"http://{host}{path}")
        assert answer.status_code == 403 and "token is missing or wrong" in answer.text
        assert {key: answer.headers[key] for key in HEADERS} == HEADERS
        with pytest.raises(InvalidStatus, match="403"), connect(f"ws://{host}{path}"):
            pass


def test_other_origin(viewer):
    host = viewer.url.split("/")[2]
    for origin in ("http://example.org", "null", f"http://{host}.example.org", "http://localhost", f"ftp://{host}"):
        answer = httpx.get(viewer.url, headers={"Origin": origin})
        assert answer.status_code == 403 and "another page" in answer.text
        with pytest.raises(InvalidStatus, match="403"), connect_to(viewer, additional_headers={"Origin": origin}):
            pass
    assert httpx.get(viewer.url, headers={"Origin": f"http://{host}"}).status_code == 200
    with connect_to(viewer, additional_headers={"Origin": f"http://{host}"}):
        pass


@needs_proc
def test_loopback_only(viewer):
    host, port = viewer.url.split("/")[2].split(":")
    assert host == "127.0.0.1"
    listening = [line.split()[1] for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]]
    assert f"0100007F:{int(port):04X}" in listening and f"00000000:{int(port):04X}" not in listening


@pytest.mark.parametrize("host, shown", [("0.0.0.0", "127.0.0.1"), ("::1", "[::1]"), ("::", "[::1]")])
def test_host_that_is_asked_for(host, shown, open_page):
    if ":" in host and not socket.has_dualstack_ipv6():
        pytest.skip("no IPv6")
    viewer = open_page(host=host)
    assert viewer.url.startswith(f"http://{shown}:")
    assert httpx.get(viewer.url).status_code == 200
    assert httpx.get(viewer.url, headers={"Origin": "http://example.org"}).status_code == 403


@needs_posix
def test_browser_is_opened_without_the_token_in_its_arguments(volume, monkeypatch):
    """They can be seen by everyone on the computer; the page that leads on cannot."""
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with contextlib.closing(show(volume, page={}, block=False)) as viewer:
        assert viewer.url.split("/")[3] not in opened[0]
        path = pathlib.Path(urllib.parse.urlsplit(opened[0]).path)
        assert viewer.url in path.read_text() and path.parent.stat().st_mode & 0o777 == 0o700
    assert not path.exists()


def test_one_viewer_in_a_process(viewer, open_page):
    with pytest.raises(RuntimeError, match=f"this process shows .*{viewer.url}.*close"):
        open_page()


def test_port_that_is_taken(open_page):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"cannot be served at 127.0.0.1, port {port}"):
            open_page(port=port)
    open_page()


# ---- The command


@pytest.fixture
def interruptible():
    """Programs that are started end with Ctrl-C, also where the tests run in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@needs_posix
@pytest.mark.usefixtures("interruptible")
def test_command(volume, tmp_path):
    """Ctrl-C ends it without a word."""
    itk.imwrite(volume, tmp_path / "a.nrrd")
    command = [sys.executable, "-m", "itk_shearwarpmip", "view", str(tmp_path / "a.nrrd"), "--no-browser"]
    with (
        subprocess.Popen(
            [*command, "--azimuth", "30", "--window", "0", "500"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process,
        contextlib.ExitStack() as stack,
    ):
        stack.callback(process.kill)
        url = process.stdout.readline().split()[-1]
        assert httpx.get(url).status_code == 200
        with connect(url.replace("http", "ws")) as client:
            client.recv(10)
            process.send_signal(signal.SIGINT)
            assert process.wait(10) == 0
        assert process.stderr.read() == ""


@pytest.mark.parametrize(
    "arguments, text",
    [
        (["none.nrrd"], "none.nrrd"),
        (["{}", "--view", "front"], "view must be one of anterior"),
        (["{}", "--overlay", "none.nrrd"], "none.nrrd"),
        (["{}", "--series", "1.2"], "series is for a DICOM folder"),
        (["{}", "--window", "3", "2"], "the lower one first"),
        (["{}", "--host", "192.0.2.1"], "cannot be served at 192.0.2.1"),
    ],
)
def test_bad_arguments(arguments, text, volume, tmp_path, capsys):
    itk.imwrite(volume, tmp_path / "a.nrrd")
    arguments = [argument.format(tmp_path / "a.nrrd") for argument in arguments]
    assert view(arguments) == main(["view", *arguments]) == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first == second and first.startswith("shear-warp-mip-view: ") and text in first


# ---- Two clients


@pytest.fixture
def connect_client(viewer):
    with contextlib.ExitStack() as stack:
        yield lambda: Client(stack.enter_context(connect_to(viewer)))


class Client:
    """What a page does, without one."""

    def __init__(self, socket):
        self.socket = socket
        self.is_active = None
        self.picture = None
        self.pending = None
        self.answers = True

    def send(self, kind, **more):
        self.socket.send(json.dumps({"type": kind, "timestamp": 0, **more}))

    def resize(self, width, height):
        self.send("resize", width=width, height=height, pwidth=width, pheight=height, ratio=1)

    def press(self, key):
        self.send("key_down", key=key, modifiers=[])

    def answer(self):
        self.send("_framefeedback", index=self.pending["index"], timestamp=self.pending["timestamp"], localtime=0)

    def read(self, condition, seconds=20):
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end
            try:
                message = self.socket.recv(0.1)
            except TimeoutError:
                continue
            if isinstance(message, bytes):
                self.picture = np.asarray(Image.open(io.BytesIO(message)))
                if self.answers:
                    self.answer()
            else:
                self.pending = json.loads(message)
                if self.pending["type"] == "active":
                    self.is_active = self.pending["value"]

    def has_size(self, width, height):
        return lambda: self.picture is not None and self.picture.shape == (height, width, 3)

    def shows(self, viewer):
        """Without a loss: PNG after JPEG."""
        wanted = viewer.snapshot()[..., :3]
        return lambda: self.picture is not None and np.array_equal(self.picture, wanted)


def test_second_client_sees_the_same_and_follows(viewer, connect_client):
    """It turns nothing until the first has gone."""
    first = connect_client()
    first.resize(300, 200)
    first.read(lambda: first.is_active is True and first.picture is not None and first.picture.shape[1] == 300)
    second = connect_client()
    second.resize(500, 400)
    second.read(lambda: second.is_active is False and second.picture is not None)
    second.press("l")
    first.press("p")
    first.read(lambda: "posterior" in viewer.code)
    viewer._settle()
    first.read(first.shows(viewer))
    second.read(second.shows(viewer))
    assert "posterior" in viewer.code and first.picture.shape == (200, 300, 3)
    first.socket.close()
    second.read(lambda: second.is_active is True)
    second.resize(500, 400)
    second.press("l")
    second.read(lambda: "left" in viewer.code and second.picture.shape == (400, 500, 3))
    viewer._settle()
    second.read(second.shows(viewer))


def test_slow_client_gets_the_picture_without_loss(viewer, connect_client):
    """Also if it was not ready for any when that was made."""
    client = connect_client()
    client.resize(300, 200)
    client.read(client.has_size(300, 200))
    viewer._settle()
    client.read(client.shows(viewer))
    client.answers = False
    for key in "pl":
        before = client.picture
        client.press(key)
        client.read(lambda before=before: client.picture is not before)
    time.sleep(1)
    client.answer()
    client.read(client.shows(viewer))


def test_pictures_wait_for_no_clock(viewer, connect_client):
    """And are not compressed twice."""
    client = connect_client()
    assert "Sec-WebSocket-Extensions" not in client.socket.response.headers
    client.resize(300, 200)
    client.read(client.has_size(300, 200))
    viewer.canvas.set_update_mode("manual")
    client.press("l")
    client.read(lambda: "left" in viewer.code)
    viewer._settle()
    client.read(client.shows(viewer))


def test_client_that_sends_nonsense(connect_client):
    client = connect_client()
    key = '{"type": "key_down", "timestamp": 0, "modifiers": []}'
    for message in ("no json", "[]", "{}", '{"type": "pointer_down"}', key):
        client.socket.send(message)
    client.resize(120, 80)
    client.read(client.has_size(120, 80))


# ---- Chromium


class Page:
    def __init__(self, driver, viewer):
        self.driver = driver
        self.viewer = viewer
        driver.get("about:blank")
        driver.get_log("browser")
        driver.get(viewer.url)
        self.wait("document.querySelector('#canvas img')?.naturalWidth > 1")
        self.picture = driver.find_element(By.CSS_SELECTOR, "#canvas img")
        self.wait(lambda: viewer._size == tuple(self.picture.size.values())[::-1])

    def run(self, script):
        return self.driver.execute_script(f"return {script}")

    def wait(self, condition, seconds=30):
        end = time.monotonic() + seconds
        while not (self.run(condition) if isinstance(condition, str) else condition()):
            assert time.monotonic() < end, condition
            time.sleep(0.05)

    def pixels(self):
        text = self.run("""(() => {
          const picture = document.querySelector('#canvas img');
          const [width, height] = [picture.naturalWidth, picture.naturalHeight];
          if (width === 0) {
            return null;
          }
          const copy = new OffscreenCanvas(width, height).getContext('2d', {willReadFrequently: true});
          copy.drawImage(picture, 0, 0);
          const {data} = copy.getImageData(0, 0, width, height);
          let text = '';
          for (let n = 0; n < data.length; n += 8192) {
            text += String.fromCharCode(...data.subarray(n, n + 8192));
          }
          return [width, height, btoa(text)];
        })()""")
        if text is None:
            # between two pictures
            return np.zeros(0)
        return np.frombuffer(base64.b64decode(text[2]), np.uint8).reshape(text[1], text[0], 4)

    def check_at_rest(self):
        """What Chromium shows in the end is the picture, bit by bit."""
        self.wait(lambda: np.array_equal(self.pixels(), self.viewer.snapshot()))
        return self.viewer.snapshot()

    def actions(self):
        actions = ActionBuilder(self.driver, duration=10)
        actions.pointer_action.move_to(self.picture)
        return actions

    def drag(self, right, down=0, button=MouseButton.LEFT, steps=8):
        actions = self.actions()
        mouse = actions.pointer_action
        mouse.pointer_down(button)
        for n in range(1, steps + 1):
            mouse.move_to(self.picture, round(right * n / steps), round(down * n / steps))
        mouse.pointer_up(button)
        actions.perform()

    def press(self, *keys):
        ActionChains(self.driver).send_keys(*keys).perform()

    def touch(self, *fingers):
        """Each finger is a list of positions; all go on together."""

        def send(kind, points):
            touches = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
            self.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

        started = []
        for finger in fingers:
            started.append(finger[0])
            send("touchStart", started)
        for points in list(zip(*fingers))[1:]:
            send("touchMove", points)
            time.sleep(0.05)
        send("touchEnd", [])

    def screenshot(self, name):
        if "VIEWER_SCREENSHOTS" in os.environ:
            folder = pathlib.Path(os.environ["VIEWER_SCREENSHOTS"])
            folder.mkdir(parents=True, exist_ok=True)
            self.driver.get_screenshot_as_file(str(folder / f"{name}.png"))


@pytest.fixture(scope="module")
def driver():
    if chromium.PATH is None:
        pytest.skip("chromium is not installed")
    driver = chromium.start(800, 600, ["browser"])
    yield driver
    driver.quit()


@pytest.fixture
def page(driver, viewer):
    page = Page(driver, viewer)
    yield page
    problems = [entry["message"] for entry in driver.get_log("browser") if entry["level"] in ("WARNING", "SEVERE")]
    assert not problems


def angles(viewer):
    return _scene.find_angles(viewer.transform)


def test_drags_end_with_the_picture(page, viewer):
    page.check_at_rest()
    page.screenshot("first")
    size = min(viewer._size)
    page.drag(-size / 6, size / 9)
    page.wait(lambda: angles(viewer) == pytest.approx((30, 20, 0), abs=0.3))
    page.check_at_rest()
    page.drag(size / 3, -size / 9)
    page.wait(lambda: angles(viewer) == pytest.approx((-30, 0, 0), abs=0.6))
    page.check_at_rest()
    for n in range(5):
        page.drag(40 + n, 11 * n, steps=20)
    page.check_at_rest()
    page.press("v")
    assert (page.check_at_rest()[..., 0] > 0).any()
    window = viewer.window
    page.drag(50, 20, MouseButton.RIGHT)
    page.wait(lambda: viewer.window != window)
    page.check_at_rest()


def test_keys_reach_the_viewer_at_once(page, viewer):
    """Before any click."""
    page.press("l")
    page.wait(lambda: angles(viewer)[0] == 90)
    page.press(Keys.ARROW_LEFT, Keys.ARROW_UP)
    page.wait(lambda: angles(viewer) == (95, -5, 0))
    page.press("?")
    page.wait(lambda: viewer._state.has_help)
    time.sleep(1)
    page.screenshot("help")
    page.press("?", "-", "]", "m", "s")
    page.wait(lambda: viewer._state.mode == "minimum" and angles(viewer)[1] == 90)
    page.check_at_rest()
    page.screenshot("minimum")


def test_click_and_double_click(page, viewer, volume):
    """The sphere, by hand: its center from the front, at its near surface."""
    picked = []
    viewer.on_pick(picked.append)
    place = volume.TransformIndexToPhysicalPoint([50, 12, 30])
    u, v, _ = viewer.transform.GetInverseTransform().TransformPoint(place)
    grid = viewer._scene.make_grid(viewer._state, viewer._size)
    x, y = (round((each - first) / grid.spacing) for each, first in zip((u, v), grid.origin))
    actions = ActionBuilder(page.driver, duration=10)
    actions.pointer_action.move_to(page.picture, x - viewer._size[0] // 2, y - viewer._size[1] // 2).click()
    actions.perform()
    page.wait(lambda: picked)
    point = viewer.point
    assert point.value == 1000
    assert point.position[0] == pytest.approx(place[0], abs=1) and point.position[2] == pytest.approx(place[2], abs=1.5)
    assert point.position[1] == pytest.approx(place[1] - 4, abs=1)
    page.check_at_rest()
    page.screenshot("point")
    page.drag(60, 10)
    ActionChains(page.driver).double_click(page.picture).perform()
    page.wait(lambda: viewer.point is None and angles(viewer) == (0, 0, 0))
    page.check_at_rest()


def test_wheel_and_middle_button(page, viewer):
    page.driver.execute_script("document.activeElement.blur()")
    page.drag(0, 0)
    ActionChains(page.driver).scroll_from_origin(ScrollOrigin.from_element(page.picture, 30, -20), 0, -200).perform()
    page.wait(lambda: viewer._state.zoom > 1.2)
    before = viewer._state.pan
    page.drag(30, 10, MouseButton.MIDDLE)
    page.wait(lambda: viewer._state.pan != before)
    page.check_at_rest()


def test_touch(page, viewer):
    """One finger turns, two zoom and move; a finger that stays does not turn."""
    page.touch([(400, 200), (380, 200), (340, 200), (300, 200)])
    page.wait(lambda: angles(viewer)[0] == pytest.approx(180 * 100 / min(viewer._size), abs=1))
    turned = viewer.transform
    assert viewer._state.zoom == 1
    page.touch([(350, 200), (330, 200), (300, 200)], [(450, 200), (470, 200), (500, 200)])
    page.wait(lambda: viewer._state.zoom == pytest.approx(2, rel=0.02))
    assert viewer.transform is turned and viewer.point is None
    pan = viewer._state.pan
    page.touch([(350, 200), (360, 215), (370, 240)], [(450, 200), (460, 215), (470, 240)])
    spacing = viewer._scene.make_grid(viewer._state, viewer._size).spacing
    page.wait(lambda: viewer._state.pan == pytest.approx((pan[0] - 20 * spacing, pan[1] - 40 * spacing), abs=spacing))
    assert viewer.transform is turned and viewer._state.zoom == pytest.approx(2, rel=0.02)
    # the mouse goes on as before
    page.drag(40)
    page.wait(lambda: viewer.transform is not turned)
    page.check_at_rest()


def test_line_is_copied(page, viewer):
    permission = {"permission": {"name": "clipboard-read"}, "setting": "granted"}
    page.driver.execute_cdp_cmd("Browser.setPermission", permission)
    page.press("r")
    page.press("c")
    page.wait(lambda: "copied" in viewer._state.message)
    read = "const done = arguments[0]; navigator.clipboard.readText().then(done, (error) => done(`${error}`))"
    page.wait(lambda: page.driver.execute_async_script(read) == viewer.code)
    assert "view='right'" in viewer.code


def test_turn_plays(page, viewer):
    page.press(" ")
    seen = set()
    page.wait(lambda: seen.add(page.run("document.querySelector('#canvas img').src")) or len(seen) > 10)
    page.press(" ")
    page.wait(lambda: viewer._played_from is None)
    page.check_at_rest()


def test_pictures_wait_for_no_frame_of_the_browser(page, viewer):
    page.driver.execute_script("window.requestAnimationFrame = () => 0")
    page.press("l")
    page.wait(lambda: angles(viewer)[0] == 90)
    page.check_at_rest()


def test_hidden_page_makes_the_viewer_wait(page, viewer, monkeypatch):
    """Not a picture after the other that nobody sees."""
    page.press(" ")
    first, paint, painted = page.driver.current_window_handle, viewer._scene.paint, []
    page.driver.switch_to.new_window("tab")
    time.sleep(1)
    monkeypatch.setattr(viewer._scene, "paint", lambda *one, **more: painted.append(1) or paint(*one, **more))
    time.sleep(2)
    assert len(painted) <= 10
    page.driver.close()
    page.driver.switch_to.window(first)
    page.press(" ")
    page.check_at_rest()


def test_two_windows(page, viewer):
    """The second one says that it only looks on, and turns when the first is closed."""
    first = page.driver.current_window_handle
    assert page.run("document.getElementById('note').hidden")
    page.driver.switch_to.new_window("window")
    page.driver.get(viewer.url)
    page.wait("document.querySelector('#canvas img')?.naturalWidth > 1")
    page.wait("document.getElementById('note').textContent.startsWith('This picture is turned in another window')")
    page.screenshot("second")
    page.press("l")
    time.sleep(0.3)
    assert angles(viewer)[0] == 0
    second = page.driver.current_window_handle
    page.driver.switch_to.window(first)
    page.driver.close()
    page.driver.switch_to.window(second)
    page.wait("document.getElementById('note').hidden")
    page.press("l")
    page.wait(lambda: angles(viewer)[0] == 90)
    page.check_at_rest()


def test_end_is_told(page, viewer):
    viewer.close()
    page.wait("document.getElementById('note').textContent === 'The viewer has ended.'")
    page.driver.get_log("browser")


def test_resize(page, viewer):
    page.driver.set_window_size(640, 480)
    page.wait(lambda: viewer._size[0] == 640)
    page.check_at_rest()
    page.driver.set_window_size(320, 400)
    page.wait(lambda: viewer._size[0] < 640)
    page.check_at_rest()
    page.screenshot("narrow")
    page.driver.set_window_size(800, 600)

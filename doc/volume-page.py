"""Makes the animation and the picture of volume-page.md: what a hand does with a page that holds a volume, in Chromium.

volume-page.py PAGE ANIMATION PICTURE

PAGE is what `shear-warp-mip head.nrrd page.html --page-volume --title 'Synthetic angiogram' --azimuth 30 --elevation 10`
makes of what `shear-warp-mip --write-phantom head.nrrd --phantom-size 512 512 256` makes. ANIMATION is a .webp.
Needs NumPy, Pillow, selenium, and Debian's chromium and chromium-driver.
"""

import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.support.ui import WebDriverWait

sys.path.append(str(Path(__file__).parents[1] / "python" / "test"))
import chromium

ANEURYSM = [37.5, -10.5, -9.5]  # mm
FRAME = 70  # ms
# a screenshot has no pointer
POINTER = """
const pointer = document.createElement('div');
pointer.style = 'position: fixed; width: 12px; height: 18px; background: white; z-index: 99; pointer-events: none;'
  + 'clip-path: polygon(0 0, 100% 65%, 55% 70%, 0 100%); filter: drop-shadow(0 0 1px black)';
document.body.append(pointer);
const follow = ({ clientX, clientY }) => Object.assign(pointer.style, { left: `${clientX}px`, top: `${clientY}px` });
addEventListener('pointermove', follow, true);
"""


class Hand:
    """Each method yields after each change."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        box = driver.execute_script("return stage.getBoundingClientRect().toJSON()")
        self.middle = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        self.at = np.zeros(2)
        self.is_down = False

    def send(self, kind: str, **arguments: Any) -> None:
        x, y = self.middle + self.at
        arguments |= {"type": kind, "x": x, "y": y, "buttons": int(self.is_down)}
        self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", arguments)

    def push(self, is_down: bool) -> None:
        self.is_down = is_down
        self.send("mousePressed" if is_down else "mouseReleased", button="left", clickCount=1)

    def move(self, x: float, y: float, count: int) -> Iterator[None]:
        """To pixels right of and below the middle of the picture."""
        start = self.at
        for n in range(1, count + 1):
            self.at = start + np.round((np.array([x, y]) - start) * (1 - np.cos(np.pi * n / count)) / 2)
            self.send("mouseMoved", button="left" if self.is_down else "none")
            yield

    def drag(self, x: float, y: float, count: int) -> Iterator[None]:
        self.push(True)
        yield from self.move(x, y, count)
        self.push(False)

    def press(self, keys: str) -> Iterator[None]:
        """A key or two a change."""
        for key in keys.split():
            for each in key:
                ActionChains(self.driver, duration=0).send_keys(each).perform()
            yield

    def find(self, point: list[float]) -> tuple[float, float]:
        """Where the picture shows a point in mm."""
        view = np.reshape(self.driver.execute_script("return cine.view"), (3, 4))
        u, v, _ = np.linalg.solve(view[:, :3], point - view[:, 3])
        scale = self.driver.execute_script("return picture.clientWidth / picture.width / cine.picture[2]")
        return u * scale, v * scale

    def rest(self, count: int) -> Iterator[None]:
        for _ in range(count):
            yield


def play(hand: Hand) -> Iterator[None]:
    yield from hand.move(80, -20, 6)
    yield from hand.drag(-90, -10, 20)
    yield from hand.drag(-80, 70, 16)
    yield from hand.drag(60, -20, 20)
    yield from hand.rest(4)
    yield from hand.press(6 * ",, ")
    yield from hand.press(8 * "[ " + 18 * "] ")
    yield from hand.rest(2)
    yield from hand.press("r")
    yield from hand.move(*hand.find(ANEURYSM), 10)
    hand.push(True)
    hand.push(False)
    WebDriverWait(hand.driver, 30).until(lambda driver: driver.execute_script("return cine.point"))
    yield from hand.rest(18)


def main(page: str, animation: str, picture: str) -> None:
    driver = chromium.start(640, 680)
    try:
        features = [{"name": "prefers-color-scheme", "value": "dark"}]
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        driver.get(Path(page).resolve().as_uri())
        wait = WebDriverWait(driver, 30, 0.01)

        def see() -> Image.Image:
            wait.until(lambda _: driver.execute_script("return window.cine && cine.settled"))
            return Image.open(io.BytesIO(driver.get_screenshot_as_png())).convert("RGB")

        see()
        driver.execute_script(POINTER)
        frames = [see() for _ in play(Hand(driver))]
        # as small as it gets: greys and one blue
        frames[-1].quantize(256, dither=Image.Dither.NONE).save(picture, optimize=True)
    finally:
        driver.quit()
    frames[0].save(animation, save_all=True, append_images=frames[1:], duration=FRAME, loop=0, quality=50, method=6)


if __name__ == "__main__":
    if len(sys.argv) != 4 or not Path(sys.argv[1]).exists():
        sys.exit(__doc__)
    main(*sys.argv[1:])

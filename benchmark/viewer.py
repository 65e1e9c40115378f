#!/usr/bin/env python3
"""The viewer under the hand: from the event in the browser to the picture in it.

A headless Chromium without GPU shows the viewer's page of a volume of uint16, and drags it. A movement has the time of
its event in the browser. A picture has its last movement, and the time when the browser has loaded it. What is measured
is the time from a movement to the first picture that shows it or a later one, and the stages of that time. After each
drag the picture at rest is compared with the viewer's, pixel by pixel.

    pip install "$(echo dist/itk_shearwarpmip-*.whl)[viewer]" selenium       # and Debian's chromium, chromium-driver
    viewer.py                                  # 100 drags, 512x512x512, a window of 1000x720
    viewer.py --volume angiogram.nrrd --output viewer.json
    viewer.py --smoke                          # only whether it works

A movement is lost if no picture shows it or a later one. Nothing is judged by its time.
"""

from __future__ import annotations

import argparse
import io
import os
import platform
import sys
import time
from pathlib import Path
from typing import Any

import itk
import numpy as np
from drags import drag, run
from itk_shearwarpmip import show
from peer.volume import make_head
from PIL import Image
from selenium.webdriver.common.by import By

sys.path.append(str(Path(__file__).parents[1] / "python" / "test"))
import chromium

STAGES = (
    "the browser sends the event",
    "the viewer has it",
    "it waits for the picture before",
    "the picture is painted",
    "it waits to be drawn",
    "it is encoded",
    "the browser has it",
    "the page takes it",
    "it is loaded",
)

# before the page's own scripts: movements and pictures with their times, in seconds as of Python's time.time()
WATCH = """
  window.moves = []
  window.pictures = []
  const since = (milliseconds) => (performance.timeOrigin + milliseconds) / 1000
  const now = () => since(performance.now())
  const arrived = {}
  let current = null
  window.WebSocket = class extends WebSocket {
    constructor (...parameters) {
      super(...parameters)
      this.addEventListener('message', ({ data }) => {
        if (typeof data === 'string') this.index = JSON.parse(data).index
        else arrived[this.index] = now()
      })
    }
    send (text) {
      const message = JSON.parse(text)
      if (message.type === 'pointer_move') {
        message.timestamp = since(window.event.timeStamp)
        window.moves.push([message.timestamp, now()])
      } else if (message.type === '_framefeedback') {
        current = [message.index, arrived[message.index], now()]
      }
      super.send(JSON.stringify(message))
    }
  }
  document.addEventListener('load', ({ target }) => {
    if (target.tagName === 'IMG') window.pictures.push([...current, now()])
  }, true)
"""


class Record:
    """Which movement each picture shows that is sent."""

    def __init__(self, viewer: Any) -> None:
        self.shown: dict[int, tuple[float, list[float]]] = {}
        """Number of a picture: time of the last movement in it; when it was begun and painted, drawn and encoded."""
        self.handled: dict[float, float] = {}
        """Time of a movement: when the viewer had it."""
        self.factors: list[int] = []
        canvas = viewer.canvas
        handle, paint, encode = viewer._handle, viewer._scene.paint, canvas._encode_frame
        moved_at = -np.inf
        states: dict[Any, float] = {}
        made: dict[int, tuple[float, list[float]]] = {}  # by address: a newer picture may take the place of an old one

        def handle_and_note(event: dict[str, Any]) -> None:
            nonlocal moved_at
            if event["event_type"] == "pointer_move":
                moved_at = event["time_stamp"]
                self.handled[moved_at] = time.time()
            handle(event)
            states[viewer._state] = moved_at

        def paint_and_note(state: Any, size: Any, **how: Any) -> Any:
            start = time.time()
            rgba = paint(state, size, **how)
            made[rgba.ctypes.data] = states.get(state, -np.inf), [start, time.time()]
            self.factors.append(how.get("factor", 1))
            return rgba

        def encode_and_note(array: Any, *arguments: Any) -> None:
            # it is sent with the client's next number, if the client has answered
            info = canvas._frame_info_per_client.get(canvas._active_client, {"sent": 0})
            before, start = info["sent"], time.time()
            encode(array, *arguments)
            if info["sent"] != before:
                last, painted = made.get(array.ctypes.data, (-np.inf, []))
                self.shown[info["sent"]] = last, [*painted, start, time.time()]

        canvas.remove_event_handler(handle, "*")
        canvas.add_event_handler(handle_and_note, "*")
        viewer._scene.paint = paint_and_note
        canvas._encode_frame = encode_and_note


def take_screenshot(picture: Any) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(picture.screenshot_as_png)).convert("RGB"))


def measure(options: argparse.Namespace) -> dict[str, Any]:
    viewer = show(options.volume or make_head((options.edge,) * 3).voxels, page={"no_browser": True}, block=False)
    record = Record(viewer)
    driver = chromium.start(*options.window)
    generator = np.random.default_rng(20020547)
    stages: list[np.ndarray] = []
    rates: list[float] = []
    lost = different = 0
    try:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": WATCH})
        driver.get(viewer.url)
        time.sleep(3)
        picture = driver.find_element(By.CSS_SELECTOR, "#canvas img")
        # views of all three axes prepare the volume
        for _ in range(3 if options.smoke else 10):
            drag(driver, picture, generator)
        time.sleep(1)
        record.factors.clear()
        for _ in range(options.drags):
            driver.execute_script("window.moves = []; window.pictures = []")
            drag(driver, picture, generator)
            viewer._settle()
            end = time.monotonic() + 10
            wanted = viewer.snapshot()[..., :3]
            while not np.array_equal(take_screenshot(picture), wanted) and time.monotonic() < end:
                time.sleep(0.05)
            different += time.monotonic() >= end
            moves, pictures = driver.execute_script("return [window.moves, window.pictures]")
            shown = [(*record.shown.get(index, (-np.inf, [])), times) for index, *times in pictures]
            for moved, sent in moves[1:]:
                found = next(((made, times) for last, made, times in shown if last >= moved), None)
                if found is None:
                    lost += 1
                else:
                    stages.append(np.diff([moved, sent, record.handled[moved], *found[0], *found[1]]))
            moving = [times[-1] for _, _, times in shown if times[-1] <= moves[-1][0]]
            if len(moving) > 2:
                rates.append((len(moving) - 1) / (moving[-1] - moving[0]))
    finally:
        driver.quit()
        viewer.close()
    milliseconds = 1e3 * np.array(stages)
    median, high, most = np.percentile(milliseconds.sum(axis=1), (50, 95, 100)).round(1).tolist()
    return {
        "volume": list(itk.size(viewer._image)),
        "canvas": list(wanted.shape[1::-1]),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "drags": options.drags,
        "movements": len(stages) + lost,
        "lost": lost,
        "drags whose last picture differs": different,
        "milliseconds from the event to the picture": {"median": median, "95th percentile": high, "most": most},
        "milliseconds of the stages, mean": dict(zip(STAGES, milliseconds.mean(axis=0).round(1).tolist())),
        "pictures per second in motion, median": round(float(np.median(rates)), 1) if rates else None,
        "lower resolution": f"{sum(factor > 1 for factor in record.factors)} of {len(record.factors)}",
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--volume", help="image file; by default a made angiogram")
    parser.add_argument("--edge", type=int, default=512, help="voxels along each side of the made one")
    run(parser, measure, "3 drags of 64 x 64 x 64 voxels", edge=64)


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""A page that holds a volume, under the hand: from the event in the browser to the picture on the canvas.

A headless Chromium without GPU opens a page and drags it. A movement has the time of its event in the browser. What is
measured is the time from a movement to the first picture on the canvas that shows it or a later one.

    shear-warp-mip angiogram.nrrd angiogram.html --page-volume --page-volume-size full --page-bits 16
    page.py angiogram.html                     # 100 drags, a window of 1000x720
    page.py angiogram.html --full-resolution   # also in motion, however slow
    page.py angiogram.html --output page.json
    page.py angiogram.html --smoke             # only whether it works

It needs Debian's chromium, chromium-driver, python3-numpy and python3-selenium.
A movement is lost if no picture shows it or a later one. Nothing is judged by its time.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from drags import drag, run
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

sys.path.append(str(Path(__file__).parents[1] / "python" / "test"))
import chromium

STAGES = ("until it is asked for", "it is projected", "it is sent and drawn")

# before the page's own scripts: the times of movements, and the last movement of each picture, in milliseconds
WATCH = """
  window.moves = []
  window.pictures = []
  const asked = []
  let last = -Infinity
  addEventListener('pointermove', (event) => {
    last = event.timeStamp
    moves.push(last)
  }, true)
  const send = Worker.prototype.postMessage
  Worker.prototype.postMessage = function (...message) {
    asked.push([last, performance.now()])
    send.apply(this, message)
  }
  const put = CanvasRenderingContext2D.prototype.putImageData
  CanvasRenderingContext2D.prototype.putImageData = function (...picture) {
    put.apply(this, picture)
    pictures.push([...asked[0], window.cine.milliseconds, performance.now()])
  }
  // an answer belongs to the oldest request that has none
  const listen = Object.getOwnPropertyDescriptor(Worker.prototype, 'onmessage')
  Object.defineProperty(Worker.prototype, 'onmessage', {
    ...listen,
    set (react) {
      listen.set.call(this, function (event) {
        react.call(this, event)
        if (!event.data.fraction) asked.shift()
      })
    }
  })
"""


def measure(options: argparse.Namespace) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        page = options.page
        if options.full_resolution:
            page = Path(folder, page.name)
            text = options.page.read_text("utf-8")
            assert "slowMilliseconds = 40" in text
            page.write_text(text.replace("slowMilliseconds = 40", "slowMilliseconds = Infinity"), "utf-8")
        return measure_page(page, options)


def measure_page(page: Path, options: argparse.Namespace) -> dict[str, Any]:
    driver = chromium.start(*options.window)
    generator = np.random.default_rng(20020547)
    stages: list[list[float]] = []
    rates: list[float] = []
    lost = 0
    try:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": WATCH})
        begin = time.monotonic()
        driver.get(page.resolve().as_uri())
        wait = WebDriverWait(driver, 120, 0.05)
        wait.until(lambda _: driver.execute_script("return window.cine && cine.shown"))
        opened = time.monotonic() - begin
        wait.until(lambda _: driver.execute_script("return cine.settled"))
        stage = driver.find_element(By.ID, "stage")
        for _ in range(options.drags + 3):
            driver.execute_script("window.moves = []; window.pictures = []")
            drag(driver, stage, generator)
            wait.until(lambda _: driver.execute_script("return cine.settled"))
            moves, pictures = driver.execute_script("return [window.moves, window.pictures]")
            for moved in moves[1:]:
                found = next((each for each in pictures if each[0] >= moved), None)
                if found is None:
                    lost += 1
                else:
                    _, asked, projected, drawn = found
                    stages.append([drawn - moved, asked - moved, projected, drawn - asked - projected])
            moving = [each[-1] for each in pictures if each[-1] <= moves[-1]]
            if len(moving) > 2:
                rates.append(1e3 * (len(moving) - 1) / (moving[-1] - moving[0]))
        canvas = driver.execute_script("return [picture.width, picture.height]")
        volume = driver.execute_script("return JSON.parse(series.textContent).volume.size")
    finally:
        driver.quit()
    times = np.array(stages)
    median, high, most = np.percentile(times[:, 0], (50, 95, 100)).round(1).tolist()
    return {
        "volume": volume,
        "picture": canvas,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "load of the machine": [round(each, 1) for each in os.getloadavg()],
        "seconds until the first picture": round(opened, 1),
        "drags": options.drags,
        "movements": len(stages) + lost,
        "lost": lost,
        "milliseconds from the event to the canvas": {"median": median, "95th percentile": high, "most": most},
        "milliseconds of the stages, median": dict(zip(STAGES, np.median(times[:, 1:], axis=0).round(1).tolist())),
        "pictures per second in motion, median": round(float(np.median(rates)), 1) if rates else None,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, help="a page that holds a volume")
    parser.add_argument("--full-resolution", action="store_true", help="also in motion, however slow a picture is")
    run(parser, measure, "3 drags")


if __name__ == "__main__":
    main()

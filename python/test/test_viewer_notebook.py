"""The viewer in a notebook of JupyterLab, in Chromium.

VIEWER_SCREENSHOTS    folder that keeps what was seen
"""

import base64
import io
import os
import pathlib
import socket
import subprocess
import sys
import time
import urllib.request

import chromium
import itk
import nbformat
import numpy as np
import pytest
from PIL import Image
from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

CELLS = (
    "from itk_shearwarpmip import show\nviewer = show('volume.nrrd', size=(600, 400))\nviewer",
    "viewer.snapshot('picture.png')\nprint(viewer.code)",
)


def wait(find, seconds=60):
    """Until it finds something."""
    end = time.monotonic() + seconds
    while True:
        try:
            found = find()
        except (OSError, WebDriverException):
            found = None
        if found or time.monotonic() > end:
            assert found
            return found
        time.sleep(0.1)


@pytest.fixture
def lab(tmp_path, rng):
    """The address of a notebook, in a JupyterLab that knows no other settings."""
    image = itk.image_from_array(rng.integers(0, 1000, (20, 30, 40), np.uint16))
    itk.imwrite(image, tmp_path / "volume.nrrd")
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    cells = [nbformat.v4.new_code_cell(source) for source in CELLS]
    nbformat.write(nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel}), tmp_path / "notebook.ipynb")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", f"--port={port}"]
    command += [f"--ServerApp.root_dir={tmp_path}", "--IdentityProvider.token=token"]
    folders = {name: str(tmp_path / name) for name in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR")}
    with (tmp_path / "log").open("w") as log:
        server = subprocess.Popen(
            command, env={**os.environ, **folders, "HOME": str(tmp_path)}, stdout=log, stderr=subprocess.STDOUT
        )
    try:

        def ask():
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/status?token=token") as answer:
                return answer.read()

        wait(ask)
        yield f"http://127.0.0.1:{port}/lab/tree/notebook.ipynb?token=token"
    finally:
        server.terminate()
        server.wait(30)


@pytest.fixture
def driver():
    if chromium.PATH is None:
        pytest.skip("chromium is not installed")
    driver = chromium.start(1000, 900)
    yield driver
    driver.quit()


def run_cell(driver, number):
    """Again, if the kernel did not listen yet."""

    def is_running():
        return driver.find_elements(By.CSS_SELECTOR, ".jp-InputArea-prompt")[number].text.strip() not in ("", "[ ]:")

    def run():
        driver.find_elements(By.CSS_SELECTOR, ".jp-CodeCell .cm-content")[number].click()
        ActionChains(driver).key_down(Keys.SHIFT).send_keys(Keys.ENTER).key_up(Keys.SHIFT).perform()
        time.sleep(1)
        return is_running()

    wait(run)


def screenshot(driver, name):
    if "VIEWER_SCREENSHOTS" in os.environ:
        driver.get_screenshot_as_file(str(pathlib.Path(os.environ["VIEWER_SCREENSHOTS"]) / f"{name}.png"))


def read_picture(driver):
    text = driver.execute_async_script("""
      const done = arguments[0]
      fetch(document.querySelector('.renderview-wrapper img').src).then((answer) => answer.blob()).then((blob) => {
        const reader = new FileReader()
        reader.onload = () => done(reader.result.split(',')[1])
        reader.readAsDataURL(blob)
      }, () => done(''))
    """)
    # or there is another one already
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(text)))) if text else None


def test_notebook(driver, lab, tmp_path):
    driver.get(lab)
    wait(lambda: driver.find_element(By.XPATH, "//*[contains(text(), '| Idle')]"))
    run_cell(driver, 0)
    picture = wait(lambda: driver.find_element(By.CSS_SELECTOR, ".renderview-wrapper img"), 30)
    wait(lambda: picture.get_property("naturalWidth") == 600 and picture.get_property("naturalHeight") == 400)
    drag = ActionChains(driver, duration=10).move_to_element(picture).click_and_hold()
    for _ in range(10):
        drag.move_by_offset(-5, 2)
    drag.release().perform()
    # a key, and the line of Python
    ActionChains(driver).send_keys("-").perform()
    expected = ("azimuth=22.5, elevation=9.0", "slab=", "size=(600, 400)")

    def read_code():
        run_cell(driver, 1)
        outputs = driver.find_elements(By.CSS_SELECTOR, ".jp-OutputArea-output pre")
        return all(any("mip(" in each.text and part in each.text for each in outputs) for part in expected)

    # a busy browser hands events over late
    wait(read_code)
    wanted = np.asarray(Image.open(tmp_path / "picture.png"))
    wait(lambda: np.array_equal(read_picture(driver), wanted))
    screenshot(driver, "notebook")

"""Chromium without a screen and without a GPU, in which a page has the same pixels on every computer."""

import os
import shutil
from collections.abc import Sequence
from typing import Any

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

PATH = shutil.which("chromium")


def start(width: int, height: int, logs: Sequence[str] = ()) -> Any:
    """A Selenium driver with a window of this size, which keeps all entries of these logs: "browser", "performance".
    FileNotFoundError if it is not installed."""
    if PATH is None:
        raise FileNotFoundError("chromium is not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = PATH
    options.set_capability("goog:loggingPrefs", dict.fromkeys(logs, "ALL"))
    for argument in (
        "--headless=new",
        f"--window-size={width},{height}",
        "--force-device-scale-factor=1",
        "--force-color-profile=srgb",
        "--hide-scrollbars",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        *(["--no-sandbox"] if os.geteuid() == 0 else []),
    ):
        options.add_argument(argument)
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)

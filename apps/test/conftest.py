"""What all tests of pages share."""

import pathlib
import sys

import pytest

sys.path.append(str(pathlib.Path(__file__).parents[2] / "python" / "test"))


@pytest.fixture(scope="module")
def driver():
    # the other tests of this folder need no browser
    import chromium

    driver = chromium.start(1000, 720, ["browser", "performance"])
    offline = {"offline": True, "latency": 0, "downloadThroughput": 0, "uploadThroughput": 0}
    driver.execute_cdp_cmd("Network.emulateNetworkConditions", offline)
    yield driver
    driver.quit()

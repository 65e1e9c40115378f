"""Makes the picture of volume-page.md: a page that holds a volume in Chromium, after a click on the aneurysm.

volume-page.py PAGE PICTURE

PAGE is what `shear-warp-mip head.nrrd page.html --page-volume --title 'Synthetic angiogram' --azimuth 30 --elevation 10`
makes of what `shear-warp-mip --write-phantom head.nrrd --phantom-size 512 512 256` makes. Needs NumPy, Pillow, selenium,
and Debian's chromium and chromium-driver.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.support.ui import WebDriverWait

sys.path.append(str(Path(__file__).parents[1] / "python" / "test"))
import chromium

ANEURYSM = [37.5, -10.5, -9.5]  # mm


def main(page: str, output: str) -> None:
    driver = chromium.start(1000, 863)
    try:
        features = [{"name": "prefers-color-scheme", "value": "dark"}]
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        driver.get(Path(page).resolve().as_uri())
        wait = WebDriverWait(driver, 30)
        wait.until(lambda _: driver.execute_script("return window.cine && cine.settled"))
        view = np.reshape(driver.execute_script("return cine.view"), (3, 4))
        u, v, _ = np.linalg.solve(view[:, :3], ANEURYSM - view[:, 3])
        scale, stage = driver.execute_script("return [picture.clientWidth / picture.width / cine.picture[2], stage]")
        ActionChains(driver).move_to_element_with_offset(stage, round(u * scale), round(v * scale)).click().perform()
        wait.until(lambda _: driver.execute_script("return cine.point"))
        driver.get_screenshot_as_file(output)
    finally:
        driver.quit()
    # as small as it gets: greys and one blue
    Image.open(output).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(output, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not Path(sys.argv[1]).exists():
        sys.exit(__doc__)
    main(*sys.argv[1:])

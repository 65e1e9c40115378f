"""Makes the picture of viewer.md: the viewer's page in Chromium, after a click on the aneurysm.

viewer.py IMAGE PICTURE

IMAGE is the head that `shear-warp-mip --write-phantom` makes. Needs the wheel with its extra `viewer`, selenium, and Debian's
chromium and chromium-driver.
"""

import sys
import time
from pathlib import Path

from itk_shearwarpmip import show
from PIL import Image
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By

sys.path.append(str(Path(__file__).parents[1] / "python" / "test"))
import chromium

ANEURYSM = [37.5, -10.5, -9.5]  # mm


def main(image: str, output: str) -> None:
    driver = chromium.start(1000, 863)
    viewer = show(image, azimuth=30, elevation=10, title="Synthetic angiogram", page={"no_browser": True}, block=False)
    try:
        driver.get(viewer.url)
        time.sleep(2)
        u, v, _ = viewer.transform.GetInverseTransform().TransformPoint(ANEURYSM)
        mip = viewer.project()
        x, y = mip.TransformPhysicalPointToIndex([u, v])
        columns, rows = mip.GetLargestPossibleRegion().GetSize()
        actions = ActionBuilder(driver)
        picture = driver.find_element(By.CSS_SELECTOR, "#canvas img")
        actions.pointer_action.move_to(picture, x - columns // 2, y - rows // 2).click()
        actions.perform()
        time.sleep(2)
        print(viewer.point, viewer.code, sep="\n")
        driver.get_screenshot_as_file(output)
    finally:
        viewer.close()
        driver.quit()
    # as small as it gets: greys and one blue
    Image.open(output).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(output, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not Path(sys.argv[1]).exists():
        sys.exit(__doc__)
    main(*sys.argv[1:])

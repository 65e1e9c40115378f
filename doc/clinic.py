"""Makes the picture of clinic.md: runs the commands that the page prints, and puts their four pictures side by side.

clinic.py PICTURE       with shear-warp-mip on the PATH
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

folder = Path(__file__).parent
commands = re.findall(r"^    (shear-warp-mip ct\.nrrd (\S+) .*)", (folder / "clinic.md").read_text(), re.MULTILINE)
with tempfile.TemporaryDirectory() as work:
    subprocess.run([sys.executable, folder.parent / "examples" / "pet_ct.py"], cwd=work, check=True)
    for command, _ in commands:
        subprocess.run(command, shell=True, cwd=work, check=True)
    tiles = [Image.open(Path(work, name)).convert("RGB") for _, name in commands]
whole = Image.new("RGB", (sum(tile.width for tile in tiles), tiles[0].height))
for number, tile in enumerate(tiles):
    whole.paste(tile, (sum(each.width for each in tiles[:number]), 0))
whole.quantize(256, dither=Image.Dither.NONE).save(sys.argv[1], optimize=True)

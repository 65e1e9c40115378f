"""The program that the tests compare the package with."""

import os
import shutil
import sys
from pathlib import Path

# The program that the wheel brings, or another one
PROGRAM = os.environ.get("SHEARWARPMIP_PROGRAM") or shutil.which(
    "shear-warp-mip", path=str(Path(sys.executable).parent)
)
# of a program that draws labels
NO_LABELS = ["--no-labels"]

# for a script: shells have programs in the background ignore SIGINT
HEED_INTERRUPTS = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"

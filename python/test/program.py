"""The program that the tests compare the package with."""

import os
import shutil
import signal
import sys
from pathlib import Path

# The program that the wheel brings, or another one
PROGRAM = os.environ.get("SHEARWARPMIP_PROGRAM") or shutil.which(
    "shear-warp-mip", path=str(Path(sys.executable).parent)
)
# of a program that draws labels
NO_LABELS = ["--no-labels"]


def heed_interrupts():
    """For a process that starts: shells have programs in the background ignore SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

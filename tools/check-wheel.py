#!/usr/bin/env python3
"""Checks wheels: each has the program, the notices of the libraries in it, and no library under the GPL, which a wheel
under the Apache License must not have.

check-wheel.py WHEEL...
"""

import re
import sys
import zipfile
from pathlib import Path

# shared libraries under the GPL that image formats and build machines bring, as their files are named
GPL = re.compile(
    r"(lib)?(a52|avcodec|avfilter|avformat|avutil|bfd|cdio\+\+|cdio|cholmod|dvdread|fftw3\w*|gdbm|gsl(cblas)?|history|jbig|mpeg2|opcodes"
    r"|poppler|postproc|readline|spqr|swresample|swscale|umfpack|x26[45]|xvidcore)[-.\d].*"
)
PROGRAM = re.compile(r".*/scripts/shear-warp-mip(\.exe)?")
NOTICE = re.compile(r".*\.dist-info/licenses/(CLI11|GDCM|PNG|TIFF|wasi-libc)/.+")


def find_faults(wheel: Path) -> list[str]:
    with zipfile.ZipFile(wheel) as file:
        names = file.namelist()
    faults = [f"has {name}, whose licence is the GPL" for name in names if GPL.fullmatch(Path(name).name)]
    if len({match[1] for match in map(NOTICE.fullmatch, names) if match}) < 5:
        faults.append("has not the notices of CLI11, GDCM, PNG, TIFF and wasi-libc")
    if not any(PROGRAM.fullmatch(name) for name in names):
        faults.append("has no program shear-warp-mip")
    return [f"{wheel}: {fault}" for fault in faults]


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit("\n".join(fault for name in sys.argv[1:] for fault in find_faults(Path(name))) or None)

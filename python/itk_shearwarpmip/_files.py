"""Reads files by the program: image files of all its formats, and DICOM folders."""

import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from itk_shearwarpmip import _program

_MEMORY = Path("/dev/shm")
"""A folder in memory, if there is one."""
_TYPES = {
    "signed char": "i1", "unsigned char": "u1", "short": "i2", "unsigned short": "u2", "int": "i4",
    "unsigned int": "u4", "long long int": "i8", "unsigned long long int": "u8", "float": "f4", "double": "f8",
}  # fmt: skip


def read(path: str, *options: str) -> tuple[Any, dict[str, str]]:
    """Reads a file or a DICOM folder by the program, with its options.

    Returns the voxels and what the file says of them, as texts. The voxels have the axes t, z, y, x, and behind these
    the components if there are several. Beside the entries of the dictionary there are "Origin", "Spacing" and
    "Direction", row by row.

    Raises OSError and ValueError with the program's words: see _program.run().
    """
    if not os.path.exists(path):
        raise FileNotFoundError(f"'{path}' does not exist")
    for folder in _find_folders():
        # on some systems, a mapped file cannot be removed
        with tempfile.TemporaryDirectory(prefix="shear-warp-mip-", dir=folder, ignore_cleanup_errors=True) as temporary:
            volume = os.path.join(temporary, "volume.nrrd")
            try:
                _program.run([*options, "--with-attributes", f"--write-volume={volume}", "--", path])
            except _program.ProgramError as error:
                if "cannot write" not in str(error):
                    raise
                if folder is None:
                    message = (
                        f"'{path}' needs more room than '{tempfile.gettempdir()}' has: set TMPDIR to another folder"
                    )
                    raise OSError(message) from error
                continue
            return _load(volume, is_in_memory=folder is not None)
    raise AssertionError


def _find_folders() -> Iterator[Path | None]:
    """Where the program writes to: in memory, or the usual place."""
    if os.access(_MEMORY, os.W_OK):
        yield _MEMORY
    yield None


def _load(path: str, is_in_memory: bool) -> tuple[Any, dict[str, str]]:
    """Loads what the program has written: NRRD without compression."""
    with open(path, "rb") as file:
        lines = [os.fsdecode(line).rstrip("\n") for line in iter(file.readline, b"\n")]
        begin = file.tell()
    fields, entries = {}, {}
    for line in lines[1:]:
        if ":=" in line and not line.startswith("#"):
            key, _, value = line.partition(":=")
            entries[key] = re.sub(r"\\(.)", lambda match: "\n" if match[1] == "n" else match[1], value)
        else:
            key, _, value = line.partition(": ")
            fields[key] = value
    sizes, kinds = [int(size) for size in fields["sizes"].split()], fields["kinds"].split()
    components = 1 if kinds[0] == "domain" else sizes.pop(0)
    times = sizes.pop() if len(sizes) == 4 else 1
    shape = (times, *reversed(sizes), *([components] if components > 1 else []))
    dtype = np.dtype((">" if fields.get("endian") == "big" else "<") + _TYPES[fields["type"]])
    if is_in_memory:
        # of the mapping, the file's name can go
        voxels = np.memmap(path, dtype, "c", begin, shape).view(np.ndarray)
    else:
        voxels = np.fromfile(path, dtype, offset=begin).reshape(shape)
    entries["Origin"] = " ".join(fields["space origin"].strip("()").split(",")[:3])
    return voxels, entries

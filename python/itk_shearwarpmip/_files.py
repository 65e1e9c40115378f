"""Reads files by the program: image files of all its formats, and DICOM folders."""

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import numpy as np

from itk_shearwarpmip import _program

_TYPES = {
    "signed char": "i1", "unsigned char": "u1", "short": "i2", "unsigned short": "u2", "int": "i4",
    "unsigned int": "u4", "long long int": "i8", "unsigned long long int": "u8", "float": "f4", "double": "f8",
}  # fmt: skip


def read(path: str, *options: str) -> tuple[Any, dict[str, str]]:
    """Reads a file or a DICOM folder by the program, with its options.

    Returns the voxels and what the file says of them, as texts. The voxels have the axes t, z, y, x, and behind these
    the components if there are several. Beside the entries of the dictionary there are "Origin", "Spacing" and
    "Direction", row by row.

    Raises OSError and ValueError with the program's words, or RuntimeError: see _program.run().
    """
    if not os.path.exists(path):
        raise FileNotFoundError(f"'{path}' does not exist")

    def write(name: str, file: IO[bytes] | None = None) -> None:
        try:
            _program.run([*options, "--with-attributes", f"--write-volume={name}", "--", path], file)
        except _program.ProgramError as error:
            if "' has frames of projections" not in str(error):
                raise
            raise _program.ProgramError(f"{error}: write() makes pictures, pages and animations of it") from None

    if hasattr(os, "memfd_create"):
        # this memory ends with the processes that have it, even if they are killed
        with open(os.memfd_create("shear-warp-mip"), "w+b") as file, _if_full():
            write("-", file)
            return _load(file, is_in_memory=True)
    with tempfile.TemporaryDirectory(prefix="shear-warp-mip-") as folder:
        with _if_full(f"'{path}' needs more room than '{tempfile.gettempdir()}' has: set TMPDIR to another folder"):
            write(volume := os.path.join(folder, "volume.nrrd"))
        with open(volume, "rb") as written:
            return _load(written, is_in_memory=False)


@contextmanager
def _if_full(message: str = "") -> Iterator[None]:
    """Goes on if there is no room to write, or raises an OSError with a message."""
    try:
        yield
    except _program.ProgramError as error:
        if not str(error).startswith("cannot write "):
            raise
        if message:
            raise OSError(message) from error


def _load(file: IO[bytes], is_in_memory: bool) -> tuple[Any, dict[str, str]]:
    """Loads what the program has written: NRRD without compression."""
    file.seek(0)
    lines: list[str] = []
    while (line := file.readline()) != b"\n":
        if not line:
            raise RuntimeError("the program wrote no volume: is it shear-warp-mip?")
        lines.append(os.fsdecode(line).rstrip("\n"))
    begin = file.tell()
    fields, entries = {}, {}
    for field in lines[1:]:
        if ":=" in field and not field.startswith("#"):
            key, _, value = field.partition(":=")
            entries[key] = re.sub(r"\\(.)", lambda match: "\n" if match[1] == "n" else match[1], value)
        else:
            key, _, value = field.partition(": ")
            fields[key] = value
    sizes, kinds = [int(size) for size in fields["sizes"].split()], fields["kinds"].split()
    components = 1 if kinds[0] == "domain" else sizes.pop(0)
    times = sizes.pop() if len(sizes) == 4 else 1
    shape = (times, *reversed(sizes), *([components] if components > 1 else []))
    dtype = np.dtype((">" if fields.get("endian") == "big" else "<") + _TYPES[fields["type"]])
    if is_in_memory:
        voxels = np.memmap(file, dtype, "c", begin, shape).view(np.ndarray)
    else:
        voxels = np.fromfile(file, dtype).reshape(shape)
    entries["Origin"] = " ".join(fields["space origin"].strip("()").split(",")[:3])
    return voxels, entries

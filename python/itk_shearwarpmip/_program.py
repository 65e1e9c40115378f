"""Runs the program shear-warp-mip, which reads and writes files, in a process of its own."""

import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import IO

_NAME = "shear-warp-mip"
_VARIABLE = "SHEARWARPMIP_PROGRAM"
_SECONDS_TO_END = 10
"""In which the program removes what it has begun to write."""
_ENVIRONMENT = {"GLIBC_TUNABLES": "glibc.malloc.hugetlb=1"}
"""Volumes lie in large pages, which are faster to get."""


_NOTES = r"note: (there are no letters: .* does not say|.* looks like labels: )"
"""The direction is unknown; values of pixels that no label has."""


class ProgramError(OSError, ValueError):
    """What the program refuses: a file, or what was asked of it."""


def find() -> str:
    """The path of the program: the environment variable SHEARWARPMIP_PROGRAM, or the wheel's, or one on the PATH.

    Raises FileNotFoundError.
    """
    named = os.environ.get(_VARIABLE)
    if named:
        if found := shutil.which(named):
            return found
        raise FileNotFoundError(f"{_VARIABLE} names '{named}', which is no program")
    for folder in (sysconfig.get_path("scripts"), None):
        if found := shutil.which(_NAME, path=folder):
            return found
    raise FileNotFoundError(
        f"the program {_NAME}, which reads and writes files, is missing: install the wheel again by "
        "pip install --force-reinstall --no-deps <wheel>"
    )


def run(
    arguments: Sequence[str],
    output: IO[bytes] | None = None,
    temporary: Sequence[Path] = (),
    with_notes: bool = False,
) -> None:
    """Runs the program, whose standard output goes to a file. The program ends before this function does.

    Its warnings become warnings at the line that called the package. With `with_notes`, so do the notes that say what a
    caller of Python cannot know: see _NOTES. Names of `temporary` files are left out.

    Raises FileNotFoundError without the program or a file; TypeError for unknown options; ProgramError, an OSError and a
    ValueError, for what else the program refuses, with its sentence, in which options are keywords; and RuntimeError if
    the program was ended.
    """
    try:
        child = subprocess.Popen(
            [find(), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output or subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=_ENVIRONMENT | os.environ,
        )
    except PermissionError as error:
        raise OSError(f"the program {_NAME} cannot be started: {error}") from error
    with child:
        try:
            messages = _leave_out(temporary, os.fsdecode(child.communicate()[1]))
        except BaseException:
            _end(child)
            raise
    said = [line.removeprefix(f"{_NAME}: ") for line in messages.split("\n") if line.startswith(f"{_NAME}: ")]
    errors = [line for line in said if not re.match("(warning|note): ", line)]
    for line in said:
        if line.startswith("warning: ") or (with_notes and re.match(_NOTES, line)):
            warnings.warn(reword(line.partition(": ")[2]), stacklevel=_count_own_frames())
    if child.returncode < 0:
        name = signal.Signals(-child.returncode).name
        raise RuntimeError(f"the program {_NAME} was ended by {name}; is there too little memory?")
    if child.returncode != 0:
        if not errors:
            raise RuntimeError(f"the program {_NAME} ended with {child.returncode}: {messages.strip()}")
        text = reword(errors[-1])
        if unknown := re.match(r"([\w-]+)(=.*)?( is not expected.*)", text):
            raise TypeError(unknown[1] + unknown[3])
        if re.fullmatch(r"'[^']*' does not exist", text):
            raise FileNotFoundError(text)
        raise ProgramError(text)


def _leave_out(files: Sequence[Path], text: str) -> str:
    """What nobody knows by its name is "the source", "the mask" and so on."""
    for file in files:
        text = re.sub(rf"(the )?({file.stem} )?'{re.escape(str(file))}'", f"the {file.stem}", text)
    return text


def reword(text: str) -> str:
    """Turns options into keywords, but not in names of files."""

    def name(match: re.Match[str]) -> str:
        if not match[1]:
            return "the source" if match[0] == "INPUT" else match[0]
        return match[1].replace("-", "_") + ("=NUMBER" if match[2] else "")

    text = re.sub(r"(did you mean ')--([a-z-]+)", lambda match: match[1] + match[2].replace("-", "_"), text)
    return re.sub(r"'[^']*'|(?<![\w-])--([a-z][a-z-]*)( NUMBER)?|\bINPUT\b", name, text).removesuffix("; see help")


def _end(child: subprocess.Popen[bytes]) -> None:
    child.terminate()
    try:
        child.wait(_SECONDS_TO_END)
    except BaseException:
        child.kill()
        child.wait()


def _count_own_frames() -> int:
    """The stack level of the first caller outside this package, for the caller of this function."""
    folder = os.path.dirname(__file__)
    frame, level = sys._getframe(1), 1
    while frame.f_back and os.path.dirname(frame.f_code.co_filename) == folder:
        frame, level = frame.f_back, level + 1
    return level

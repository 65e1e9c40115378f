#!/usr/bin/env python3
"""Builds what a released wheel is built against, on Linux, macOS and Windows: FOLDER/build, an ITK build tree with ITK's
own copies of all libraries, and FOLDER/cli11. cibuildwheel runs this script (pyproject.toml).

wheel-tree.py FOLDER [OPTION_OF_CMAKE...]
The options are for ITK. FOLDER/source, ITK's source, and FOLDER/cli11-source are used if they are there, and fetched
otherwise. The programs needed are git, Python 3.11 or later and a compiler; CMake and Ninja come from PyPI.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

ITK = ("https://github.com/InsightSoftwareConsortium/ITK", "v5.4.7")
CLI11 = ("https://github.com/CLIUtils/CLI11", "v2.4.1")
TOOLS = ("cmake==3.31.10", "ninja==1.13.0")
OPTIONS = Path(__file__).resolve().parent / "itk-options.txt"


def run(*command: str | Path) -> None:
    subprocess.run(command, check=True)


def fetch(origin: tuple[str, str], folder: Path) -> None:
    if not folder.exists():
        run("git", "clone", "--quiet", "--depth=1", f"--branch={origin[1]}", origin[0], folder)


def install_tools(folder: Path) -> None:
    run(sys.executable, "-m", "venv", folder)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    run(programs / "python", "-m", "pip", "install", "--quiet", *TOOLS)
    os.environ["PATH"] = os.pathsep.join((str(programs), os.environ["PATH"]))


def configure(source: Path, build: Path, *options: str) -> None:
    run("cmake", "-S", source, "-B", build, "-G", "Ninja", *options)


def install_cli11(source: Path, folder: Path) -> None:
    parts = [f"-DCLI11_BUILD_{part}=OFF" for part in ("DOCS", "EXAMPLES", "TESTS")]
    configure(source, source / "build", f"-DCMAKE_INSTALL_PREFIX={folder.as_posix()}", *parts)
    run("cmake", "--build", source / "build", "--target", "install")
    shutil.copy(source / "LICENSE", folder / "LICENSE.CLI11")


def build_itk(source: Path, build: Path, *options: str) -> None:
    python = (f"-DPython3_EXECUTABLE={sys.executable}", f"-DPython3_INCLUDE_DIR={sysconfig.get_path('include')}")
    configure(source, build, *OPTIONS.read_text().splitlines(), *python, *options)
    # all static libraries, and the wrapping's interface files; no Python module is compiled
    rules = subprocess.check_output(("ninja", "-C", build, "-t", "targets", "all"), text=True).splitlines()
    outputs = [Path(rule.split(":")[0]) for rule in rules]
    libraries = [
        path
        for path in outputs
        if path.parts[0] == "lib" and path.suffix in (".a", ".lib") and "testlib" not in path.name
    ]
    run("ninja", "-C", build, *libraries, "ITKCommonSwig", "ITKTransformSwig")


def main(folder: Path, *options: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    install_tools(folder / "tools")
    fetch(CLI11, folder / "cli11-source")
    install_cli11(folder / "cli11-source", folder / "cli11")
    fetch(ITK, folder / "source")
    build_itk(folder / "source", folder / "build", *options)


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    main(Path(sys.argv[1]), *sys.argv[2:])

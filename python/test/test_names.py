"""One name for each parameter, in filters, package, program and documentation."""

import inspect
import re
import subprocess
from pathlib import Path

import itk
from itk_shearwarpmip import mip, show, turn
from program import PROGRAM

DOCUMENT = Path(__file__).parents[2] / "doc" / "parameters.md"


def read_table():
    """The names of each row: of the filter, the package and the program."""
    text = DOCUMENT.read_text(encoding="utf-8").split("\n## All\n")[1]
    rows = [line.split("|")[1:4] for line in text.splitlines() if line.startswith("|")]
    return [[re.findall(r"`([\w-]+)`", cell) for cell in row] for row in rows[2:]]


def find_keywords(function):
    kinds = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_KEYWORD
    found = inspect.signature(function).parameters.values()
    return {each.name for each in found if each.kind not in kinds and each.name != "source"}


def test_table_is_complete():
    filters, keywords, options = ({name for cell in column for name in cell} for column in zip(*read_table()))
    image = itk.Image[itk.SS, 3]
    inherited = {*dir(itk.ImageToImageFilter[image, image])}
    setters = set()
    for template in (itk.ShearWarpMIPImageFilter, itk.ShearWarpMIPCineImageFilter):
        own = {*dir(template[image, image])} - inherited - {"SetTransformInput", "SetOutputParametersFromImage"}
        setters |= {name.removeprefix("Set") for name in own if re.match("Set|AddT|ClearT", name)}
    assert filters == setters | {"NumberOfWorkUnits"}
    assert keywords == find_keywords(mip) | find_keywords(turn)
    # what the viewer has beyond them
    others = "overlay window overlay_window colour overlay_colour opacity title canvas block page".split()
    assert find_keywords(show) <= {*keywords, *others}
    if PROGRAM:
        text = subprocess.run([PROGRAM, "--help-all"], check=True, capture_output=True, text=True).stdout
        assert options <= {*re.findall(r"(?m)^  (--[a-z-]+)", text)}


def test_package_and_program_have_the_same_words():
    for _, keywords, options in read_table():
        names = ["--" + name.replace("_", "-") for name in keywords]
        assert not (names and options) or names == options or options == ["--transform"]

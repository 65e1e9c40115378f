#!/usr/bin/env python3
"""Finds files of the program that include each other in a circle. A .cxx and its .h are one.

Usage: check-includes.py FOLDER
"""

import re
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

included: dict[str, set[str]] = {}
for path in Path(sys.argv[1]).rglob("*.[ch]*"):
    names = re.findall(r'^#include "(\w+)\.h"', path.read_text(encoding="utf-8"), re.MULTILINE)
    included.setdefault(path.stem, set()).update({*names} - {path.stem})
try:
    TopologicalSorter(included).prepare()
except CycleError as error:
    sys.exit("a circle of files that include each other: " + ", ".join(error.args[1]))

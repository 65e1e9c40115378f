#!/usr/bin/env python3
"""Checks that the files which name this project agree: CITATION.cff and paper/paper.md in title, authors and algorithm;
CITATION.cff and all that a release is made from in version.

check-citation.py
"""

import re
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parent.parent
VERSIONS = {
    "CMakeLists.txt": r"project\(ShearWarpMIP VERSION (\S+)",
    "ShearWarpMIP.remote.cmake": r"GIT_TAG v(\S+)",
    "conda/recipe.yaml": r'^  version: "(.*)"',
    "pyproject.toml": r'^version = "(.*)"',
}


def find_faults() -> list[str]:
    faults = []
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    paper = yaml.safe_load((ROOT / "paper/paper.md").read_text().split("---\n")[1])
    if not paper["title"].startswith(f"{citation['title']}: "):
        faults.append(f"its title does not begin with '{citation['title']}: ', as CITATION.cff has it")
    if [author["name"] for author in paper["authors"]] != [author["name"] for author in citation["authors"]]:
        faults.append("its authors are not the authors of CITATION.cff")
    for reference in citation["references"]:
        if reference["title"].lower() not in (ROOT / "paper/paper.bib").read_text().lower():
            faults.append(f"it does not cite '{reference['title']}', as CITATION.cff does")
    faults = [f"paper/paper.md: {fault}" for fault in faults]
    for name, pattern in VERSIONS.items():
        found = re.findall(pattern, (ROOT / name).read_text(), re.MULTILINE)
        if found != [citation["version"]]:
            faults.append(f"{name}: its version is {', '.join(found)}, but CITATION.cff has {citation['version']}")
    return faults


if __name__ == "__main__":
    sys.exit("\n".join(find_faults()) or None)

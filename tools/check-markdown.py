#!/usr/bin/env python3
"""Checks Markdown files. Without --lines: each file and heading that is linked exists, and no link goes to a repository
or package of this project, which are not published. With --lines: text has one sentence a line and at most 120 columns.

check-markdown.py [--lines] FILE...
"""

import re
import sys
from pathlib import Path

UNPUBLISHED = re.compile(r"github\.com/\S*shearwarpmip|(pypi\.org|shields\.io)/\S*shearwarpmip", re.IGNORECASE)
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"^```.*?^```$|^    .*?$|^\$\$.*?\$\$$", re.MULTILINE | re.DOTALL)
TABLE_OR_LINK = re.compile(r"\||.*(\]\(|https?://)")
LABEL = re.compile(r"(- )?\*\*.*?\*\* ")
END_OF_SENTENCE = re.compile(r"[\w)`*%]{2}[.!?] +[A-Z`*]")


def find_anchors(text: str) -> set[str]:
    """The anchors of the headings: lower case, with hyphens for spaces, without punctuation."""
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def find_link_faults(path: Path, text: str) -> list[str]:
    faults = [f"links to {match[0]}, which is not published" for match in UNPUBLISHED.finditer(text)]
    for link in LINK.findall(text):
        name, _, anchor = link.partition("#")
        target = path.parent / name if name else path
        if "://" in link:
            continue
        if not target.exists():
            faults.append(f"links to {link}, which does not exist")
        elif anchor and anchor not in find_anchors(target.read_text()):
            faults.append(f"links to {link}, but there is no such heading")
    return faults


def find_line_faults(text: str) -> list[str]:
    faults = []
    without_code = CODE.sub(lambda code: "\n" * code[0].count("\n"), text)
    for number, line in enumerate(without_code.splitlines(), 1):
        if len(line) > 120 and not TABLE_OR_LINK.match(line):
            faults.append(f"line {number} has more than 120 columns")
        if not line.startswith("|") and END_OF_SENTENCE.search(LABEL.sub("", line, count=1)):
            faults.append(f"line {number} has more than one sentence")
    return faults


def find_faults(path: Path, is_lines: bool) -> list[str]:
    text = path.read_text()
    faults = find_line_faults(text) if is_lines else find_link_faults(path, text)
    return [f"{path}: {fault}" for fault in faults]


if __name__ == "__main__":
    is_lines = sys.argv[1] == "--lines"
    all_faults = [fault for name in sys.argv[1 + is_lines :] for fault in find_faults(Path(name), is_lines)]
    sys.exit("\n".join(all_faults) or None)

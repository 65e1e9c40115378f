#!/usr/bin/env python3
"""Checks that each file and heading to which a Markdown file links is there, and that none links to a repository or
package of this project, which are not published.

check-links.py FILE...
"""

import re
import sys
from pathlib import Path

UNPUBLISHED = re.compile(r"github\.com/\S*shearwarpmip|(pypi\.org|shields\.io)/\S*shearwarpmip", re.IGNORECASE)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def find_anchors(text: str) -> set[str]:
    """The anchors of the headings: lower case, with hyphens for spaces, without punctuation."""
    headings = re.findall(r"^#+ +(.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def find_faults(path: Path) -> list[str]:
    text = path.read_text()
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
    return [f"{path}: {fault}" for fault in faults]


if __name__ == "__main__":
    all_faults = [fault for name in sys.argv[1:] for fault in find_faults(Path(name))]
    sys.exit("\n".join(all_faults) or None)

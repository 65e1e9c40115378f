"""Doxygen's input filter: a comment above several of ITK's macros becomes each one's."""

import re
import sys
from pathlib import Path

COMMENT = r"( */\*\*(?:(?!\*/).)*\*/\n)"
MACROS = r"((?: *itk\w+Macro\([^\n]*\);\n)+)"


def repeat(match: re.Match) -> str:
    comment, macros = match.groups()
    return "".join(comment + macro for macro in macros.splitlines(keepends=True))


header = Path(sys.argv[1]).read_text(encoding="utf-8")
sys.stdout.write(re.sub(COMMENT + MACROS, repeat, header, flags=re.DOTALL))

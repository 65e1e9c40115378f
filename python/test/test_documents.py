"""README.md and the pages of doc/: each block that can run is run as it is printed, page by page, top to bottom, in a
folder with what the page itself made and links to the folders of the project.

Blocks of Python and of commands run: those with the language python or sh, and indented ones, which are commands.
The comment <!-- not run: REASON --> above a block leaves it out.
"""

import os
import re
import shutil
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import itk_shearwarpmip
import pytest
from markdown_it import MarkdownIt
from program import PROGRAM
from rendercanvas.offscreen import RenderCanvas

ROOT = Path(__file__).parents[2]
PAGES = ["README.md", *(f"doc/{page.name}" for page in sorted((ROOT / "doc").glob("*.md")))]
NOT_RUN = re.compile(r"<!-- not run: .+ -->")
NO_COMMANDS = ("cmake", "cpp", "text")  # tools/test.sh compiles C++


def find_blocks(page):
    """The language, the line and the code of each block that runs."""
    tokens = MarkdownIt().parse((ROOT / page).read_text(encoding="utf-8"))
    for before, token in pairwise(tokens):
        language = "sh" if token.type == "code_block" else token.info
        if token.type in ("code_block", "fence") and not NOT_RUN.match(before.content):
            assert language in ("python", "sh", *NO_COMMANDS) or language.startswith("{"), f"{page}: {language!r}"
            if language in ("python", "sh"):
                yield language, token.map[0] + (token.type == "fence"), token.content


def run_commands(code, place):
    path = os.pathsep.join([str(Path(PROGRAM).parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    command = ["bash", "-e", "-c", code]
    environment = {**os.environ, "PATH": path}
    outcome = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment, check=False)
    assert outcome.returncode == 0, f"{place}: {outcome.stderr}"


@pytest.mark.skipif(not shutil.which("ffmpeg") or os.name == "nt", reason="needs ffmpeg and bash")
@pytest.mark.parametrize("page", [page for page in PAGES if list(find_blocks(page))])
def test_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("apps", "benchmark", "doc", "examples"):
        Path(name).symlink_to(ROOT / name)
    if page == "doc/modes.md":  # says that it needs this file; here it is another one
        run_commands("python3 apps/test/make_study.py .study && cp .study/*/*/SE000002/IM000000 head.dcm", page)
    show = partial(itk_shearwarpmip.show, canvas=RenderCanvas(size=(640, 480)))
    monkeypatch.setattr(itk_shearwarpmip, "show", show, raising=False)
    names = {"__name__": "__main__"}
    for language, line, code in find_blocks(page):
        if language == "sh":
            run_commands(code, f"{page}:{line + 1}")
            continue
        try:
            exec(compile("\n" * line + code, ROOT / page, "exec"), names)
        except ModuleNotFoundError as error:
            if error.name != "torch":
                raise
            pytest.skip(f"from line {line + 1} on: {error}")

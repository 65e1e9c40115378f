"""How Sphinx makes the pages; tools/docs.sh runs it."""

import tomllib
from pathlib import Path

project = "ShearWarpMIP"
release = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
myst_update_mathjax = False
exclude_patterns = ["cpp.md"]

html_theme = "furo"
html_title = f"ShearWarpMIP {release}"
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
mathjax_path = "mathjax/MathJax.js"  # which tools/docs.sh copies
mathjax2_config = {
    "jax": ["input/TeX", "output/SVG"],
    "extensions": ["tex2jax.js"],
    "tex2jax": {"processClass": "math"},
    "TeX": {"extensions": ["AMSmath.js", "AMSsymbols.js"]},
    "messageStyle": "none",
    "showMathMenu": False,
}

"""The canvas of the viewer in notebooks."""

from importlib.resources import files
from typing import Any

try:
    from rendercanvas import anywidget
except ImportError as error:
    raise ImportError("the viewer in a notebook needs anywidget: install the wheel with its extra [viewer]") from error

from itk_shearwarpmip._canvas import AtOnce


class _Canvas(AtOnce, anywidget.RenderCanvas):  # type: ignore[misc]
    _esm = anywidget.JS + files(__package__).joinpath("_viewer.js").read_text("utf-8")


def make_canvas(size: tuple[int, int]) -> Any:
    return _Canvas(size=size)

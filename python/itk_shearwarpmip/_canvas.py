"""What the canvases of pages and notebooks share."""

import contextlib
from collections.abc import Callable
from typing import Any


class AtOnce:
    """For a canvas of rendercanvas: handles events when they come, and draws pictures when they are made, not at the
    next tick of the canvas's clock."""

    _rc_canvas_group: Any

    def submit_event(self, event: dict[str, Any]) -> None:
        self._events.emit(event)  # type: ignore[attr-defined]

    def request_draw(self, *function: Callable[[], None]) -> None:
        super().request_draw(*function)  # type: ignore[misc]
        call, draw = self._rc_canvas_group.get_loop().call_soon_threadsafe, self._rc_request_draw  # type: ignore[attr-defined]
        # before the loop runs and after its end the clock does it
        with contextlib.suppress(AttributeError, RuntimeError):
            call(draw)

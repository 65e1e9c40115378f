"""The viewer: show() in notebooks and browsers."""

import logging
import os
import shlex
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from typing import Any

import itk
import numpy as np

try:
    import rendercanvas  # noqa: F401

    from itk_shearwarpmip import _scene
except ImportError as error:
    raise ImportError("the viewer needs rendercanvas and Pillow: install the wheel with its extra [viewer]") from error

from itk_shearwarpmip._front import Place, require_known
from itk_shearwarpmip._inputs import get_shape, is_chunked, is_plain_array, make_flag, make_numbers, open_image
from itk_shearwarpmip._parameters import MODES, check_mode
from itk_shearwarpmip._scene import Layer, Point, Scene, State, Window
from itk_shearwarpmip._views import SIDES
from itk_shearwarpmip._window import check_window

_LOGGER = logging.getLogger(__name__)

_REST_SECONDS = 0.12
"""Without a movement, until the full picture is made."""
_FRAME_SECONDS = 1 / 30
_TURN_SECONDS = 8.0
_CLICK_PIXELS = 3
_DOUBLE_CLICK_SECONDS = 0.4
_CANVAS_SECONDS = 0.25
"""How long a canvas may keep a frame before the next is made all the same."""


@dataclass
class _Drag:
    kind: str
    x: float
    y: float
    moved: float = 0.0


class Viewer:
    """A volume on a canvas, turned by mouse, fingers and keys. show() makes it.

    point: the Point of the last click, or None: position (x, y, z in LPS, mm), index (i, j, k), value, overlay.
    canvas: the canvas of rendercanvas.
    """

    # a mistyped name is an error
    __slots__ = (
        "__weakref__", "_callbacks", "_changed", "_clicked", "_closed", "_code", "_context", "_drag", "_end", "_factor",
        "_frame", "_framed_at", "_is_shown", "_jobs", "_made", "_moved_at", "_path", "_played_from", "_resets", "_scene",
        "_source", "_state", "_windowed", "_worker", "canvas", "turns_about_axis", "url",
    )  # fmt: skip

    def __init__(
        self, scene: Scene, canvas: Any, *, source: str = "image", path: str | None = None, code: str = ""
    ) -> None:
        """source, code: Python code of the volume and of the parameters; path: the file for the program."""
        self.canvas = canvas
        self.url: str | None = None
        self.turns_about_axis = True
        self._scene = scene
        self._state = scene.first
        self._source = source
        self._path = path
        self._code = code
        self._changed = threading.Condition()
        self._worker: threading.Thread | None = None
        self._jobs: deque[Callable[[], None]] = deque()
        self._made: tuple[State | None, tuple[int, int], bool] = None, (0, 0), False
        self._moved_at = 0.0
        self._factor = 1
        self._frame: Any = None
        self._framed_at = 0.0
        self._is_shown = True
        self._played_from: tuple[float, State] | None = None
        self._drag: _Drag | None = None
        self._clicked = (0.0, 0.0, 0.0)
        self._resets = 0
        self._windowed = 0
        self._callbacks: list[Callable[[Point], object]] = []
        self._end: Callable[[], None] = canvas.close
        self._closed = False
        self._context = canvas.get_bitmap_context()
        canvas.add_event_handler(self._handle, "*")
        canvas.request_draw(self._draw)

    # ---- What scripts use

    @property
    def transform(self) -> Any:
        """The itk.AffineTransform from view space to the patient's space. Set it to a name of a side, a linear itk
        transform or a 4 x 4 matrix; ValueError for anything else."""
        return self._state.transform

    @transform.setter
    def transform(self, view: Any) -> None:
        made = _scene.make_view(self._image, view)
        self._stop()
        self._change(transform=made)

    @property
    def window(self) -> Window:
        """The values that are black and white, (low, high). Set it to None for the window of the present view, mode
        and slab."""
        return self._scene.get_window(self._state, 0)

    @window.setter
    def window(self, window: Window | None) -> None:
        self._set_window(0, window)

    @property
    def overlay_window(self) -> Window:
        """The window of the second volume. Raises ValueError if there is none."""
        self._require_overlay()
        return self._scene.get_window(self._state, 1)

    @overlay_window.setter
    def overlay_window(self, window: Window | None) -> None:
        self._require_overlay()
        self._set_window(1, window)

    @property
    def point(self) -> Point | None:
        return self._state.point

    @property
    def mode(self) -> str:
        """The value of a ray: "maximum", "minimum", "absolute_maximum" or "mean"."""
        return self._state.mode

    @mode.setter
    def mode(self, mode: str) -> None:
        mode = check_mode(mode)
        if mode not in self._find_modes():
            raise ValueError(f"mode {mode!r} is not possible with the viewer's other parameters, such as local_maximum")
        self._change(mode=mode)

    @property
    def slab(self) -> tuple[float, float] | None:
        """The least and the greatest depth of the samples that count, in mm, or None."""
        return self._state.slab

    @slab.setter
    def slab(self, slab: Sequence[float] | None) -> None:
        self._change(slab=_make_slab(slab))

    def on_pick(self, callback: Callable[[Point], object]) -> Callable[[Point], object]:
        """Calls callback(point) for each clicked point from now on. Returns the callback, so it can be a decorator."""
        if not callable(callback):
            raise TypeError(f"on_pick needs a function, but this is {callback!r}")
        self._callbacks.append(callback)
        return callback

    def pick(self, x: float, y: float) -> Point | None:
        """Returns the point at a pixel of the canvas, counted from the upper left corner, or None if there is none. It
        becomes viewer.point. Raises ValueError for an unsuitable place."""
        point = self._find_point(self._state, *make_numbers("place", (x, y), 2))
        self._change(point=point)
        return point

    def snapshot(self, path: str | os.PathLike[str] | None = None, *, text: bool = True) -> np.ndarray[Any, Any]:
        """Returns the picture at rest, as the canvas shows it: uint8, rows x columns x 4, RGBA. If path is given, such
        as "x.png", writes it to an image file. If text is false, the picture has no letters and numbers. Raises
        OSError if the file cannot be written, and ValueError for another extension."""
        state = replace(self._state, has_text=text and self._state.has_text, has_help=False, message="")
        rgba = self._scene.paint(state, self._size, ratio=self._ratio)
        if path is not None:
            from PIL import Image

            Image.fromarray(rgba).convert("RGB").save(path)
        return rgba

    def project(self) -> Any:
        """Returns the values of the picture at rest: a 2D itk.Image, in mm of the view plane, or with an overlay a
        list of two."""
        pictures = self._scene.project(self._state, self._scene.make_grid(self._state, self._size))
        return pictures if len(pictures) > 1 else pictures[0]

    def refresh(self) -> None:
        """Makes the picture again after voxels were changed in memory."""
        self._scene.refresh()
        self._change(True)

    @property
    def code(self) -> str:
        """The line of Python that makes this picture's values; a comment at its end has the window."""
        grid = self._scene.make_grid(self._state, self._size)
        arguments = [self._source]
        arguments += [f"{name}={each!r}" for name, each in self._name_view().items()]
        if self._state.mode != "maximum":
            arguments.append(f"mode={self._state.mode!r}")
        if self._state.slab:
            arguments.append(f"slab={_write(self._state.slab)}")
        arguments += [self._code] if self._code else []
        arguments += [f"size={grid.size}", f"output_spacing={grid.spacing!r}", f"output_origin={grid.origin}"]
        return f"mip({', '.join(arguments)})  # window {' to '.join(f'{each:g}' for each in self.window)}"

    @property
    def command(self) -> str:
        """The command of the program that makes this picture. Raises ValueError if the command needs a file of the
        transform, because the picture is rolled or moved, or if the image does not come from a file."""
        view = self._name_view()
        if isinstance(view.get("view"), list) or self._state.pan != (0.0, 0.0) or self._path is None or self._code:
            raise ValueError("no command alone makes this picture")
        grid = self._scene.make_grid(self._state, self._size)
        words = ["shear-warp-mip", shlex.quote(self._path), "mip.png"]
        words += [f"--{name} {each}" for name, each in view.items()]
        if self._state.mode != "maximum":
            words.append(f"--mode {self._state.mode.replace('_', '-')}")
        if self._state.slab:
            words.append("--slab {!r} {!r}".format(*self._state.slab))
        words.append("--size {} {}".format(*grid.size))
        words.append(f"--output-spacing {grid.spacing!r}")
        words.append("--window {!r} {!r}".format(*self.window))
        return " ".join(words)

    def close(self) -> None:
        """Ends the viewer and frees its memory. Its page or widget no longer turns."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            worker = self._worker
            self._changed.notify_all()
        self._scene.abort()
        # Python must not end while it is in the filter
        if worker is not None and worker is not threading.current_thread():
            worker.join(10)
        self._end()

    def _repr_mimebundle_(self, **options: Any) -> Any:
        show_widget = getattr(self.canvas, "_repr_mimebundle_", None)
        return show_widget(**options) if show_widget else {"text/plain": repr(self)}

    def __repr__(self) -> str:
        return f"<Viewer of {self._source}{f' at {self.url}' if self.url else ''}>"

    # ---- State

    @property
    def _image(self) -> Any:
        return self._scene.layers[0].image

    @property
    def _size(self) -> tuple[int, int]:
        columns, rows = self.canvas.get_physical_size()
        # before anyone has looked
        return (int(columns), int(rows)) if min(columns, rows) > 1 else (640, 480)

    @property
    def _ratio(self) -> float:
        return float(self.canvas.get_pixel_ratio())

    def _require_overlay(self) -> None:
        if len(self._scene.layers) < 2:
            raise ValueError("there is no second volume: show(image, overlay=...)")

    def _set_window(self, layer: int, window: Sequence[float] | None) -> None:
        windows = {key: each for key, each in self._state.windows.items() if key != (layer, self._state.mode)}
        found = self._scene.find_window(self._state, layer) if window is None else check_window(window)
        windows[layer, self._state.mode] = found
        self._change(windows=windows)

    def _change(self, at_rest: bool = False, **changes: Any) -> None:
        """Sets the next state. Unfinished pictures of the state before are dropped."""
        with self._changed:
            self._state = replace(self._state, **{"message": "", **changes})
            self._moved_at = -np.inf if at_rest else time.monotonic()
            self._wake()
        if self._scene.exact:
            self._scene.abort()

    def _rest(self) -> None:
        """Makes the full picture due now."""
        with self._changed:
            self._moved_at = -np.inf
            self._wake()

    def _wake(self) -> None:
        """Wakes the thread of pictures. The caller holds the lock."""
        self._changed.notify_all()
        if self._worker is None and not self._closed:
            self._worker = threading.Thread(target=self._work, name="shear-warp-mip viewer", daemon=True)
            self._worker.start()

    # ---- Pictures, by a thread that ends when the picture is at rest

    def _work(self) -> None:
        while True:
            with self._changed:
                task = self._find_task()
                state = self._state
                if task is None:
                    self._worker = None
                    self._changed.notify_all()
                    return
            try:
                task()
            except Exception:
                with self._changed:
                    # or else it was ended for a newer one
                    if self._state is state and not self._closed:
                        _LOGGER.exception("the picture cannot be made")
                        # no older picture stands for it
                        self._frame, self._is_shown = None, False
                        self._made = (state, self._size, True)
                        self.canvas.request_draw()

    def _find_task(self) -> Callable[[], None] | None:
        """Waits for the next task, and returns it, or None if there is none. The caller holds the lock."""
        while not self._closed:
            if self._jobs:
                return self._jobs.popleft()
            state, size = self._state, self._size
            now = time.monotonic()
            rest = np.inf if self._played_from is not None else self._moved_at + _REST_SECONDS
            is_full = now >= rest
            is_new = self._made[:2] != (state, size)
            if is_full and (is_new or not self._made[2]):
                return lambda: self._make(state, size, True)
            # the canvas has taken the last frame, or takes none
            can_make = self._is_shown or now - self._framed_at > _CANVAS_SECONDS
            if not is_full and (is_new or self._played_from is not None) and can_make:
                return lambda: self._make(self._play(state), size, False)
            if is_full and not is_new:
                return None
            self._changed.wait(min(rest - now if not is_full else _REST_SECONDS, _CANVAS_SECONDS))
        return None

    def _play(self, state: State) -> State:
        with self._changed:
            if self._played_from is None:
                return state
            start, first = self._played_from
            angle = 360 * (time.monotonic() - start) / _TURN_SECONDS
            self._state = replace(self._state, transform=self._turn(first.transform, -angle, 0))
            return self._state

    def _make(self, state: State, size: tuple[int, int], is_full: bool) -> None:
        start = time.perf_counter()
        factor = 1 if is_full else self._factor
        frame = self._scene.paint(state, size, factor=factor, ratio=self._ratio, may_abort=True)
        seconds = time.perf_counter() - start
        if not is_full:
            if seconds > _FRAME_SECONDS and self._scene.paint_seconds > seconds / 3:
                self._factor = min(factor + 1, 4)
            elif seconds < _FRAME_SECONDS / 3:
                self._factor = max(factor - 1, 1)
        with self._changed:
            self._frame = frame
            self._is_shown = False
            self._framed_at = time.monotonic()
            self._made = (state, size, is_full or (factor == 1 and not self._scene.exact))
        self.canvas.request_draw()

    def _draw(self) -> None:
        with self._changed:
            frame = self._frame
            if not self._is_shown:
                self._is_shown = True
                self._changed.notify_all()
            if self._made[1] != self._size:
                self._wake()
        columns, rows = self._size
        self._context.set_bitmap(np.zeros((rows, columns, 4), np.uint8) if frame is None else frame)

    def _settle(self, seconds: float = 30.0) -> None:
        """Waits until the picture at rest is made."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._worker is None, seconds):
                raise TimeoutError("the picture does not come to rest")

    # ---- Gestures and keys

    def _handle(self, event: dict[str, Any]) -> None:
        handler = getattr(self, f"_on_{event['event_type']}", None)
        # on no screen, or not a number
        is_wrong = not all(abs(event.get(name, 0)) <= 1e6 for name in ("x", "y", "dy"))
        if handler is not None and not self._closed and not is_wrong:
            handler(event)

    def _on_close(self, event: dict[str, Any]) -> None:
        self.close()

    def _on_resize(self, event: dict[str, Any]) -> None:
        with self._changed:
            self._wake()

    def _on_pointer_down(self, event: dict[str, Any]) -> None:
        self._stop()
        kinds = {1: "pan" if "Shift" in event["modifiers"] else "turn", 2: "window", 3: "pan"}
        kind = kinds.get(event["button"])
        self._drag = _Drag(kind, event["x"], event["y"]) if kind else None

    def _on_pointer_move(self, event: dict[str, Any]) -> None:
        drag = self._drag
        if drag is None:
            return
        # of a page that went away in the middle
        if not event.get("buttons", True):
            self._drag = None
            self._rest()
            return
        right, down = event["x"] - drag.x, event["y"] - drag.y
        drag.moved += abs(right) + abs(down)
        if drag.moved <= _CLICK_PIXELS:
            return
        drag.x, drag.y = event["x"], event["y"]
        if drag.kind == "turn":
            degrees = 180 * self._ratio / min(self._size)
            self._change(transform=self._turn(self._state.transform, degrees * right, degrees * down))
        elif drag.kind == "pan":
            self._pan(right, down)
        else:
            self._move_window(right, down)

    def _on_pointer_up(self, event: dict[str, Any]) -> None:
        drag, self._drag = self._drag, None
        if drag is None:
            return
        if drag.moved > _CLICK_PIXELS:
            self._rest()
        elif drag.kind == "turn":
            now, (time_before, x, y) = time.monotonic(), self._clicked
            self._clicked = now, drag.x, drag.y
            is_second = now - time_before < _DOUBLE_CLICK_SECONDS and abs(drag.x - x) + abs(drag.y - y) <= _CLICK_PIXELS
            if not is_second:
                with self._changed:
                    place = drag.x * self._ratio, drag.y * self._ratio
                    self._jobs.append(partial(self._click, self._state, self._resets, place))
                    self._wake()

    def _on_double_click(self, event: dict[str, Any]) -> None:
        self._stop()
        self._resets += 1
        kept = {name: getattr(self._state, name) for name in ("has_text", "has_help")}
        self._change(True, **{**vars(self._scene.first), **kept})

    def _on_wheel(self, event: dict[str, Any]) -> None:
        """Keeps the point under the pointer where it is."""
        state = self._state
        factor = float(2.0 ** np.clip(-event["dy"] / 300, -10, 10))
        zoom = float(np.clip(state.zoom * factor, 0.1, 100))
        before, after = (self._scene.make_grid(replace(state, zoom=each), self._size) for each in (state.zoom, zoom))
        pan = [
            middle + (place * self._ratio - (length - 1) / 2) * (before.spacing - after.spacing)
            for middle, place, length in zip(state.pan, (event["x"], event["y"]), self._size)
        ]
        self._change(zoom=zoom, pan=(pan[0], pan[1]))

    def _find_modes(self) -> list[str]:
        possible = [mode for mode in MODES if all(mode in layer.modes for layer in self._scene.layers)]
        return [mode for mode in possible if not (mode == "mean" and self._scene.exact)]

    def _change_mode(self) -> None:
        modes = self._find_modes()
        self._change(True, mode=modes[(modes.index(self._state.mode) + 1) % len(modes)])

    def _on_key_down(self, event: dict[str, Any]) -> None:
        if set(event["modifiers"]) & {"Control", "Alt", "Meta"}:
            return
        key = event["key"]
        lower = key.lower()
        views = {view[0]: view for view in SIDES}
        steps = {"ArrowLeft": (-5, 0), "ArrowRight": (5, 0), "ArrowUp": (0, -5), "ArrowDown": (0, 5)}
        actions: dict[str, Callable[[], None]] = {
            " ": self._toggle_play,
            "m": self._change_mode,
            "+": lambda: self._resize_slab(1.25),
            "=": lambda: self._resize_slab(1.25),
            "-": lambda: self._resize_slab(0.8),
            "[": lambda: self._move_slab(-1),
            "]": lambda: self._move_slab(1),
            "t": self._toggle_trackball,
            "o": self._toggle_windowed,
            "v": lambda: self._change(True, has_text=not self._state.has_text),
            "c": lambda: self._copy("Shift" in event["modifiers"] or key == "C"),
            "?": lambda: self._change(True, has_help=not self._state.has_help, has_text=True),
            "escape": lambda: self._change(True, has_help=False, point=None),
        }
        if lower in views:
            self._stop()
            self._change(True, transform=_scene.make_view(self._image, views[lower]))
        elif key in steps:
            self._stop()
            self._change(True, transform=self._turn(self._state.transform, *steps[key]))
        elif lower in actions:
            actions[lower]()

    def _turn(self, transform: Any, right: float, down: float) -> Any:
        """Turns the volume: its front moves by degrees to the right and down."""
        if not (right or down):
            return transform
        turn = itk.ShearWarpMIPView.Turn
        center = self._scene.center.tolist()
        u, v, _ = _scene.get_axes(transform).T
        hand = _scene.find_hand(transform)
        if not self.turns_about_axis:
            axis = right * v - down * u
            return turn(transform, axis.tolist(), center, hand * float(np.hypot(right, down)))
        azimuth, elevation, _ = _scene.find_angles(transform)
        named = _scene.make_view(self._image, "anterior", azimuth, elevation)
        if _is_same(transform, named, 1e-6):
            # angles that can be written down, and are kept bit by bit
            azimuth = round((azimuth - right + 180) % 360 - 180, 3)
            elevation = round(float(np.clip(elevation + down, -90, 90)), 3)
            return _scene.make_view(self._image, "anterior", azimuth, elevation)
        down = float(np.clip(elevation + down, -90, 90)) - elevation
        transform = turn(transform, [0.0, 0.0, 1.0], center, -hand * right)
        return turn(transform, u.tolist(), center, -hand * down)

    def _pan(self, right: float, down: float) -> None:
        state = self._state
        spacing = self._scene.make_grid(state, self._size).spacing * self._ratio
        self._change(pan=(state.pan[0] - right * spacing, state.pan[1] - down * spacing))

    def _move_window(self, right: float, down: float) -> None:
        low, high = self._scene.get_window(self._state, self._windowed)
        level = (low + high) / 2 + down / 300 * (high - low)
        width = max((high - low) * 2.0 ** float(np.clip(right / 150, -10, 10)), 1e-6 * max(abs(low), abs(high), 1e-300))
        self._set_window(self._windowed, (level - width / 2, level + width / 2))

    def _resize_slab(self, factor: float) -> None:
        reach = float(np.linalg.norm(self._scene.extent, axis=1).max())
        near, far = self._state.slab or (-reach, reach)
        middle, thickness = (near + far) / 2, (far - near) * factor
        half = max(thickness, min(self._image.GetSpacing())) / 2
        self._change(True, slab=(middle - half, middle + half) if half < reach else None)

    def _move_slab(self, steps: float) -> None:
        if self._state.slab is None:
            self._change(True, message="There is no slab: press - for one")
            return
        near, far = self._state.slab
        step = steps * (far - near) / 4
        self._change(True, slab=(near + step, far + step))

    def _toggle_play(self) -> None:
        if self._played_from is not None:
            self._stop()
            return
        with self._changed:
            self._state = replace(self._state, message="")
            self._played_from = time.monotonic(), self._state
            self._wake()

    def _stop(self) -> None:
        with self._changed:
            if self._played_from is not None:
                self._played_from = None
                self._rest()

    def _toggle_trackball(self) -> None:
        self.turns_about_axis = not self.turns_about_axis
        message = "Turning about the long axis" if self.turns_about_axis else "Turning as a trackball"
        self._change(True, message=message)

    def _toggle_windowed(self) -> None:
        if len(self._scene.layers) < 2:
            self._change(True, message="There is no overlay")
            return
        self._windowed = 1 - self._windowed
        self._change(True, message=f"The right button sets the window of the {('volume', 'overlay')[self._windowed]}")

    def _copy(self, is_command: bool) -> None:
        try:
            line = self.command if is_command else self.code
        except ValueError as error:
            self._change(True, message=str(error).capitalize())
            return
        print(line, flush=True)
        # to the scripts of the page or of the notebook
        if hasattr(self.canvas, "send"):
            self.canvas.send({"type": "copy", "text": line})
        self._change(True, message="The command is copied" if is_command else "The line of Python is copied")

    def _find_point(self, state: State, x: float, y: float) -> Point | None:
        grid = self._scene.make_grid(state, self._size)
        u, v = (first + int(place) * grid.spacing for first, place in zip(grid.origin, (x, y)))
        return self._scene.find_point(state, u, v)

    def _click(self, state: State, resets: int, place: tuple[float, float]) -> None:
        point = self._find_point(state, *place)
        with self._changed:
            if resets != self._resets:
                return
            self._change(True, point=point)
        if point is not None:
            for callback in self._callbacks:
                try:
                    callback(point)
                except Exception:
                    _LOGGER.exception("on_pick failed")

    def _name_view(self) -> dict[str, Any]:
        """Arguments for the view: a side and angles if they make the same bits, otherwise the matrix."""
        transform = self._state.transform
        for view in SIDES:
            if _is_same(transform, _scene.make_view(self._image, view), 0):
                return {"view": view}
        azimuth, elevation, _ = _scene.find_angles(transform)
        if _is_same(transform, _scene.make_view(self._image, "anterior", azimuth, elevation), 0):
            return {name: angle for name, angle in (("azimuth", azimuth), ("elevation", elevation)) if angle}
        return {"view": _scene.get_matrix(transform).tolist()}


def _is_same(one: Any, other: Any, tolerance: float) -> bool:
    return bool(np.abs(_scene.get_matrix(one) - _scene.get_matrix(other)).max() <= tolerance)


def _write(value: Any) -> str:
    """Python code of numbers, texts, and containers of numbers or texts; nothing for other objects."""
    if isinstance(value, float) and not np.isfinite(value):
        return f"float('{value}')"
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str | int | float):
        return repr(value)
    if isinstance(value, np.ndarray | np.generic) and value.size <= 16:
        return _write(value.tolist())
    parts = [_write(each) for each in value] if isinstance(value, list | tuple) else []
    return f"[{', '.join(parts)}]" if parts and all(parts) else ""


def _write_arguments(arguments: Mapping[str, Any]) -> list[str]:
    return [f"{key}={_write(each) or key}" for key, each in arguments.items() if each is not None]


def _make_slab(slab: Sequence[float] | None) -> tuple[float, float] | None:
    if slab is None:
        return None
    near, far = make_numbers("slab", slab, 2, is_finite=False, parts="(near, far)")
    if not -np.inf < far >= near < np.inf:
        raise ValueError(f"slab must be (near, far) in mm with near <= far, but it is {slab!r}")
    return near, far


# ---- show()


def show(
    source: Any,
    *,
    overlay: Any = None,
    view: Any = "anterior",
    azimuth: float = 0.0,
    elevation: float = 0.0,
    window: Sequence[float] | None = None,
    overlay_window: Sequence[float] | None = None,
    colour: str = "grey",
    overlay_colour: str = "hot",
    opacity: float = 1.0,
    mode: str = "maximum",
    slab: Sequence[float] | None = None,
    exact: bool = False,
    title: str = "",
    size: tuple[int, int] = (640, 480),
    canvas: Any = None,
    block: bool | None = None,
    page: Mapping[str, Any] | None = None,
    **parameters: Any,
) -> Viewer:
    """Shows the maximum intensity projection (MIP) of a volume, which turns with the mouse.

    A notebook shows the returned Viewer. Elsewhere a page opens in the browser, served on this computer only.

    source: a volume in memory or a path: see open_image().
    overlay: a second volume in the same physical space, on any grid, in colours over the first. An array must have the
        first volume's shape, and takes its geometry.
    view, azimuth, elevation: the first view: a side's name and degrees, a linear itk transform from view space to the
        patient, or a 4 x 4 matrix.
    window, overlay_window: values that are black and white, (low, high); by default percentiles 1 and 99.8 of the first
        picture.
    colour, overlay_colour: ITK's colour maps, such as "grey", "hot", "red", "jet".
    opacity: opacity of the overlay's highest value, 0 to 1; lower values are less opaque in proportion.
    mode: "maximum", "minimum", "absolute_maximum" or "mean".
    slab: the least and the greatest depth of the samples that count, in mm behind the middle of the image.
    exact: True to make the picture at rest by exact maxima.
    title: a text in the picture, ASCII. By default none, because the name of a file is often a patient's.
    size: columns and rows of the widget in a notebook, in CSS pixels.
    canvas: a canvas of rendercanvas to show the picture on, instead of a page or widget.
    block: whether to return only when the viewer is closed or interrupted; by default only in scripts, not in
        notebooks and interactive shells.
    page: host, port and no_browser of the page, as for the command shear-warp-mip-view.
    parameters: interpolation, crop, mask, mask_label, attenuation, local_maximum, oversampling and background, as in
        mip(); spacing, origin, direction, series, volume, suv, level, time and channel of the source, as in open_image().

    Raises ImportError if rendercanvas or a part of it is missing, ValueError and TypeError for unsuitable parameters,
    and the exceptions of reading the source.

    >>> from rendercanvas.offscreen import RenderCanvas
    >>> volume = np.zeros((10, 20, 30), np.uint8)
    >>> volume[5, 3, 7] = 200
    >>> viewer = show(volume, view="superior", canvas=RenderCanvas(size=(320, 240)))
    >>> viewer.window = (0, 400)
    >>> viewer.snapshot().shape
    (240, 320, 4)
    >>> viewer.transform = "left"
    >>> viewer.close()
    """
    mode = check_mode(mode)
    if block is not None:
        make_flag("block", block)
    if overlay is None and overlay_window is not None:
        raise ValueError("overlay_window is for an overlay")
    if not isinstance(opacity, Real) or not 0 <= opacity <= 1:
        raise ValueError(f"opacity must be 0 to 1, but it is {opacity!r}")
    place: dict[str, Any] = {key: parameters.pop(key) for key in Place.__annotations__ if key in parameters}
    known = {
        "interpolation", "crop", "mask", "mask_label", "attenuation", "local_maximum", "oversampling", "background",
    }  # fmt: skip
    require_known(show, parameters, known)
    if not isinstance(title, str):
        raise TypeError(f"title must be a text, but it is {title!r}")
    if canvas is not None and not hasattr(canvas, "get_bitmap_context"):
        raise TypeError(f"canvas must be one of rendercanvas, but it is {canvas!r}")
    if not isinstance(page, Mapping | None) or set(page or ()) - {"host", "port", "no_browser"}:
        raise TypeError(f"page must be a dictionary of host, port and no_browser, but it is {page!r}")
    if min(make_numbers("size", size, 2, is_whole=True)) < 1:
        raise ValueError(f"size must be positive, but it is {size!r}")
    image = open_image(source, **place)
    layers = [Layer(image, colour=colour, **parameters)]
    if overlay is not None:
        shared = {
            key: each
            for key, each in parameters.items()
            if key not in ("interpolation", "mask", "mask_label", "background", "local_maximum")
        }
        layers.append(Layer(_open_overlay(overlay, image), colour=overlay_colour, **shared))
    path = os.fspath(source) if isinstance(source, str | os.PathLike) else None
    windows = {(n, mode): check_window(each) for n, each in enumerate((window, overlay_window)) if each is not None}
    state = State(_scene.make_view(image, view, azimuth, elevation), mode=mode, slab=_make_slab(slab), windows=windows)
    for layer in layers:
        layer.check(state, exact)
    scene = Scene(layers, state, title=title, opacity=opacity, exact=exact)
    expression, written = repr(path) if path else "image", {**parameters, **({"exact": True} if exact else {})}
    if is_chunked(source):
        # of which mip() has no slabs and modes
        path, expression = None, f"open_image({', '.join([expression, *_write_arguments(place)])})"
    else:
        written = {**place, **written}
    make = partial(Viewer, scene, source=expression, path=path, code=", ".join(_write_arguments(written)))

    if canvas is not None:
        return make(canvas)
    if page is None and _is_notebook():
        from itk_shearwarpmip._notebook import make_canvas

        return make(make_canvas(size))
    from itk_shearwarpmip import _server

    return _server.serve(
        make, block=not hasattr(sys, "ps1") and not sys.flags.interactive if block is None else block, **(page or {})
    )


def _open_overlay(overlay: Any, image: Any) -> Any:
    try:
        opened = open_image(overlay)
    except (TypeError, ValueError) as error:
        raise type(error)(f"overlay: {error}") from None
    if not is_plain_array(overlay):
        return opened
    if get_shape(opened) != get_shape(image):
        raise ValueError(
            f"an overlay that is an array must have the shape of the volume, {get_shape(image)}, but it has "
            f"{get_shape(opened)}: "
            "give overlay=open_image(array, spacing=..., origin=..., direction=...)"
        )
    opened.SetRegions(image.GetLargestPossibleRegion())
    opened.CopyInformation(image)
    return opened


def _is_notebook() -> bool:
    """Whether this runs in Jupyter or a similar notebook, such as VS Code, Colab or marimo."""
    if "marimo" in sys.modules and sys.modules["marimo"].running_in_notebook():
        return True
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and getattr(shell, "kernel", None) is not None

"""The contents of the viewer without its canvas: volumes, the state of their display, and its picture."""

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import itk
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from itk_shearwarpmip import _entries, _labels
from itk_shearwarpmip._front import open_mask
from itk_shearwarpmip._inputs import find_millimetres
from itk_shearwarpmip._labels import LETTERS, find_letters, format_length, normalize, round_length, widen
from itk_shearwarpmip._labels import get_matrix as get_matrix
from itk_shearwarpmip._parameters import MODES, Parameters, find_lowest, set_parameters, update
from itk_shearwarpmip._views import SIDES, make_transform
from itk_shearwarpmip._window import find_window_of, make_grey

COLOURS = {
    name.partition("_")[2].lower(): getattr(itk.ScalarToRGBColormapImageFilterEnums, name)
    for name in dir(itk.ScalarToRGBColormapImageFilterEnums)
    if name.startswith("RGBColormapFilter_")
}
"""ITK's colour maps."""

Array = np.ndarray[Any, Any]
Window = tuple[float, float]
Pair = tuple[float, float]

_TEXT, _QUIET, _ACCENT = "#d5dae0", "#8f99a5", "#7cb3e8"


@dataclass(frozen=True, eq=False)
class State:
    """Everything that a picture depends on, except the volumes and the size of the canvas. A state never changes."""

    transform: Any
    """An itk.Transform, from view space to the patient."""
    zoom: float = 1.0
    pan: Pair = (0.0, 0.0)
    """The point of the view plane in the middle of the picture, in mm."""
    mode: str = "maximum"
    slab: Pair | None = None
    """Nearest and farthest depth, in mm."""
    windows: dict[tuple[int, str], Window] = field(default_factory=dict)
    """The window of a volume in a mode. If there is none, the layer finds one."""
    point: "Point | None" = None
    message: str = ""
    has_text: bool = True
    has_help: bool = False


@dataclass(frozen=True)
class Point:
    """The point of a ray that gives the pixel its value.

    position: x, y, z in the patient's space, LPS, in mm.
    index: index of the nearest voxel, i, j, k.
    value: value of the picture there.
    overlay: the point in the second volume, or None if the ray meets none.
    """

    position: tuple[float, float, float]
    index: tuple[int, int, int]
    value: float
    overlay: "Point | None" = None


@dataclass(frozen=True)
class Grid:
    """The pixels of a picture: columns and rows; mm per pixel; u, v of the first pixel's center."""

    size: tuple[int, int]
    spacing: float
    origin: Pair

    def coarsen(self, factor: int) -> "Grid":
        """Returns a grid that covers this one, whose pixels have factor x factor pixels of this one."""
        columns, rows = (-(-length // factor) for length in self.size)
        u, v = (first + (factor - 1) / 2 * self.spacing for first in self.origin)
        return Grid((columns, rows), self.spacing * factor, (u, v))


class Layer:
    """A volume, its filter and its colours."""

    def __init__(self, image: Any, *, colour: str = "grey", background: Any = "auto", **parameters: Any) -> None:
        if not isinstance(colour, str) or colour not in COLOURS:
            raise ValueError(f"colour must be one of {', '.join(COLOURS)}, but it is {colour!r}")
        self.image = image
        self.colours = _make_colours(colour)
        self.filter = itk.ShearWarpMIPImageFilter.New(image)
        given = Parameters(**parameters)
        self._is_auto = isinstance(background, str) and background == "auto"
        if self._is_auto:
            background = self._find_background()
        set_parameters(self.filter, given, background)
        self._mask = None if given.mask is None else open_mask(given.mask, given.mask_label, image)
        self.filter.SetMaskImage(self._mask)
        self.modes = [mode for mode in MODES if self._allows(mode)]
        self.windows: dict[str, Window] = {}
        self._table: tuple[Window, Array] | None = None

    def _find_background(self) -> Any:
        return find_lowest(itk.array_view_from_image(self.image))

    def _allows(self, mode: str) -> bool:
        """Whether the layer's parameters can be combined with a mode."""
        self.filter.SetMode(getattr(itk.ShearWarpMIPImageFilterEnums, MODES[mode]))
        try:
            update(self.filter, information=True)
        except ValueError:
            return False
        return True

    def check(self, state: State, exact: bool) -> None:
        """Raises ValueError for a state that cannot be projected."""
        self._set(state, exact)
        update(self.filter, information=True)

    def refresh(self) -> None:
        """Takes the present values of the image."""
        self.image.Modified()
        if self._is_auto:
            self.filter.SetDefaultPixelValue(self._find_background())
        self.windows.clear()

    def project(self, state: State, grid: Grid | None, exact: bool = False, depth: bool = False) -> Array:
        """Returns values, which are valid until the next call. Without a grid, the grid is fitted to the image."""
        mip = self.filter
        self._set(state, exact)
        if grid is None:
            mip.FitOutputGrid()
        else:
            mip.SetSize(list(grid.size))
            mip.SetOutputSpacing([grid.spacing] * 2)
            mip.SetOutputOrigin(list(grid.origin))
        mip.SetComputeDepth(depth)
        mip.Update()
        result: Array = itk.array_view_from_image(mip.GetOutput())
        return result

    def _set(self, state: State, exact: bool) -> None:
        mip = self.filter
        mip.SetTransform(state.transform)
        mip.SetMode(getattr(itk.ShearWarpMIPImageFilterEnums, MODES[state.mode]))
        near, far = state.slab or (-np.inf, np.inf)
        mip.SetSlabNear(near)
        mip.SetSlabFar(far)
        mip.SetExact(exact)

    def find_window(self, state: State) -> Window:
        """Finds the window of the picture of a state, fitted to the image."""
        return find_window_of(self.project(state, None), self.filter.GetDefaultPixelValue())

    def get_window(self, first: State) -> Window:
        """Returns the window of a mode, found in the first state that asks for it."""
        if first.mode not in self.windows:
            self.windows[first.mode] = self.find_window(first)
        return self.windows[first.mode]

    def make_grey(self, pixels: Array, window: Window) -> Array:
        """Converts values in a window to 0 to 255, rounded like the program's."""
        if pixels.dtype.kind == "f" or pixels.itemsize > 2:
            return make_grey(pixels, window)
        unsigned = np.dtype(f"u{pixels.itemsize}")
        if self._table is None or self._table[0] != window:
            every = np.arange(1 << (8 * pixels.itemsize)).astype(unsigned).view(pixels.dtype)
            self._table = window, make_grey(every, window)
        grey: Array = self._table[1].take(pixels.view(unsigned))
        return grey

    def find_point(self, state: State, u: float, v: float, exact: bool) -> Point | None:
        """Returns the point that gives the ray at u, v its value, or None if the ray meets nothing, or has a mean."""
        if state.mode == "mean":
            return None
        value = self.project(state, Grid((1, 1), 1.0, (u, v)), exact, depth=True)[0, 0]
        if np.isnan(itk.array_view_from_image(self.filter.GetDepthOutput())[0, 0]):
            return None
        position = self.filter.GetPhysicalPoint([0, 0])
        index = self.image.TransformPhysicalPointToIndex(position)
        return Point(
            (position[0], position[1], position[2]), (int(index[0]), int(index[1]), int(index[2])), value.item()
        )


def _make_colours(name: str) -> Array:
    """The 256 colours of one of ITK's colour maps."""
    values = itk.image_view_from_array(np.arange(256, dtype=np.uint8)[None])
    colours: Array = itk.array_from_image(itk.scalar_to_rgb_colormap_image_filter(values, colormap=COLOURS[name]))[0]
    return colours


# ---- Views


def make_view(image: Any, view: Any = "anterior", azimuth: float = 0.0, elevation: float = 0.0) -> Any:
    """Returns a view as an itk.AffineTransform: see make_transform()."""
    found = make_transform(image, view, azimuth, elevation)
    if not found.IsLinear():
        raise ValueError(f"view must be a linear transform, but it is a {found.GetNameOfClass()}")
    matrix = get_matrix(found)
    if not abs(np.linalg.det(matrix)) > 0:
        raise ValueError("view must be a transform that can be inverted")
    return make_transform(image, matrix)


def get_axes(transform: Any) -> Array:
    """Columns of length 1: where u (right), v (down) and w (away) point in the patient."""
    return normalize(get_matrix(transform))


def find_angles(transform: Any) -> tuple[float, float, float]:
    """Azimuth, elevation and roll: see _labels.find_angles()."""
    return _labels.find_angles(get_matrix(transform))


def find_hand(transform: Any) -> float:
    """1, or -1 of a mirrored view."""
    return _labels.find_hand(get_matrix(transform))


# ---- The picture


class Scene:
    """One volume or two in one physical space, and their pictures. Only one thread at a time may use it.

    first: the state in which windows are found.
    """

    def __init__(
        self, layers: Sequence[Layer], first: State, *, title: str = "", opacity: float = 1.0, exact: bool = False
    ) -> None:
        self.layers = tuple(layers)
        self.first = first
        # of other letters Pillow's own font has none
        self.title = title.encode("ascii", "replace").decode()
        self.exact = exact
        self.paint_seconds = 0.0
        self._measure()
        colours = self.layers[0].colours[:, None, :].astype(float)
        if len(self.layers) > 1:
            part = opacity * np.arange(256)[None, :, None] / 255
            colours = np.floor(colours + (self.layers[1].colours[None].astype(float) - colours) * part + 0.5)
        rgba = np.full((*colours.shape[:2], 4), 255, np.uint8)
        rgba[..., :3] = colours
        self._colours = rgba.view(np.uint32).ravel()
        self._lock = threading.RLock()
        self._abort_lock = threading.Lock()
        self._may_abort = False

    def _measure(self) -> None:
        image = self.layers[0].image
        self.center = np.array(list(itk.ShearWarpMIPView.GetCenter(image)))
        self.extent = _find_corners(image) - self.center
        self._has_direction = _entries.has_direction(image)
        self._millimetres = find_millimetres(_entries.get_unit(image))
        voxel = self._millimetres * min(image.GetSpacing())
        self._unit, factor = ("mm", 1.0) if voxel >= 0.01 else ("µm", 1e3) if voxel >= 0.00001 else ("nm", 1e6)
        self._factor = factor * self._millimetres
        # a tenth of a voxel, but not less than 0.1
        self._decimals = max(1, int(np.ceil(-np.log10(factor * voxel))))

    def refresh(self) -> None:
        """Takes the present values of the images."""
        with self._lock:
            for layer in self.layers:
                layer.refresh()
            self._measure()

    def make_grid(self, state: State, size: tuple[int, int]) -> Grid:
        """Returns the grid of a canvas of these columns and rows. The whole image fits into it in all views."""
        x, y, z = np.abs(self.extent).max(axis=0)
        across, along = np.hypot(*self.extent[:, :2].T).max(), max(x, y, z)
        spacing = float(max(2 * across / size[0], 2 * along / size[1]) / 0.94 / state.zoom)
        u, v = (middle - (length - 1) / 2 * spacing for middle, length in zip(state.pan, size))
        return Grid(size, spacing, (u, v))

    def get_window(self, state: State, layer: int = 0) -> Window:
        window = state.windows.get((layer, state.mode)) or self.layers[layer].windows.get(state.mode)
        if window is None:
            with self._lock:
                window = self.layers[layer].get_window(replace(self.first, mode=state.mode))
        return window

    def find_window(self, state: State, layer: int) -> Window:
        """Finds the window of a layer in the picture of this state, fitted to the image."""
        with self._lock:
            return self.layers[layer].find_window(state)

    def find_point(self, state: State, u: float, v: float) -> Point | None:
        """Returns the point of the first volume with the point of the second volume, or None if the first has none."""
        with self._lock:
            found = [layer.find_point(state, u, v, self.exact) for layer in self.layers]
        if found[0] is None or len(found) == 1:
            return found[0]
        return Point(found[0].position, found[0].index, found[0].value, found[1])

    def abort(self) -> None:
        """Lets paint() raise RuntimeError, in any thread, if it can be ended."""
        with self._abort_lock:
            for layer in self.layers if self._may_abort else ():
                layer.filter.AbortGenerateDataOn()

    def project(self, state: State, grid: Grid) -> list[Any]:
        """Returns the values of the pictures, each as an itk.Image."""
        with self._lock:
            pictures = []
            for layer in self.layers:
                layer.project(state, grid, self.exact)
                picture = layer.filter.GetOutput()
                picture.DisconnectPipeline()
                pictures.append(picture)
        return pictures

    def paint(
        self, state: State, size: tuple[int, int], *, factor: int = 1, ratio: float = 1.0, may_abort: bool = False
    ) -> Array:
        """Returns RGBA, rows x columns x 4.

        factor: the size of a pixel along both axes, for pictures in motion; 1 is the full picture.
        ratio: pixels of the canvas per unit of text.
        """
        grid = self.make_grid(state, size)
        with self._lock:
            start = time.perf_counter()
            index: Array = np.zeros(0)
            fine = grid if factor == 1 else grid.coarsen(factor)
            self._set_abort(may_abort)
            try:
                for n, layer in enumerate(self.layers):
                    window = self.get_window(state, n)
                    grey = layer.make_grey(layer.project(state, fine, self.exact and factor == 1), window)
                    index = grey if n == 0 else index.astype(np.uint16) << 8 | grey
            finally:
                self._set_abort(False)
            pixels = self._colours.take(index)
            # what a lower resolution can save
            self.paint_seconds = (
                time.perf_counter() - start - sum(layer.filter.GetProjectionSeconds() for layer in self.layers)
            )
        if factor > 1:
            pixels = pixels.repeat(factor, 0).repeat(factor, 1)[: size[1], : size[0]]
        rgba = np.ascontiguousarray(pixels).view(np.uint8).reshape(size[1], size[0], 4)
        if state.has_text:
            self._annotate(rgba, state, grid, ratio)
        return rgba

    def _set_abort(self, may_abort: bool) -> None:
        with self._abort_lock:
            self._may_abort = may_abort

    def _annotate(self, rgba: Array, state: State, grid: Grid, ratio: float) -> None:
        height, width = rgba.shape[:2]
        scale = ratio * float(np.clip(min(width, height) / ratio / 480, 0.7, 1.0))
        edge, line = 10 * scale, 19 * scale
        axes = get_axes(state.transform)
        if state.point is not None:
            self._mark(rgba, state, grid, scale)
        corners = {
            (0.0, 0.0): [(self.title, _TEXT), *self._describe_point(state)],
            (1.0, 0.0): self._describe_view(state),
            (0.0, 1.0): [
                (f"W {_format(high - low, high - low)}  L {_format((high + low) / 2, high - low)}{name}", _TEXT)
                for name, (low, high) in zip(
                    ("  overlay", "") if len(self.layers) > 1 else ("",),
                    [self.get_window(state, n) for n in reversed(range(len(self.layers)))],
                )
            ],
        }
        for (right, bottom), texts in corners.items():
            shown = [each for each in texts if each[0]]
            for n, (text, colour) in enumerate(reversed(shown) if bottom else shown):
                x = width - edge if right else edge
                y = height - edge - n * line if bottom else edge + n * line
                _put(rgba, _make_stamp(text, 14 * scale, colour), x, y, right, bottom)
        for side, (x, y, right, bottom) in {
            "right": (width - edge, height / 2, 1.0, 0.5),
            "left": (edge, height / 2, 0.0, 0.5),
            "bottom": (width / 2, height - edge, 0.5, 1.0),
            "top": (width / 2, edge, 0.5, 0.0),
        }.items():
            direction = axes[:, int(side in ("bottom", "top"))] * (-1 if side in ("left", "top") else 1)
            text = find_letters(direction) if self._has_direction else ""
            _put(rgba, _make_stamp(text, 17 * scale, _TEXT), x, y, right, bottom)
        spacing = grid.spacing * self._millimetres * float(np.linalg.norm(get_matrix(state.transform)[:3, 0]))
        length = round_length(spacing * width / 5)
        bar = _make_bar(round(length / spacing), scale)
        _put(rgba, bar, width - edge, height - edge, 1.0, 1.0)
        stamp = _make_stamp(format_length(length), 13 * scale, _TEXT)
        _put(rgba, stamp, width - edge, height - edge - 9 * scale, 1.0, 1.0)
        if state.message:
            _put(rgba, _make_stamp(state.message, 14 * scale, _ACCENT), width / 2, height - edge - 2 * line, 0.5, 1.0)
        if state.has_help:
            _put(rgba, _make_help(min(scale, height / 590, width / 560)), width / 2, height / 2, 0.5, 0.5)

    def _describe_view(self, state: State) -> list[tuple[str, str]]:
        azimuth, elevation, roll = find_angles(state.transform)
        parts = [
            f"{'LAO' if azimuth > 0 else 'RAO'} {abs(azimuth):.1f}°" if abs(azimuth) >= 0.05 else "",
            f"{'CRA' if elevation > 0 else 'CAU'} {abs(elevation):.1f}°" if abs(elevation) >= 0.05 else "",
            f"roll {roll:.1f}°" if abs(roll) >= 0.05 else "",
        ]
        hand = find_hand(state.transform)
        axes = get_axes(state.transform) * (hand, 1, 1)
        name = next(
            (
                view.capitalize()
                for view in SIDES
                # angles that are written as 0
                if np.allclose(axes, get_axes(make_view(self.layers[0].image, view)), rtol=0, atol=9e-4)
            ),
            "  ".join(part.replace(".0°", "°") for part in parts if part),
        )
        name += "  mirrored" if hand < 0 else ""
        mode = {"maximum": "", "minimum": "Minimum", "absolute_maximum": "Absolute maximum", "mean": "Mean"}[state.mode]
        slab = ""
        if state.slab:
            near, far = (self._factor * depth for depth in state.slab)
            thickness, middle = (f"{each:.{self._decimals}f} {self._unit}" for each in (far - near, (near + far) / 2))
            slab = f"Slab {thickness} at {middle}"
        return [(name, _TEXT), (mode, _QUIET), (slab, _QUIET)]

    def _describe_point(self, state: State) -> list[tuple[str, str]]:
        if state.point is None:
            return []
        position = "  ".join(
            f"{letters[int(each < 0)]} {abs(each):.{self._decimals}f}"
            if self._has_direction
            else f"{name} {each:.{self._decimals}f}"
            for name, letters, each in zip("xyz", LETTERS, self._factor * np.array(state.point.position))
        )
        overlay = f"  overlay {state.point.overlay.value:.4g}" if state.point.overlay else ""
        return [
            (f"{state.point.value:g}{overlay}", _ACCENT),
            (f"{position} {self._unit}", _ACCENT),
            ("voxel {}, {}, {}".format(*state.point.index), _QUIET),
        ]

    def _mark(self, rgba: Array, state: State, grid: Grid, scale: float) -> None:
        assert state.point is not None
        u, v, _ = state.transform.GetInverseTransform().TransformPoint(list(state.point.position))
        x, y = ((each - first) / grid.spacing + 0.5 for each, first in zip((u, v), grid.origin))
        _put(rgba, _make_cross(scale), x, y, 0.5, 0.5)


def _find_corners(image: Any) -> Array:
    region = image.GetLargestPossibleRegion()
    first, size = np.array(list(region.GetIndex())), np.array(list(region.GetSize()))
    ends = [first - 0.5, first + size - 0.5]
    corners = np.array([[ends[n >> axis & 1][axis] for axis in range(3)] for n in range(8)])
    directions: Array = itk.array_from_matrix(image.GetDirection())
    places: Array = corners * list(image.GetSpacing()) @ directions.T + list(image.GetOrigin())
    return places


def _format(number: float, width: float) -> str:
    """Formats a number to a hundredth of the window's width; from a width of 100 on as a whole number."""
    decimals = max(0, int(np.ceil(2 - np.log10(max(width, 1e-300)) - 1e-9)))
    return f"{number:.{decimals}f}" if decimals <= 6 else f"{number:.3e}"


# ---- Stamps: small pictures with opacity, kept


@dataclass(frozen=True, eq=False)
class _Stamp:
    colours: Array
    """Colours multiplied by opacity."""
    transparency: Array


def _finish(image: Image.Image) -> _Stamp:
    rgba = np.asarray(image).astype(np.uint16)
    opacity = rgba[..., 3:]
    colours = rgba[..., :3] * opacity // 255
    return _Stamp(np.concatenate([colours, opacity], 2).astype(np.uint8), 255 - opacity)


def _put(rgba: Array, stamp: _Stamp, x: float, y: float, right: float, bottom: float) -> None:
    """Draws a stamp. x, y lies at the fractions `right` and `bottom` of its size. Cuts off what is outside."""
    height, width = stamp.colours.shape[:2]
    left, top = round(x - right * width), round(y - bottom * height)
    rows = slice(max(top, 0), max(min(top + height, rgba.shape[0]), 0))
    columns = slice(max(left, 0), max(min(left + width, rgba.shape[1]), 0))
    here = (slice(rows.start - top, rows.stop - top), slice(columns.start - left, columns.stop - left))
    if rows.start < rows.stop and columns.start < columns.stop:
        part = rgba[rows, columns]
        part[...] = part * stamp.transparency[here] // 255 + stamp.colours[here]


@lru_cache(maxsize=64)
def _get_font(size: float) -> Any:
    return ImageFont.load_default(max(1.0, size))


@lru_cache(maxsize=256)
def _make_stamp(text: str, size: float, colour: str) -> _Stamp:
    text, font, rim = widen(text), _get_font(size), max(1, round(size / 10))
    ascent, descent = font.getmetrics()
    image = Image.new("RGBA", (round(font.getlength(text)) + 2 * rim, ascent + descent))
    draw = ImageDraw.Draw(image)
    draw.text((rim, 0), text, font=font, fill=colour, stroke_width=rim, stroke_fill="#000000")
    return _finish(image)


@lru_cache(maxsize=16)
def _make_bar(length: int, scale: float) -> _Stamp:
    rim, height = max(1, round(1.5 * scale)), round(6 * scale)
    image = Image.new("RGBA", (length + 2 * rim, height + 2 * rim))
    draw = ImageDraw.Draw(image)
    right, bottom = length + rim - 1, height + rim - 1
    for width, colour in ((3 * rim, "#000000"), (rim, _TEXT)):
        draw.line([(rim, rim), (rim, bottom), (right, bottom), (right, rim)], colour, width)
    return _finish(image)


@lru_cache(maxsize=8)
def _make_cross(scale: float) -> _Stamp:
    gap, arm = round(4 * scale), round(14 * scale)
    size = 2 * arm + 3
    image = Image.new("RGBA", (size, size))
    draw = ImageDraw.Draw(image)
    middle = arm + 1
    for width, colour in ((3, "#000000"), (1, _ACCENT)):
        for sign in (-1, 1):
            draw.line([(middle + sign * gap, middle), (middle + sign * arm, middle)], colour, width)
            draw.line([(middle, middle + sign * gap), (middle, middle + sign * arm)], colour, width)
    return _finish(image)


HELP = (
    ("Drag", "turn"),
    ("Right button, drag", "window: right is wider, up is brighter"),
    ("Middle button or Shift, drag", "move the picture"),
    ("Wheel", "zoom"),
    ("One finger, two fingers", "turn; zoom and move"),
    ("Click", "point in the patient"),
    ("Double click", "reset"),
    ("", ""),
    ("A P L R S I", "view from anterior, posterior, ..."),
    ("Arrow keys", "turn by 5 degrees"),
    ("Space", "play a turn"),
    ("T", "trackball, or about the long axis"),
    ("M", "maximum, minimum, absolute maximum, mean"),
    ("+  -", "thickness of the slab"),
    ("[  ]", "slab nearer, farther"),
    ("O", "window of the overlay, or of the volume"),
    ("V", "letters and text on or off"),
    ("C", "copy the line of Python of this picture"),
    ("Shift+C", "copy the command of this picture"),
    ("?", "this help"),
)


@lru_cache(maxsize=4)
def _make_help(scale: float) -> _Stamp:
    line, pad = 24 * scale, round(22 * scale)
    font, rows = _get_font(14 * scale), [(widen(keys), widen(text)) for keys, text in HELP]
    height = sum(line if keys else line / 2 for keys, _ in rows)
    column = max(font.getlength(keys) for keys, _ in rows) + pad
    width = column + max(font.getlength(text) for _, text in rows)
    image = Image.new("RGBA", (round(width) + 2 * pad, round(height) + 2 * pad))
    draw = ImageDraw.Draw(image)
    box = (0, 0, image.width - 1, image.height - 1)
    draw.rounded_rectangle(box, round(10 * scale), fill=(20, 23, 27, 235), outline="#2a2f36")
    y = float(pad)
    for keys, text in rows:
        draw.text((pad, y), keys, font=font, fill=_TEXT)
        draw.text((pad + column, y), text, font=font, fill=_QUIET)
        y += line if keys else line / 2
    return _finish(image)

"""Text in pictures: letters of the patient's sides, angles of the view, and a scale bar."""

from typing import Any

import itk
import numpy as np
from numpy.typing import NDArray

LETTERS = ("LR", "PA", "HF")
"""For the directions x, y and z in the patient, and the directions against them (PS3.3 C.7.6.1.1.1)."""

_SMALLEST = 48
"""The fewest columns and rows of a picture with letters."""


def get_matrix(transform: Any) -> NDArray[np.float64]:
    """The 4 x 4 matrix of a linear transform."""
    matrix = np.eye(4)
    start = np.array(list(transform.TransformPoint([0.0] * 3)))
    matrix[:3, 3] = start
    if hasattr(transform, "GetMatrix"):
        matrix[:3, :3] = itk.array_from_matrix(transform.GetMatrix())
    else:
        matrix[:3, :3] = np.transpose([transform.TransformPoint(axis) - start for axis in np.eye(3).tolist()])
    return matrix


def normalize(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of length 1: where u (right), v (down) and w (away) point in the patient."""
    axes: NDArray[np.float64] = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    return axes


def find_angles(matrix: NDArray[np.float64]) -> tuple[float, float, float]:
    """Azimuth and elevation from anterior, and the roll of the picture, clockwise; in degrees."""
    u, _, w = normalize(matrix).T
    elevation = np.arcsin(np.clip(-w[2], -1, 1))
    # seen along the long axis, what is up says where the front is
    azimuth = np.arctan2(u[1], u[0]) if np.hypot(w[0], w[1]) < 1e-6 else np.arctan2(-w[0], w[1])
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    roll = np.arctan2(np.dot(u, np.cross(w, level)), np.dot(u, level))
    return tuple(round(float(angle), 6) + 0.0 for angle in np.degrees([azimuth, elevation, roll]))  # type: ignore[return-value]


def find_letters(direction: Any) -> str:
    """The side of the patient to which a direction points, or two sides, the nearer first. If two are equally near, L
    or R comes first, then A or P. There is a second side from the sine of 22.5 degrees on."""
    # rounding errors make no letter
    lengths = np.round(np.abs(direction) / np.linalg.norm(direction), 6)
    nearest = np.argsort(-lengths, kind="stable")[:2]
    return "".join(LETTERS[axis][int(direction[axis] < 0)] for axis in nearest if lengths[axis] >= 0.382683)


def find_sides(matrix: NDArray[np.float64]) -> dict[str, str]:
    """The letters at the edges of a picture."""
    u, v, _ = normalize(matrix).T
    return {name: find_letters(side) for name, side in (("left", -u), ("right", u), ("top", -v), ("bottom", v))}


def round_length(most: float) -> float:
    """Rounds a length down to 1, 2, 5, 10, 20, 50 and so on."""
    # not 4.999... for 5
    most *= 1 + 1e-9
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= most))


def format_length(length: float) -> str:
    """A length in mm as text, in a smaller unit below 0.1."""
    factor, unit = (1, "mm") if length > 0.09 else (1e3, "µm") if length > 0.00009 else (1e6, "nm")
    return f"{float(f'{length * factor:.6g}'):g} {unit}"


def widen(text: str) -> str:
    """Widens spaces, because Pillow's space is narrow."""
    return text.replace(" ", "  ")


def draw(
    grey: NDArray[np.uint8], matrix: NDArray[np.float64], spacing: float, *, has_sides: bool, has_scale: bool
) -> NDArray[np.uint8]:
    """Returns a picture with letters at its edges, a scale bar at the bottom left and the angles at the top left, in
    white with a black rim. Leaves out what does not fit.

    matrix: from view space to the patient (LPS), 4 x 4.
    spacing: of columns, in mm of view space.
    """
    height, width = grey.shape
    if min(grey.shape) < _SMALLEST or not (has_sides or has_scale):
        return grey
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(grey)
    canvas = ImageDraw.Draw(image)
    size = max(10.0, min(grey.shape) / 22)
    font, margin, rim = ImageFont.load_default(size), size / 2, max(1, round(size / 10))

    def write(text: str, x: float, y: float, anchor: str) -> None:
        canvas.text((x, y), text, 255, font, anchor, stroke_width=rim, stroke_fill=0)

    if has_sides:
        sides = find_sides(matrix)
        write(sides["left"], margin, height / 2, "lm")
        write(sides["right"], width - margin, height / 2, "rm")
        write(sides["top"], width / 2, margin, "mt")
        write(sides["bottom"], width / 2, height - margin, "mb")
    if has_scale:
        room = width / 2 - margin - 1.5 * size
        lines = [widen(line) for line in describe_angles(matrix)]
        if max(map(font.getlength, lines)) <= room:
            for n, line in enumerate(lines):
                write(line, margin, margin + 1.2 * size * n, "lt")
        step = spacing * float(np.linalg.norm(matrix[:3, 0]))
        length = round_length(width / 4 * step)
        text, bar = format_length(length), length / step
        if max(bar, font.getlength(text)) <= room:
            bottom, tick = height - margin, size / 4
            write(text, margin, bottom - tick - rim, "ls")
            corners = [(margin, bottom - tick), (margin, bottom), (margin + bar, bottom), (margin + bar, bottom - tick)]
            for thickness, colour in ((3 * rim, 0), (rim, 255)):
                canvas.line(corners, colour, thickness)
    return np.asarray(image)


def describe_angles(matrix: NDArray[np.float64]) -> list[str]:
    """The angles of a view: LAO or RAO, or degrees for a view from behind, and CRA or CAU (PS3.3 C.8.7.5.1.2)."""

    def describe(angle: float, positive: str, negative: str) -> str:
        shown = round(angle, 1) + 0.0
        return f"{positive if shown >= 0 else negative} {abs(shown):g}" if abs(shown) <= 90 else f"{shown:g}°"

    azimuth, elevation, _ = find_angles(matrix)
    # from above and below there is none
    azimuth = 0.0 if abs(elevation) > 89.999 else azimuth
    return [describe(azimuth, "LAO", "RAO"), describe(elevation, "CRA", "CAU")]

"""Texts of the viewer: letters of the patient's sides, angles of the view, and lengths."""

from contextlib import suppress
from typing import Any

import itk
import numpy as np
from numpy.typing import NDArray

LETTERS = ("LR", "PA", "HF")
"""For the directions x, y and z in the patient, and the directions against them (PS3.3 C.7.6.1.1.1)."""


def get_matrix(transform: Any) -> NDArray[np.float64]:
    """The 4 x 4 matrix of a linear transform."""
    if not hasattr(transform, "GetMatrix"):
        # the name in itk would load all of ITKTransform
        from itk.itkMatrixOffsetTransformBasePython import itkMatrixOffsetTransformBaseD33

        # not rounded; some have no matrix
        with suppress(RuntimeError):
            transform = itkMatrixOffsetTransformBaseD33.cast(transform)
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


def find_hand(matrix: NDArray[np.float64]) -> float:
    """1, or -1 of a mirrored view."""
    return float(np.sign(np.linalg.det(matrix[:3, :3])))


def find_angles(matrix: NDArray[np.float64]) -> tuple[float, float, float]:
    """Azimuth and elevation from anterior, and the roll of the picture before it is mirrored, clockwise; in degrees,
    more than -180 and at most 180."""
    u, _, w = normalize(matrix).T
    u = find_hand(matrix) * u
    elevation = np.arcsin(np.clip(-w[2], -1, 1))
    # seen along the long axis, what is up says where the front is
    azimuth = np.arctan2(u[1], u[0]) if np.hypot(w[0], w[1]) < 1e-6 else np.arctan2(-w[0], w[1])
    level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    roll = np.arctan2(np.dot(u, np.cross(w, level)), np.dot(u, level))
    angles = np.round(np.degrees([azimuth, elevation, roll]), 6) + 0.0
    return tuple(np.where(angles > -180, angles, 180.0).tolist())


def find_letters(direction: Any) -> str:
    """The side of the patient to which a direction points, or two sides, the nearer first. If two are equally near, L
    or R comes first, then A or P. There is a second side from the sine of 22.5 degrees on."""
    # rounding errors make no letter
    lengths = np.round(np.abs(direction) / np.linalg.norm(direction), 6)
    nearest = np.argsort(-lengths, kind="stable")[:2]
    return "".join(LETTERS[axis][int(direction[axis] < 0)] for axis in nearest if lengths[axis] >= 0.382683)


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

"""Where the pixels of a projection come from, and what other volumes have there."""

from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._inputs import Placed, open_image, take
from itk_shearwarpmip._parameters import Interpolation, find_interpolation

if TYPE_CHECKING:
    from itk_shearwarpmip._front import Place

_TOLERANCE = 1e-3
"""In voxels, for depths that are rounded to single precision."""
_BLOCK = 1 << 16
"""Places that are looked up together, so that they stay in the cache."""


def find_places(picture: Any, depths: Any) -> NDArray[np.float64]:
    """The physical points (..., rows, columns, 3) of an itk.Image of one picture or several, from its depths."""
    depths = np.asarray(depths)
    (u0, v0), (du, dv) = ([*each][:2] for each in (picture.GetOrigin(), picture.GetSpacing()))
    frames = depths.reshape(-1, *depths.shape[-2:])
    matrices = np.reshape(picture["FrameTransforms"], (-1, 4, 4))[:, :3]
    places = np.empty((*frames.shape, 3))
    for of_frame, w, matrix in zip(places, frames, matrices, strict=True):
        columns, rows = (u0 + du * np.arange(w.shape[1]))[:, None], (v0 + dv * np.arange(w.shape[0]))[:, None, None]
        of_frame[:] = columns * matrix[:, 0] + rows * matrix[:, 1] + w[..., None] * matrix[:, 2] + matrix[:, 3]
    return places.reshape(*depths.shape, 3)


def find_coordinates(placed: Placed, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Voxel coordinates i, j, k of physical points (..., 3); whole numbers are voxel centers."""
    axes = np.asarray(placed.direction, float).reshape(3, 3) * placed.spacing
    x, y, z = (places[..., axis] - start for axis, start in enumerate(placed.origin))
    # several times as fast as a product of many small vectors
    return np.stack([i * x + j * y + k * z for i, j, k in np.linalg.inv(axes)], axis=-1)


def find_corners(coordinates: NDArray[np.float64], shape: tuple[int, ...]) -> tuple[NDArray[Any], ...]:
    """The cells of finite voxel coordinates (..., 3) in voxels z, y, x of a shape: the lower voxels and the upper ones,
    i, j, k, and the weights of the upper ones. Beyond the outer voxel centers, the outer voxels count."""
    last = np.array(shape[::-1]) - 1
    inside = np.clip(coordinates, 0, last)
    lower = np.floor(inside).astype(np.intp)
    return lower, np.minimum(lower + 1, last), inside - lower


def sample(
    source: Any,
    places: Any,
    interpolation: Interpolation = "linear",
    outside: float = np.nan,
    **where: Unpack["Place"],
) -> NDArray[Any]:
    """The values of a volume at places in physical space, such as those that mip() returns of another volume.

    source: the volume: see open_image(). Its grid can be any, also oblique or sheared; the places tie both together.
    places: points x, y, z, an array (..., 3), in mm (LPS).
    interpolation: "linear", or "nearest" for labels: the value of the nearest voxel. In the middle between two voxels
        along an axis, it is the voxel with the larger index.
    outside: the value of places outside of the volume, and of places that are not-a-number. The volume ends half a voxel
        beyond the outer voxel centers, and a thousandth of a voxel behind that, for rounding. In this rim, linear
        interpolation continues the values of the outer voxels.
    where: spacing, origin, direction, series, volume, suv, level, time and channel of open_image().

    Returns an array (...). It is of float64 if the interpolation is linear, and otherwise of the voxels' type, if this can
    hold `outside`, as it can hold 0. Voxels with the weight 0 do not count, also if they are infinite or not-a-number.

    Raises ValueError for unsuitable values, and the exceptions of open_image().

    >>> import numpy as np
    >>> ramp = np.arange(10.0) * np.ones((3, 4, 1))
    >>> sample(ramp, [[1.25, 1, 2], [9.5, 0, 0], [9.6, 0, 0]]).tolist()
    [1.25, 9.0, nan]
    >>> sample(ramp.astype(np.uint8), [[1.5, 1, 2], [-1, 0, 0]], "nearest", outside=0)
    array([2, 0], dtype=uint8)
    """
    find_interpolation(interpolation)
    try:
        points = np.asarray(places, float)
        other = float(outside)
    except (TypeError, ValueError):
        raise ValueError("places must be numbers, an array (..., 3), and outside a number") from None
    if points.shape[-1:] != (3,):
        raise ValueError(f"places must be an array (..., 3), but its shape is {points.shape}")
    placed = take(open_image(source, **where)).replace(None, None, None)
    voxels: NDArray[Any] = placed.array
    with np.errstate(invalid="ignore"):
        is_held = voxels.dtype.kind == "f" or np.array(other).astype(voxels.dtype) == other
    found = np.full(points.shape[:-1], other, voxels.dtype if is_held and interpolation == "nearest" else float)
    flat, points = found.reshape(-1), points.reshape(-1, 3)
    limits = np.array(voxels.shape[::-1]) - 0.5 + _TOLERANCE
    for first in range(0, flat.size, _BLOCK):
        with np.errstate(invalid="ignore"):
            coordinates = find_coordinates(placed, points[first : first + _BLOCK])
        # not-a-number is not inside
        inside = ((coordinates >= -0.5 - _TOLERANCE) & (coordinates <= limits)).all(axis=1)
        if interpolation == "nearest":
            coordinates = np.floor(coordinates + 0.5)
        flat[first : first + _BLOCK][inside] = _interpolate(voxels, coordinates[inside])
    return found


def _interpolate(voxels: NDArray[Any], coordinates: NDArray[np.float64]) -> NDArray[Any]:
    lower, upper, weights = find_corners(coordinates, voxels.shape)
    if not weights.any():
        at_centers: NDArray[Any] = voxels[*lower.T[::-1]]
        return at_centers
    values: list[NDArray[Any]] = [
        voxels[*(corner[:, axis] for axis, corner in zip((2, 1, 0), corners))].astype(float)
        for corners in ((z, y, x) for z in (lower, upper) for y in (lower, upper) for x in (lower, upper))
    ]
    for weight in weights.T:
        values = [_mix(low, high, weight) for low, high in zip(values[::2], values[1::2], strict=True)]
    return values[0]


def _mix(low: NDArray[np.float64], high: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):
        mixed = (1 - weight) * low + weight * high
    # equal values remain what they are
    kept: NDArray[np.float64] = np.where((weight == 0) | (low == high), low, mixed)
    return kept

"""Windows: the values that become black and white."""

import math
from typing import Any

import itk
import numpy as np
from numpy.typing import NDArray

Window = tuple[float, float]


def find_window(image: Any) -> Window:
    """The window that the program shear-warp-mip chooses: percentiles 1 and 99.8 of the pixels that are finite and not
    background.

    image: an itk.Image of any dimension, with one or several components. The entry "Background" of its dictionary is
        the value of the background. Without this entry, the background is 0, or the least pixel if it is negative.

    Returns the values that become black and white, low < high.

    >>> image = itk.image_from_array(np.arange(1001, dtype=np.uint16).reshape(7, 143))
    >>> find_window(image)
    (11.0, 998.0)
    """
    return find_window_of(itk.array_view_from_image(image), _find_background(image))


def find_window_of(pixels: NDArray[Any], background: float) -> Window:
    """The window of an array of pixels: see find_window()."""
    values = _select_values(pixels, background)
    if values.size == 0:
        low = float(background) if math.isfinite(background) else 0.0
        return low, max(low + 1.0, math.nextafter(low, math.inf))
    ranks = [math.floor(fraction * (values.size - 1) + 0.5) for fraction in (0.01, 0.998)]
    low, high = (float(value) for value in np.partition(values, ranks)[ranks])
    return (low, high) if low < high else (min(high - 1.0, math.nextafter(high, -math.inf)), high)


def make_grey(pixels: NDArray[Any], window: Window) -> NDArray[np.uint8]:
    """Converts pixels to 8 bits, as the program does: the window becomes 0 to 255."""
    low, high = window
    values = np.asarray(pixels, np.float64)
    values = np.where(values > low, np.minimum(values, high), low)
    return _round(255.0 * (values - low) / (high - low)).astype(np.uint8)


def check_window(window: Any) -> Window:
    message = f"window must be two finite numbers, the lower one first, but it is {window!r}"
    try:
        low, high = (float(value) for value in window)
    except (TypeError, ValueError):
        raise ValueError(message) from None
    if not low < high or not math.isfinite(high - low):
        raise ValueError(message)
    return low, high


def is_background(pixels: NDArray[Any], background: float) -> NDArray[np.bool_]:
    """Whether pixels are background or not-a-number."""
    found: NDArray[np.bool_] = (pixels == background) | np.isnan(pixels)
    return found


def _round(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rounds to whole numbers, halves up, like std::lround for numbers that are not negative."""
    whole = np.floor(values)
    return whole + (values - whole >= 0.5)


def _find_background(image: Any) -> float:
    if image.GetMetaDataDictionary().HasKey("Background"):
        return float(image["Background"])
    return min(0.0, float(np.fmin.reduce(itk.array_view_from_image(image), axis=None)))


def _select_values(pixels: NDArray[Any], background: float) -> NDArray[Any]:
    values: NDArray[Any] = pixels[~is_background(pixels, background) & np.isfinite(pixels)]
    return values

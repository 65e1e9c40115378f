"""Pictures of 8 bits for a notebook."""

import struct
import zlib
from typing import Any

import itk
import numpy as np
from numpy.typing import NDArray


def find_window(image: Any) -> tuple[float, float]:
    """The values that become black and white: percentiles 1 and 99.8 of what is not background."""
    pixels = itk.array_view_from_image(image)
    background = image["Background"] if image.GetMetaDataDictionary().HasKey("Background") else 0.0
    values = np.sort(pixels[np.isfinite(pixels) & (pixels != background)])
    if not values.size:
        low = background if np.isfinite(background) else 0.0
        return low, low + 1.0
    low, high = (float(values[int(fraction * (values.size - 1) + 0.5)]) for fraction in (0.01, 0.998))
    return (low if low < high else high - 1.0), high


def encode_png(pixels: NDArray[Any]) -> bytes:
    """A grey PNG of uint8 or uint16."""
    rows, columns = pixels.shape
    lines = np.zeros((rows, 1 + columns * pixels.itemsize), np.uint8)
    lines[:, 1:] = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(rows, -1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", columns, rows, 8 * pixels.itemsize, 0, 0, 0, 0)
    data = zlib.compress(lines.tobytes())
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def make_page(turn: Any, *, window: tuple[float, float] | None = None) -> str:
    raise NotImplementedError


def save_turn(turn: Any, path: Any, *, rate: float | None = None, window: tuple[float, float] | None = None) -> None:
    raise NotImplementedError

"""A ray caster as a user of Python writes it with Numba: trilinear, rows in parallel."""

from __future__ import annotations

import math

import numba
import numpy as np

from peer.volume import Peer, View, Volume


@numba.njit
def interpolate(voxels, x, y, z):
    """Trilinear, at a position in voxels within the box of the voxel centers."""
    i = min(max(int(x), 0), voxels.shape[2] - 2)
    j = min(max(int(y), 0), voxels.shape[1] - 2)
    k = min(max(int(z), 0), voxels.shape[0] - 2)
    x, y, z = x - i, y - j, z - k
    c00 = voxels[k, j, i] * (1 - x) + voxels[k, j, i + 1] * x
    c01 = voxels[k, j + 1, i] * (1 - x) + voxels[k, j + 1, i + 1] * x
    c10 = voxels[k + 1, j, i] * (1 - x) + voxels[k + 1, j, i + 1] * x
    c11 = voxels[k + 1, j + 1, i] * (1 - x) + voxels[k + 1, j + 1, i + 1] * x
    return (c00 * (1 - y) + c01 * y) * (1 - z) + (c10 * (1 - y) + c11 * y) * z


@numba.njit(parallel=True)
def cast(voxels, start, across, down, along, step, background, result):
    """A sample every `step` mm from where a ray enters the box of the voxel centers to where it leaves it.

    In voxels (x, y, z): the first pixel's ray passes through `start`, `across` and `down` lead to the next column and
    row, and `along` is one mm of way.
    """
    for row in numba.prange(result.shape[0]):
        for column in range(result.shape[1]):
            x, y, z = start + column * across + row * down
            near, far = -math.inf, math.inf
            for p, d, last in zip((x, y, z), along, voxels.shape[::-1]):
                if abs(d) > 1e-12:
                    a, b = -p / d, (last - 1 - p) / d
                    near, far = max(near, min(a, b)), min(far, max(a, b))
                elif p < 0 or p > last - 1:
                    far = -math.inf
            best = background
            for n in range(int((far - near) / step) + 1 if near <= far else 0):
                w = near + n * step
                best = max(best, interpolate(voxels, x + w * along[0], y + w * along[1], z + w * along[2]))
            result[row, column] = best


class Projector(Peer):
    """One sample a voxel of way: a step is the smallest spacing. It is compiled before it is timed."""

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        numba.set_num_threads(threads)
        self.result = np.empty((volume.width, volume.width))
        cast(volume.voxels, *np.eye(4, 3), 1.0, float(self.background), self.result[:1, :1].copy())

    def project(self, view: View) -> None:
        u, v, w = np.ascontiguousarray(view.to_index(self.volume).T)
        start, step = self.volume.center + self.volume.first * (u + v), self.volume.step
        cast(self.volume.voxels, start, step * u, step * v, w, step, float(self.background), self.result)

    def picture(self) -> np.ndarray:
        return self.result

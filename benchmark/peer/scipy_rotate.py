"""SciPy: affine_transform of the whole volume, linear, then the maximum."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy import ndimage

from peer.volume import Peer, View, Volume


class Projector(Peer):
    """SciPy has no threads of its own: bands of rows are given to threads, as its user would have to do."""

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        self.bands = np.array_split(np.arange(volume.width), threads)
        self.pool = ThreadPoolExecutor(threads)

    def project(self, view: View) -> None:
        # from indices (w, v, u) of the rotated volume to those (z, y, x) of the image
        matrix = view.to_index(self.volume)[::-1, ::-1] * self.volume.step
        depth, middle = view.half_depth(self.volume), (self.volume.width - 1) / 2
        offset = self.volume.center[::-1] - matrix @ [depth, middle, middle]

        def project_band(rows: np.ndarray) -> np.ndarray:
            return ndimage.affine_transform(
                self.volume.voxels,
                matrix,
                offset + matrix[:, 1] * rows[0],
                output_shape=(2 * depth + 1, rows.size, self.volume.width),
                order=1,
                cval=self.background,
                prefilter=False,
            ).max(axis=0)

        self.result = np.concatenate(list(self.pool.map(project_band, self.bands)))

    def picture(self) -> np.ndarray:
        return self.result

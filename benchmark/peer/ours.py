"""itk::ShearWarpMIPImageFilter: one filter, whose transform is changed."""

from __future__ import annotations

from typing import Any

import itk
import numpy as np

from peer.itk_volume import make_image, make_transform
from peer.volume import Peer, View, Volume


class Projector(Peer):
    """`options` are the filter's: `exact`, `oversampling`."""

    def __init__(self, volume: Volume, threads: int, **options: Any) -> None:
        super().__init__(volume)
        self.filter = itk.ShearWarpMIPImageFilter.New(
            make_image(volume, volume.voxels, threads),
            number_of_work_units=threads,
            size=[volume.width] * 2,
            output_spacing=[volume.step] * 2,
            output_origin=[volume.first] * 2,
            default_pixel_value=self.background,
            **options,
        )

    def project(self, view: View) -> None:
        self.filter.SetTransform(make_transform(view))
        self.filter.Update()
        self.note = str(self.filter.GetInstructionSet())

    def picture(self) -> np.ndarray:
        return itk.array_from_image(self.filter.GetOutput())


def exact_picture(volume: Volume, view: View, threads: int) -> tuple[np.ndarray, np.ndarray]:
    """The exact maxima, and which of them lie a voxel or more from the image's rim."""
    projector = Projector(volume, threads, exact=True, compute_depth=True)
    projector.project(view)
    depth = itk.array_from_image(projector.filter.GetDepthOutput())
    across = volume.first + volume.step * np.arange(volume.width)
    positions = np.stack([*np.meshgrid(across, across), depth], axis=-1)
    index = positions @ view.to_index(volume).T + volume.center
    inside = ((index >= 1) & (index <= volume.size - 2)).all(axis=-1)
    return projector.picture().astype(float), inside

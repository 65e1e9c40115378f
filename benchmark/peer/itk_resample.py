"""ITK: the whole volume resampled onto a grid in view space, then the maximum along it."""

from __future__ import annotations

import itk
import numpy as np

from peer.itk_volume import make_image, make_transform
from peer.volume import Peer, View, Volume


class Projector(Peer):
    """ResampleImageFilter, linear, and MaximumProjectionImageFilter."""

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        image = make_image(volume, volume.voxels, threads)
        self.resample = itk.ResampleImageFilter.New(
            image,
            interpolator=itk.LinearInterpolateImageFunction.New(image),
            default_pixel_value=self.background,
            output_spacing=[volume.step] * 3,
        )
        picture_type = itk.Image[itk.template(image)[1][0], 2]
        self.maximum = itk.MaximumProjectionImageFilter[type(image), picture_type].New(
            self.resample.GetOutput(), projection_dimension=2
        )

    def project(self, view: View) -> None:
        depth, width = view.half_depth(self.volume), self.volume.width
        self.resample.SetSize([width, width, 2 * depth + 1])
        self.resample.SetOutputOrigin([self.volume.first, self.volume.first, -depth * self.volume.step])
        self.resample.SetTransform(make_transform(view))
        self.maximum.UpdateLargestPossibleRegion()

    def picture(self) -> np.ndarray:
        return itk.array_from_image(self.maximum.GetOutput())

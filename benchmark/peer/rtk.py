"""RTK's maximum intensity projector in parallel geometry (Joseph's method: a sample in every slice)."""

from __future__ import annotations

import math

import itk
import numpy as np

# the classes' own modules: itk.RTK imports most of ITK too, for 15 s
from itk import rtkMaximumIntensityProjectionImageFilterPython as projection
from itk import rtkThreeDCircularProjectionGeometryPython as geometry

from peer.itk_volume import make_image
from peer.volume import Peer, View, Volume


class Projector(Peer):
    """It starts from zero, so that the least value is taken off before and put back after.

    It multiplies the maximum by the length in mm of a ray's way from slice to slice, which is divided out again.
    """

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        self.voxels = volume.voxels.astype(np.float32) - np.float32(self.background)
        self.zeros = np.zeros((1, volume.width, volume.width), np.float32)
        detector = itk.image_view_from_array(self.zeros)
        detector.SetSpacing([volume.step] * 3)
        detector.SetOrigin([volume.first, volume.first, 0.0])
        self.filter = projection.rtkMaximumIntensityProjectionImageFilterIF3IF3.New()
        self.filter.InPlaceOff()
        self.filter.SetInput(0, detector)
        self.filter.SetInput(1, make_image(volume, self.voxels, threads))

    def project(self, view: View) -> None:
        gantry, out_of_plane, in_plane = angles(view.rotation)
        circle = geometry.rtkThreeDCircularProjectionGeometry.New()
        circle.AddProjectionInRadians(self.volume.diagonal, 0.0, gantry, 0.0, 0.0, out_of_plane, in_plane, 0.0, 0.0)
        self.filter.SetGeometry(circle)
        self.filter.Update()
        self.way = 1 / np.abs(view.to_index(self.volume)[:, 2]).max()

    def picture(self) -> np.ndarray:
        return itk.array_from_image(self.filter.GetOutput())[0] / self.way + self.background


def angles(rotation: np.ndarray) -> tuple[float, float, float]:
    """Radians about y, x and z, whose rotations in this order are the given one."""
    about_x = math.asin(np.clip(-rotation[1, 2], -1, 1))
    if math.cos(about_x) < 1e-9:
        return math.atan2(-rotation[2, 0], rotation[0, 0]), about_x, 0.0
    about_y = math.atan2(rotation[0, 2], rotation[2, 2])
    return about_y, about_x, math.atan2(rotation[1, 0], rotation[1, 1])

"""VTK's vtkImageSlabReslice, its slab as thick as the whole image."""

from __future__ import annotations

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from peer.volume import Peer, View, Volume
from peer.vtk_volume import axes, make_image


class Projector(Peer):
    """Linear interpolation, a sample every spacing of the picture."""

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        last = volume.width - 1
        self.reslice = vtk.vtkImageSlabReslice(
            number_of_threads=threads,
            background_level=self.background,
            output_dimensionality=2,
            output_spacing=(volume.step,) * 3,
            output_origin=(volume.first, volume.first, 0.0),
            output_extent=(0, last, 0, last, 0, 0),
            slab_resolution=volume.step,
        )
        self.reslice.SetInputData(make_image(volume, threads))
        self.reslice.SetInterpolationModeToLinear()
        self.reslice.SetBlendModeToMax()

    def project(self, view: View) -> None:
        matrix = vtk.vtkMatrix4x4()
        for (row, column), value in np.ndenumerate(axes(self.volume, view)):
            matrix.SetElement(row, column, value)
        self.reslice.SetResliceAxes(matrix)
        self.reslice.SetSlabThickness(2 * view.half_depth(self.volume) * self.volume.step)
        self.reslice.Update()

    def picture(self) -> np.ndarray:
        scalars = self.reslice.GetOutput().GetPointData().GetScalars()
        return vtk_to_numpy(scalars).reshape(self.volume.width, self.volume.width)

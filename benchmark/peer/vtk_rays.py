"""VTK's vtkFixedPointVolumeRayCastMapper, in an off-screen window."""

from __future__ import annotations

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from peer.volume import Peer, View, Volume
from peer.vtk_volume import axes, make_image


class Projector(Peer):
    """The picture is 8 bits of grey from the least to the largest value of the image.

    It is drawn a pixel too wide and too high: the middles of its first and last pixels lie at the edges of its area.
    """

    def __init__(self, volume: Volume, threads: int) -> None:
        super().__init__(volume)
        self.low, self.high = float(volume.voxels.min()), float(volume.voxels.max())
        grey, opacity = vtk.vtkPiecewiseFunction(), vtk.vtkPiecewiseFunction()
        grey.AddSegment(self.low, 0.0, self.high, 1.0)
        opacity.AddSegment(self.low, 1.0, self.high, 1.0)
        properties = vtk.vtkVolumeProperty()
        properties.SetColor(grey)
        properties.SetScalarOpacity(opacity)
        properties.SetInterpolationTypeToLinear()
        mapper = vtk.vtkFixedPointVolumeRayCastMapper(
            number_of_threads=threads,
            auto_adjust_sample_distances=False,
            image_sample_distance=1.0,
            sample_distance=volume.step,
            interactive_sample_distance=volume.step,
        )
        mapper.SetInputData(make_image(volume, threads))
        mapper.SetBlendModeToMaximumIntensity()
        self.renderer = vtk.vtkRenderer()
        self.renderer.AddVolume(vtk.vtkVolume(mapper=mapper, property=properties))
        self.window = vtk.vtkRenderWindow(off_screen_rendering=True, multi_samples=0, size=(volume.width, volume.width))
        self.window.AddRenderer(self.renderer)

    def project(self, view: View) -> None:
        _, down, along = axes(self.volume, view).T
        distance, last = self.volume.diagonal, self.volume.width - 1
        camera = self.renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetFocalPoint(0.0, 0.0, 0.0)
        camera.SetPosition(*(-distance * along))
        camera.SetViewUp(*-down)
        camera.SetParallelScale(self.volume.width * self.volume.step / 2)
        camera.SetClippingRange(distance / 100, 2 * distance)
        self.window.Render()
        self.pixels = vtk.vtkUnsignedCharArray()
        self.window.GetPixelData(0, 0, last, last, 0, self.pixels, 0)

    def picture(self) -> np.ndarray:
        grey = vtk_to_numpy(self.pixels).reshape(self.volume.width, self.volume.width, 3)[::-1, :, 0]
        if np.linalg.det(self.volume.direction) < 0:  # no camera sees the image's mirror image
            grey = grey[:, ::-1]
        return self.low + grey / 255.0 * (self.high - self.low)

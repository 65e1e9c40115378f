"""The image as VTK has it: centered on 0, along the space's axes."""

from __future__ import annotations

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

from peer.volume import View, Volume


def make_image(volume: Volume, threads: int) -> vtk.vtkImageData:
    """The voxels, which must outlive it; also limits the threads of all filters."""
    vtk.vtkMultiThreader.SetGlobalMaximumNumberOfThreads(threads)
    vtk.vtkMultiThreader.SetGlobalDefaultNumberOfThreads(threads)
    vtk.vtkSMPTools.Initialize(threads)
    origin = -volume.center * volume.spacing
    image = vtk.vtkImageData(dimensions=volume.size.tolist(), spacing=volume.spacing.tolist(), origin=origin.tolist())
    image.GetPointData().SetScalars(numpy_to_vtk(volume.voxels.reshape(-1)))
    return image


def axes(volume: Volume, view: View) -> np.ndarray:
    """Directions of u, v and w as columns, along the image's axes."""
    return volume.direction.T @ view.rotation

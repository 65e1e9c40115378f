"""The image and a view as ITK has them."""

from __future__ import annotations

from typing import Any

import itk
import numpy as np

from peer.volume import View, Volume


def make_image(volume: Volume, voxels: np.ndarray, threads: int) -> Any:
    """The voxels, which must outlive it, with the volume's geometry; also limits the threads of all filters."""
    itk.MultiThreaderBase.SetGlobalMaximumNumberOfThreads(threads)
    itk.MultiThreaderBase.SetGlobalDefaultNumberOfThreads(threads)
    image = itk.image_view_from_array(voxels)
    image.SetSpacing(volume.spacing.tolist())
    image.SetOrigin(volume.origin.tolist())
    image.SetDirection(itk.matrix_from_array(np.ascontiguousarray(volume.direction)))
    return image


def make_transform(view: View) -> Any:
    """From view space to physical space."""
    transform = itk.AffineTransform[itk.D, 3].New()
    transform.SetMatrix(itk.matrix_from_array(np.ascontiguousarray(view.rotation)))
    return transform

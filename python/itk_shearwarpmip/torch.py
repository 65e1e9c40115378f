"""Projections of tensors that a network can learn from: mip() has a derivative with respect to the volume.

Needs PyTorch: install the wheel with its extra [torch]
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._front import Turn, turn
from itk_shearwarpmip._inputs import Placed
from itk_shearwarpmip._places import find_coordinates, find_corners, find_places

try:
    import torch
    from torch.autograd.function import once_differentiable
except ImportError as error:
    raise ImportError("itk_shearwarpmip.torch needs PyTorch: install the wheel with its extra [torch]") from error


def mip(volume: torch.Tensor, views: Sequence[Any] | None = None, *, background: float = 0.0, **parameters: Any) -> Any:
    """Exact maximum intensity projections of volumes from many directions, differentiable.

    volume: a tensor (batch, channel, z, y, x) of float32 or float64.
    views: the view of each picture, of any kind that the view of mip() can be. Without views, the parameters of turn()
        define a turn: frames, angular_range, rotation_axis and so on.
    background: the value of pixels beside the volume.
    parameters: spacing, origin and direction, which all volumes share, and all other keywords of turn() that
        `exact` allows: mode, slab, crop, output_spacing, size, output_origin and threads.

    Returns a tensor (batch, channel, view, v, u) of the volume's type, on its device; the computation is the CPU's.

    A pixel is the maximum of the trilinear interpolant along its ray, as in turn(exact=True). So its gradient is the
    eight interpolation weights at the place of this maximum. Where several places have the maximum, the nearest one
    counts. Pixels beside the volume have the gradient 0. There is no second derivative.

    Raises TypeError for other tensors, and the exceptions of turn().

    >>> volume = torch.zeros(1, 1, 4, 5, 6, requires_grad=True)
    >>> pictures = mip(volume, ["anterior", "left"], spacing=(1, 1, 2))
    >>> pictures.shape
    torch.Size([1, 1, 2, 8, 6])
    >>> pictures.sum().backward()
    """
    if not isinstance(volume, torch.Tensor) or volume.ndim != 5 or volume.dtype not in (torch.float32, torch.float64):
        raise TypeError("volume must be a tensor (batch, channel, z, y, x) of float32 or float64")
    if not volume.numel():
        raise ValueError(f"volume must not be empty, but its shape is {tuple(volume.shape)}")
    return _Projection.apply(volume, {"transforms": views, "background": background} | parameters)


class _Projection(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, volume: torch.Tensor, options: dict[str, Any]) -> torch.Tensor:
        voxels = volume.detach().cpu().numpy()
        depth = ctx.needs_input_grad[0]
        ctx.series = [turn(each, depth=depth, exact=True, **options) for batch in voxels for each in batch]
        ctx.volume = volume.new_empty(0), volume.shape
        ctx.geometry = [options.get(name) for name in ("spacing", "origin", "direction")]
        pictures = np.stack([np.asarray(each.frames) for each in ctx.series])
        return torch.from_numpy(pictures.reshape(*volume.shape[:2], *pictures.shape[1:])).to(volume.device)

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, gradient: torch.Tensor) -> tuple[torch.Tensor, None]:
        like, shape = ctx.volume
        placed = Placed(np.empty(shape[2:], np.uint8)).replace(*ctx.geometry)
        gradients = gradient.cpu().double().numpy().reshape(len(ctx.series), -1)
        of_volumes = [_spread(each, placed, of_pictures) for each, of_pictures in zip(ctx.series, gradients)]
        return torch.from_numpy(np.reshape(of_volumes, shape)).to(like), None


def _spread(series: Turn, placed: Placed, gradient: NDArray[np.float64]) -> Any:
    """The gradient of a volume, from the gradient of its pictures."""
    places = find_places(series.frames, series.depths).reshape(-1, 3)
    has_value = ~np.isnan(places[:, 0])
    shape = placed.array.shape
    lower, upper, weights = find_corners(find_coordinates(placed, places[has_value]), shape)
    voxels, parts = [], []
    for corner in product((False, True), repeat=3):
        voxels.append(np.ravel_multi_index(np.where(corner, upper, lower).T[::-1], shape))
        parts.append(gradient[has_value] * np.where(corner, weights, 1 - weights).prod(axis=1))
    return np.bincount(np.concatenate(voxels), np.concatenate(parts), math.prod(shape))

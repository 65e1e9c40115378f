#!/usr/bin/env python3
"""Recovers a vessel tree from some of its MIPs, by gradient descent: itk_shearwarpmip.torch.mip() has a derivative.

vessel_tree.py angiogram.nrrd tree.png
"""

import argparse
import sys
import time
from pathlib import Path

import matplotlib
import numpy as np
import torch
from itk_shearwarpmip import open_image
from itk_shearwarpmip.torch import mip
from matplotlib import pyplot

VOXEL = 3.2  # mm: fine enough for vessels of a head
STEPS_BETWEEN = 10  # of the picture in the middle


def read_vessels(path: Path) -> tuple[torch.Tensor, list[float]]:
    """The brightest hundredth of the voxels, from 0 to 1, in a tensor (1, 1, z, y, x), and their spacing."""
    image = open_image(path)
    factors = [max(1, round(VOXEL / length)) for length in image.GetSpacing()]
    voxels = torch.from_numpy(np.asarray(image).astype(np.float32))[None, None]
    # thin vessels remain
    voxels = torch.nn.functional.max_pool3d(voxels, factors[::-1])
    low, high = np.quantile(voxels, [0.99, 0.9995])
    spacing = [factor * length for factor, length in zip(factors, image.GetSpacing())]
    return ((voxels - low) / max(high - low, 1e-6)).clamp(0, 1), spacing


def find_overlap(found: torch.Tensor, expected: torch.Tensor) -> float:
    """Dice coefficient of the voxels above a half."""
    both = ((found > 0.5) & (expected > 0.5)).sum().item()
    return 2 * both / max(1, ((found > 0.5).sum() + (expected > 0.5).sum()).item())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", type=Path, help="a 3D angiogram, as shear-warp-mip --write-phantom writes one")
    parser.add_argument("output", type=Path, help="a picture: the tree, and what was recovered")
    parser.add_argument("--views", type=int, default=12, help="MIPs over 180 degrees that are given [12]")
    parser.add_argument("--steps", type=int, default=100, help="of the optimizer [100]")
    arguments = parser.parse_args()
    try:
        tree, spacing = read_vessels(arguments.image)
    except (OSError, ValueError, TypeError) as error:
        sys.exit(f"error: {error}")

    turn = {"frames": arguments.views, "angular_range": 180, "spacing": spacing}
    given = mip(tree, **turn)
    torch.manual_seed(1)
    volume = (0.1 * torch.rand_like(tree)).requires_grad_()
    optimizer = torch.optim.Adam([volume], lr=0.1)
    stages = {"the tree": tree}
    start = time.perf_counter()
    for step in range(1, arguments.steps + 1):
        optimizer.zero_grad()
        # most voxels are dark
        loss = (mip(volume, **turn) - given).square().mean() + 0.02 * volume.mean()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            volume.clamp_(0, 1)
        if step in (STEPS_BETWEEN, arguments.steps):
            stages[f"after {step} steps"] = volume.detach().clone()
    seconds = time.perf_counter() - start
    print(
        f"{arguments.steps} steps with {arguments.views} MIPs of {given.shape[-1]} x {given.shape[-2]} pixels: "
        f"{seconds:.0f} s, Dice coefficient {find_overlap(volume, tree):.2f}"
    )

    matplotlib.use("agg")
    # between two of the given views
    unseen = {"start_angle": 90 + 90 / arguments.views, "frames": 1, "spacing": spacing}
    rows = {"given view": {**unseen, "start_angle": 90}, "view not given": unseen}
    figure, panels = pyplot.subplots(
        2, len(stages), squeeze=False, figsize=(2.9 * len(stages), 3.6), layout="constrained", facecolor="black"
    )
    for of_row, (row, view) in zip(panels, rows.items()):
        for panel, (title, stage) in zip(of_row, stages.items()):
            panel.imshow(mip(stage, **view)[0, 0, 0], cmap="gray", vmin=0, vmax=1)
            panel.set_title(f"{title}, {row}", color="white", fontsize=8)
            panel.axis("off")
    try:
        figure.savefig(arguments.output, dpi=100)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()

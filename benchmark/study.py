#!/usr/bin/env python3
"""48 MIPs over 180 degrees of a PET study, with CT and labels where the maxima lie: the package and common pipelines.

SciPy and MONAI turn the volumes about the patient's long axis, and take the maximum along the rays: what scripts for
training data do. Their CT and labels are turned too, and taken where the SUV has its maximum. The package looks them up
at places=True. The study is synthetic: a body with organs and lesions, its three volumes on one grid, in memory.

    pip install "$(echo dist/itk_shearwarpmip-*.whl)[torch]" scipy monai pandas tabulate
    study.py --output results                  # 400x400x326, a few minutes on two cores
    study.py --smoke                           # only whether it works

Peers project --peer-views of the 48 views after a first one, and have the mean of their times. The script fails if the pictures of a peer
differ more from the package's than from those moved by a pixel. SciPy has no threads; the others have --threads.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import itk
import numpy as np
import pandas as pd
from itk_shearwarpmip import open_image, sample, turn

VIEWS, SPACING = 48, (1.65, 1.65, 3.0)  # mm along x, y, z
Study = dict[str, np.ndarray]


def make_study(size: tuple[int, int, int]) -> Study:
    """SUV, CT in HU and labels (z, y, x): a body with noise, three organs and twelve lesions."""
    generator = np.random.default_rng(46)
    z, y, x = (np.linspace(-1, 1, n, dtype=np.float32) for n in size[::-1])

    def find_inside(center: np.ndarray, radii: np.ndarray) -> np.ndarray:
        parts = (((each - c) / r) ** 2 for each, c, r in zip((z, y, x), center, radii))
        of_z, of_y, of_x = parts
        return of_z[:, None, None] + of_y[:, None] + of_x < 1

    labels = find_inside(np.zeros(3), np.array([0.95, 0.45, 0.7])).astype(np.uint8)
    organs = (
        ([0.6, 0, 0], [0.2, 0.25, 0.3]),
        ([0, -0.1, -0.3], [0.2, 0.2, 0.25]),
        ([-0.4, 0.1, 0.2], [0.1, 0.1, 0.15]),
    )
    for label, organ in enumerate(organs, 2):
        labels[find_inside(*map(np.array, organ))] = label
    suv, ct = np.array([0, 1, 6, 3, 4], np.float32)[labels], np.array([-1000, 20, 35, 60, 50], np.int16)[labels]
    for _ in range(12):
        suv[find_inside(generator.uniform(-0.4, 0.4, 3), generator.uniform(0.02, 0.05, 3))] = generator.uniform(8, 20)
    suv += 0.2 * suv * generator.standard_normal(suv.shape, np.float32)
    return {"suv": suv, "ct": ct, "labels": labels}


def find_angle(view: int) -> float:
    return 180 * view / VIEWS


def take(volumes: Study, axis: int) -> Study:
    """The maxima of SUV along an axis, and the other volumes there; the first slice becomes the last row."""
    index = np.expand_dims(volumes["suv"].argmax(axis), axis)
    return {name: np.take_along_axis(each, index, axis).squeeze(axis)[::-1] for name, each in volumes.items()}


def run_scipy(study: Study, threads: int) -> Callable[[int], Study]:
    from scipy import ndimage

    outside = {"suv": 0, "ct": -1000, "labels": 0}

    def project(view: int) -> Study:
        turned = {}
        for name, each in study.items():
            keywords = {"order": 0 if name == "labels" else 1, "cval": outside[name]}
            turned[name] = ndimage.rotate(each, find_angle(view), (1, 2), reshape=False, **keywords)
        return take(turned, 1) if len(turned) > 1 else {"suv": turned["suv"].max(1)[::-1]}

    return project


def run_monai(study: Study, threads: int) -> Callable[[int], Study]:
    import torch
    from monai.transforms import Affine

    torch.set_num_threads(threads)
    tensors = {name: torch.from_numpy(each)[None].float() for name, each in study.items()}

    def project(view: int) -> Study:
        turned = {}
        for name, each in tensors.items():
            mode = "nearest" if name == "labels" else "bilinear"
            turn_by = (-np.radians(find_angle(view)), 0.0, 0.0)
            affine = Affine(turn_by, mode=mode, padding_mode="border" if name == "ct" else "zeros", image_only=True)
            turned[name] = affine(each)[0].as_tensor()
        if len(turned) == 1:
            return {"suv": turned["suv"].amax(1).numpy()[::-1]}
        return take({name: each.numpy() for name, each in turned.items()}, 1)

    return project


PEERS = {"SciPy, rotate": run_scipy, "MONAI, Affine": run_monai}


def measure_ours(study: Study, threads: int, exact: bool) -> Iterator[tuple[str, float, Study]]:
    """All views: SUV, then all three volumes."""
    images = {name: open_image(each, spacing=SPACING) for name, each in study.items()}
    depth, _, width = study["suv"].shape
    grid = {"size": (width, depth), "output_spacing": (SPACING[0], SPACING[2]), "threads": threads}
    grid["output_origin"] = [-(n - 1) / 2 * length for n, length in zip(grid["size"], grid["output_spacing"])]
    keywords = {"frames": VIEWS, "angular_range": 180, "exact": exact, "background": 0, **grid}
    begin = time.perf_counter()
    suv = np.asarray(turn(images["suv"], **keywords).frames)
    yield "SUV", time.perf_counter() - begin, {"suv": suv}
    # as if it were a new study
    images["suv"] = open_image(study["suv"], spacing=SPACING)
    begin = time.perf_counter()
    series = turn(images["suv"], places=True, **keywords)
    ct = sample(images["ct"], series.places, outside=-1000)
    labels = sample(images["labels"], series.places, "nearest", outside=0)
    seconds = time.perf_counter() - begin
    yield "SUV, CT, labels", seconds, {"suv": np.asarray(series.frames), "ct": ct, "labels": labels}


def is_alike(found: np.ndarray, expected: np.ndarray) -> bool:
    """Whether a picture differs less than one that is moved by a pixel."""
    found, expected = found.astype(float), expected.astype(float)
    moved = [np.roll(expected, pixels, axis) for pixels in (-1, 1) for axis in (0, 1)]
    return np.abs(found - expected).mean() < min(np.abs(each - expected).mean() for each in moved)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--output", type=Path, help="folder of study.csv and study.md [none]")
    add("--size", type=int, nargs=3, default=(400, 400, 326), metavar=("X", "Y", "Z"), help="voxels [400 400 326]")
    add("--peer-views", type=int, default=4, help="views that peers project [4]")
    add("--threads", type=int, default=2, help="of the package and of MONAI [2]")
    add("--smoke", action="store_true", help="a small study: the times are void")
    options = parser.parse_args()
    if options.smoke:
        options.size, options.peer_views = (64, 64, 40), 2
    for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = str(options.threads)
    study = make_study(tuple(options.size))
    rows: list[dict[str, Any]] = []
    pictures: dict[str, Study] = {}
    for exact in (False, True):
        for what, seconds, made in measure_ours(study, options.threads, exact):
            pictures.setdefault(what, made)
            name = "ShearWarpMIP" + ", exact" * exact
            rows.append({"": name, "volumes": what, "a view, ms": 1000 * seconds / VIEWS, "48 views, s": seconds})
    views = np.linspace(0, VIEWS, options.peer_views, endpoint=False).astype(int)
    for name, run in PEERS.items():
        for what in pictures:
            try:
                project = run(study if what != "SUV" else {"suv": study["suv"]}, options.threads)
            except ImportError as error:
                print(f"{name} is left out: {error}", file=sys.stderr)
                break
            project(0)
            times = []
            for view in views:
                begin = time.perf_counter()
                found = project(view)
                times.append(time.perf_counter() - begin)
                if wrong := [key for key, each in found.items() if not is_alike(each, pictures[what][key][view])]:
                    sys.exit(f"error: {name}: view {view} differs from the package's: {', '.join(wrong)}")
            mean = float(np.mean(times))
            rows.append({"": name, "volumes": what, "a view, ms": 1000 * mean, "48 views, s": VIEWS * mean})
    table = pd.DataFrame(rows)
    text = table.to_markdown(index=False, floatfmt=".3g")
    if options.output:
        options.output.mkdir(parents=True, exist_ok=True)
        table.to_csv(options.output / "study.csv", index=False)
        (options.output / "study.md").write_text(text + "\n")
    print(f"ITK {itk.Version.GetITKVersion()}, {options.threads} threads\n\n{text}")


if __name__ == "__main__":
    main()

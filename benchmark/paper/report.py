#!/usr/bin/env python3
"""Draws what shear-warp-mip-paper measured and writes REPORT.md about it, into the folder of its results.

report.py FOLDER NAME ORIGIN

NAME says what the data set `image` is, ORIGIN where it comes from. Every number of the page but the paper's own is read
from the folder's files. Fails if one is missing or empty.
"""

from __future__ import annotations

import platform
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from PIL import Image

plt.rcParams.update({"savefig.dpi": 110, "savefig.bbox": "tight"})

VOLUMES = {"mra": "synthetic MR angiogram"}
METHODS = {
    "ray casting": "ray casting",
    "shear warp": "shear warp",
    "shear warp, tagged": "shear warp + reduced resampling by cells",
    "filter, off": "the filter, reduced resampling off",
    "filter, auto": "the filter",
}
ERROR_METHODS = {
    "ray-casting": "ray casting, step 1",
    "ray-casting-half-step": "ray casting, step 1/2",
    "shear-warp": "the filter",
    "shear-warp-oversampled": "the filter, oversampling 2",
}
COLUMNS = ["preparation", "interpolation", "warp", "clip", "total"]

# Fang et al. 2002, table 1: ms on an Athlon of 800 MHz; figure 6: percent
PAPER_TIMES = pd.DataFrame(
    [[0, 2100, 0, 120, 2220, np.nan], [601, 354, 15, 0, 369, np.nan], [1422, 150, 13, 0, 163, 0.83]],
    index=pd.MultiIndex.from_product([["paper"], list(METHODS)[:3]], names=["data", "method"]),
    columns=[*COLUMNS, "skipped"],
)

INTRODUCTION = """\
# Fang et al. 2002 again

L. Fang, Y. Wang, B. Qiu, Y. Qian. Fast Maximum Intensity Projection Algorithm Using Shear Warp Factorization and
Reduced Resampling. Magn Reson Med 47:696-700, 2002.
This page has the paper's table and figures, measured with its methods and with the filter of this module.
`benchmark/paper/run.sh` measures everything again in some minutes, and writes this page.

Machine: {machine}. Data: a synthetic time-of-flight MR angiogram (`mra` of the benchmark) \
and an {image} ({origin}), interpolated to 256 x 256 x 64 voxels and 14 bits."""

TIMES = """\
## Table 1: times

The table has mean milliseconds over 19 angles from 0 to 180 degrees, for 256 x 256 x 64 voxels and one thread.
The first three lines are from the paper (an Athlon of 800 MHz).
*Preparation* is done once for all angles.
The output is fitted to each view, so the number of rays varies.

{table}

The published methods have their published form: equation 1 with clipping of the rays; equation 2 on three permuted
copies; and the same with the number of a cell's largest corner in the two low bits of its first voxel.
All shear-warps and the filter give the same picture, bit by bit.
The shear-warp factorization makes {factor} times as many views a second as ray casting (paper: 6.0).
Reduced resampling by cells multiplies this by {gain} (paper: 2.3).
It skips about as many cells as in the paper, where the test saved multiplications.
Today a sample costs little, and a test that the processor cannot predict costs much.
The filter instead tests tiles of 32 x 8 pixels and eight slices at once, and reads memory in order.
In these small volumes it skipped {skipped}, because it stops testing where that does not pay.

## Figure 4: time against angle

![Time of each method against the angle](figures/figure4.png)

At the dotted lines, the principal axis changes.
{angles}
In the paper, ray casting takes least at 90 degrees, where the rays are fewest.
If slices lie farther apart than their pixels, the rays along x have more samples, which outweighs their number."""

PICTURES = """\
## Figure 5: azimuth 40, altitude 50 degrees

![Figure 5: both methods and their difference](figures/figure5.png)

The difference: {differences}.
It lies at the edges of vessels, as in the paper, because the methods sample at different places:
ray casting every voxel's length on the exact ray, shear-warp once per slice and then between four rays."""

VESSEL = """\
## Figure 6: a vessel with a stenosis

The vessel is an endless cylinder in continuous space, whose diameter narrows to one half.
Its true projection is the maximum along each ray.
The vessel is digitized (1 mm voxels), projected, and compared with the truth where it projects.
The error is the mean magnitude of the difference in percent of the peak, over 19 angles and 4 places between voxels.
The paper has 11.5 % for ray casting and 9.3 % for shear-warp, but not the vessel's direction, radius and profile.
Here the profile is parabolic, and a voxel has the intensity at its center.
The views turn about the grid's y axis, to which the vessel is tilted.

![Figure 6: object, truth and errors](figures/figure6.png)

{errors}

The paper's ratio, 0.81, needs a thin vessel that is strongly tilted to the grid.
Along the grid, ray casting with a step of one voxel has the smaller error."""

SLIPS = """\
## Slips in the paper

The translations t_a and t_b of the appendix are twice too large if the shear is negative.
With t_a = max(0, -s_a (n_k - 1)), the slices begin at the intermediate image's first pixel.
A test of the factorization shows this over random views.
In the comparison of speeds, ray casting takes *longer* than shear-warp by 5.9, not shorter.
An interpolated value is *never larger* than the largest corner, not always smaller."""


def number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def join(values: pd.Series, form: str = "{:.3g}") -> str:
    return " and ".join(map(form.format, values))


def draw(axis: plt.Axes, title: str, picture: np.ndarray, **parameters: object) -> matplotlib.image.AxesImage:
    axis.set_title(title, fontsize=9)
    axis.set_axis_off()
    return axis.imshow(picture, **parameters)


def draw_times(file: Path, times: pd.DataFrame) -> str:
    figure, axes = plt.subplots(1, 2, figsize=(12.4, 4.2))
    texts = []
    for axis, (data, lines) in zip(axes, times.groupby(level="data", sort=False)):
        wide = lines.pivot(index="angle", columns="method", values="total")[list(METHODS)].rename(columns=METHODS)
        wide.plot(ax=axis, logy=True, style=".-", legend=False, title=data, xticks=range(0, 181, 30))
        axis.set(xlabel="angle (degrees)", ylabel="time of a view (ms)")
        axis_at = lines.query("method == 'shear warp'").set_index("angle")["principal_axis"].map(dict(enumerate("xyz")))
        for before, after in zip(axis_at.index, axis_at.index[1:]):
            if axis_at[before] != axis_at[after]:
                middle, label = (before + after) / 2, f" {axis_at[before]} | {axis_at[after]}"
                axis.axvline(middle, color="grey", lw=0.8, ls=":")
                place = {"transform": axis.get_xaxis_transform(), "ha": "center", "va": "top"}
                axis.text(middle, 0.97, label, color="grey", fontsize=8, **place)
        cast, filtered = wide["ray casting"], wide["the filter"]
        texts.append(
            f"In the {data} ray casting takes least at {cast.idxmin()} degrees and most at {cast.idxmax()}, "
            f"{cast.max() / cast.min():.1f} times as long, and the filter's slowest angle "
            f"{filtered.max() / filtered.mean():.2f} times its mean."
        )
    lines = axes[0].get_legend_handles_labels()
    figure.legend(*lines, fontsize=9, loc="upper center", ncol=3, bbox_to_anchor=(0.5, 0.0))
    figure.savefig(file)
    return "\n".join(texts)


def describe_times(folder: Path) -> str:
    files = {title: pd.read_csv(folder / f"table1-{name}.csv") for name, title in VOLUMES.items()}
    times = pd.concat(files, names=["data"]).rename(columns=lambda name: name.removesuffix("_ms"))
    times = times.rename(columns={"skipped_fraction": "skipped"})
    times = times.groupby(["data", "method", "angle"], sort=False).median().reset_index(["method", "angle"])
    means = pd.concat([PAPER_TIMES, times.groupby(["data", "method"], sort=False)[[*COLUMNS, "skipped"]].mean()])
    speed_up = means.xs("ray casting", level="method")["total"] / means["total"]
    ratios = speed_up.unstack("method").loc[list(files)]

    shown = means[COLUMNS].apply(lambda column: column.map(number))
    shown["speed-up"] = speed_up.map("{:.1f}".format)
    skips = means.index.isin(["shear warp, tagged", "filter, auto"], level="method")
    shown["skipped"] = means["skipped"].map("{:.0%}".format).where(skips, "")
    shown = shown.rename(METHODS, level="method").rename(columns={"clip": "clipping"}).reset_index()
    align = ["left"] * 2 + ["right"] * (shown.shape[1] - 2)
    return TIMES.format(
        table=shown.to_markdown(index=False, disable_numparse=True, colalign=align),
        factor=join(ratios["shear warp"]),
        gain=join(ratios["shear warp, tagged"] / ratios["shear warp"]),
        skipped=join(means.xs("filter, auto", level="method")["skipped"], "{:.0%}"),
        angles=draw_times(folder / "figures" / "figure4.png", times),
    )


def describe_pictures(folder: Path) -> str:
    figure, axes = plt.subplots(2, 3, figsize=(12, 8.2), layout="constrained")
    texts = []
    for row, (name, volume) in zip(axes, VOLUMES.items()):
        files = (folder / f"figure5-{name}-{key}.tif" for key in ("raycasting", "shearwarp", "difference"))
        cast, sheared, difference = (np.asarray(Image.open(file), float) for file in files)
        difference *= 100 / cast.max()
        for axis, picture, title in zip(row, (cast, sheared), ("ray casting", "shear-warp")):
            draw(axis, f"{volume}, {title}", picture, cmap="gray", vmax=np.percentile(picture, 99.8))
        image = draw(row[2], "ray casting less shear-warp", difference, cmap="RdBu_r", vmin=-5, vmax=5)
        figure.colorbar(image, ax=row[2], fraction=0.045, label="% of the maximum")
        inside = difference[(cast > 0) & (sheared > 0)]
        magnitude, mean = np.abs(inside).mean(), inside.mean()
        texts.append(f"{volume}: mean magnitude {magnitude:.2f} %, mean {mean:+.2f} % of the maximum")
    figure.savefig(folder / "figures" / "figure5.png")
    return PICTURES.format(differences="; ".join(texts))


def draw_vessel(folder: Path) -> None:
    titles = {
        "section": "a: section, digitized",
        "truth": "b: true projection",
        "ray-casting": "c: ray casting less truth",
        "shear-warp": "d: shear-warp less truth",
        "shear-warp-oversampled": "the same, oversampling 2",
    }
    pictures = [np.asarray(Image.open(folder / f"figure6-{key}.tif"), float) for key in titles]
    bound = 100 * np.abs(pictures[2:]).max()
    figure, axes = plt.subplots(1, len(titles), figsize=(15, 3.4), layout="constrained")
    for n, (axis, title, picture) in enumerate(zip(axes, titles.values(), pictures)):
        if n < 2:
            draw(axis, title, picture, cmap="gray", vmin=0, vmax=1)
        else:
            image = draw(axis, title, 100 * picture, cmap="RdBu_r", vmin=-bound, vmax=bound)
    figure.colorbar(image, ax=axes, fraction=0.01, label="% of the peak")
    figure.savefig(folder / "figures" / "figure6.png")


def describe_vessels(folder: Path) -> str:
    draw_vessel(folder)
    groups = pd.read_csv(folder / "figure6.csv").groupby(["tilt", "radius", "method"])
    means = groups.apply(lambda lines: np.average(lines["error"], weights=lines["pixels"]))
    errors = means.unstack("method")[list(ERROR_METHODS)].rename(columns=ERROR_METHODS)
    errors["the filter / ray casting"] = errors["the filter"] / errors["ray casting, step 1"]
    errors = errors.rename_axis(index={"tilt": "tilt, degrees"}).reset_index()
    return VESSEL.format(errors=errors.to_markdown(index=False, floatfmt=[".0f"] * 2 + [".1f"] * 4 + [".2f"]))


def main() -> None:
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    folder, (image, origin) = Path(sys.argv[1]), sys.argv[2:]
    VOLUMES["image"] = image
    (folder / "figures").mkdir(exist_ok=True)
    cpuinfo = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.*)", cpuinfo.read_text() if cpuinfo.exists() else "")
    machine = f"{model[1] if model else platform.machine()}, {platform.system()}"
    parts = [
        INTRODUCTION.format(machine=machine, image=image, origin=origin),
        describe_times(folder),
        describe_pictures(folder),
        describe_vessels(folder),
        SLIPS,
    ]
    (folder / "REPORT.md").write_text("\n\n".join(parts) + "\n")


if __name__ == "__main__":
    main()

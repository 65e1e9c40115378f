#!/usr/bin/env python3
"""Draws what shear-warp-mip-paper measured and writes REPORT.md about it, into the folder of its results.

report.py FOLDER [NAME [ORIGIN]]

NAME says what the data set `image` is, ORIGIN where it comes from. Every number of the page but the paper's own is read from the folder's files. Fails if one is
missing or without a line.
"""

import csv
import platform
import sys
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

VOLUMES = {"mra": "synthetic MR angiogram", "image": "image"}

# Fang et al. 2002, table 1: ms on an Athlon of 800 MHz
PAPER_TIMES = {
    "ray casting": {"preparation": 0, "interpolation": 2100, "warp": 0, "clip": 120, "total": 2220},
    "shear warp": {"preparation": 601, "interpolation": 354, "warp": 15, "clip": 0, "total": 369},
    "shear warp, tagged": {"preparation": 1422, "interpolation": 150, "warp": 13, "clip": 0, "total": 163},
}
PAPER_SKIPPED = 0.83
PAPER_ERRORS = {"ray-casting": 11.5, "shear-warp": 9.3}  # percent, figure 6

COLUMNS = ["preparation", "interpolation", "warp", "clip", "total"]
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
    "one-sample": "a sample per slice, exact rays",
    "exact-rays": "a sample per slice, exact rays",
    "dense-rays": "16 samples per slice, exact rays",
    "shear-warp": "the filter",
    "shear-warp-oversampled": "the filter, oversampling 2",
    "exact": "the filter, exact",
}
AXES = "xyz"


def read(path: Path) -> list[dict]:
    """The lines of a CSV file; what looks like a number is one."""

    def convert(text: str):
        try:
            return float(text)
        except ValueError:
            return text

    with path.open(newline="") as file:
        lines = [{key: convert(value) for key, value in line.items()} for line in csv.DictReader(file)]
    if not lines:
        sys.exit(f"error: {path} has no line")
    return lines


def group(lines: list[dict], *keys: str) -> dict:
    """Lines by the values of the keys, in the order of the file."""
    groups = defaultdict(list)
    for line in lines:
        groups[tuple(line[key] for key in keys) if len(keys) > 1 else line[keys[0]]].append(line)
    return groups


def mean(lines: list[dict], key: str) -> float:
    """Over all pixels, where the lines say how many they stand for."""
    return float(np.average([line[key] for line in lines], weights=[line.get("pixels", 1.0) for line in lines]))


def mean_of_angles(lines: list[dict], key: str) -> float:
    return float(np.mean([line[key] for line in lines]))


def table(headings: list[str], rows: list[list[str]]) -> str:
    """Text on the left, numbers on the right."""
    rule = ["---"] + ["---:"] * (len(headings) - 1)
    return "\n".join("| " + " | ".join(row) + " |" for row in [headings, rule, *rows])


def number(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def describe_machine() -> str:
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        models = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        processor = models[0].split(":")[1].strip() if models else processor
    return f"{processor}, {platform.system()}"


class Report:
    def __init__(self, folder: Path):
        self.folder = folder
        self.parts: list[str] = []
        (folder / "figures").mkdir(exist_ok=True)

    def add(self, text: str) -> None:
        self.parts.append(text.strip("\n"))

    def add_figure(self, name: str, figure, caption: str) -> None:
        figure.savefig(self.folder / "figures" / name, dpi=110, bbox_inches="tight")
        plt.close(figure)
        self.add(f"![{caption}](figures/{name})")

    def write(self) -> None:
        (self.folder / "REPORT.md").write_text("\n\n".join(self.parts) + "\n")

    # Table 1, figure 4

    def add_times(self, times: dict[str, list[dict]]) -> None:
        self.add(
            "## Table 1: times\n\n"
            "Milliseconds, mean over 19 angles from 0 to 180 degrees, 256 x 256 x 64 voxels, one thread. The first lines are "
            "those of the paper (an Athlon of 800 MHz). *Preparation* is done once for all angles. The output is fitted to "
            "each view, so that the number of rays varies."
        )
        rows = []
        for method, values in PAPER_TIMES.items():
            speed_up = PAPER_TIMES["ray casting"]["total"] / values["total"]
            skipped = f"{PAPER_SKIPPED:.0%}" if method == "shear warp, tagged" else ""
            rows.append(["paper", METHODS[method], *(number(values[c]) for c in COLUMNS), f"{speed_up:.1f}", skipped])
        speed_ups = {}
        skips = {}  # of the last method
        for name, lines in times.items():
            methods = group(lines, "method")
            reference = mean_of_angles(methods["ray casting"], "total_ms")
            for method, measured in methods.items():
                speed_up = reference / mean_of_angles(measured, "total_ms")
                speed_ups[name, method] = speed_up
                skipped = skips[name] = mean_of_angles(measured, "skipped_fraction")
                rows.append(
                    [VOLUMES[name], METHODS[method]]
                    + [number(mean_of_angles(measured, f"{column}_ms")) for column in COLUMNS]
                    + [f"{speed_up:.1f}", f"{skipped:.0%}" if skipped > 0 else ""]
                )
        headings = [
            "data",
            "method",
            "preparation",
            "interpolation",
            "warp",
            "clipping",
            "total",
            "speed-up",
            "skipped",
        ]
        self.add(table(headings, rows))

        names = list(times)
        gains = [speed_ups[name, "shear warp, tagged"] / speed_ups[name, "shear warp"] for name in names]
        self.add(
            "The published methods are run in their published form: equation 1 with clipping of the rays; equation 2 on three "
            "permuted copies; and the same with the number of a cell's largest corner in the two low bits of its first voxel. "
            "All shear-warps give the same picture in every bit, the filter's too. "
            f"The shear-warp factorization makes {' and '.join(number(speed_ups[n, 'shear warp']) for n in names)} times as "
            f"many views a second as ray casting (paper: 6.0). Reduced resampling by cells multiplies this by "
            f"{' and '.join(number(gain) for gain in gains)} (paper: 2.3)"
            + (
                ": it skips about as many cells as in the paper, but a sample costs a processor of today little, and a test whose "
                "outcome it cannot predict much. What the test saved in 2002 was multiplications."
                if max(gains) < 1
                else "."
            )
            + " The filter tests tiles of 32 x 8 pixels and eight slices at once instead, and reads memory in order; in a volume "
            f"as small as this one it skipped {' and '.join(f'{skips[n]:.0%}' for n in names)}, because it goes on testing only where that pays."
        )

        figure, axes = plt.subplots(1, len(times), figsize=(6.2 * len(times), 4.2), squeeze=False)
        for axis, (name, lines) in zip(axes[0], times.items()):
            for method, measured in group(lines, "method").items():
                axis.semilogy(
                    [line["angle"] for line in measured],
                    [line["total_ms"] for line in measured],
                    ".-",
                    label=METHODS[method],
                )
            angles = [(line["angle"], line["principal_axis"]) for line in group(lines, "method")["shear warp"]]
            for (before, old), (after, new) in pairwise(angles):
                if old != new:
                    axis.axvline((before + after) / 2, color="grey", lw=0.8, ls=":")
                    axis.text(
                        (before + after) / 2, 0.97, f" {AXES[int(old)]} | {AXES[int(new)]}", color="grey", fontsize=8,
                        ha="center", va="top", transform=axis.get_xaxis_transform(),
                    )  # fmt: skip
            axis.set(
                title=VOLUMES[name], xlabel="angle (degrees)", ylabel="time of a view (ms)", xticks=range(0, 181, 30)
            )
        figure.legend(
            *axes[0][0].get_legend_handles_labels(), fontsize=9, loc="upper center", ncols=3, bbox_to_anchor=(0.5, 0.0)
        )
        self.add("## Figure 4: time against angle")
        self.add_figure("figure4.png", figure, "Time of each method against the angle")
        texts = []
        for name, lines in times.items():
            by_method = group(lines, "method")
            cast = {line["angle"]: line["total_ms"] for line in by_method["ray casting"]}
            filtered = [line["total_ms"] for line in by_method["filter, auto"]]
            texts.append(
                f"In the {VOLUMES[name]} ray casting takes least at {min(cast, key=cast.get):.0f} degrees and most at "
                f"{max(cast, key=cast.get):.0f}, {max(cast.values()) / min(cast.values()):.1f} times as long, and the filter's slowest "
                f"angle {max(filtered) / np.mean(filtered):.2f} times its mean."
            )
        self.add(
            "Dotted lines: the principal axis changes. "
            + " ".join(texts)
            + " In the paper ray casting takes least at 90 degrees, where the rays are fewest. Where slices lie farther apart than the "
            "pixels in them, the rays along x have more samples, which outweighs that."
        )

    # Figure 5

    def add_pictures(self, names: list[str]) -> None:
        self.add("## Figure 5: azimuth 40, altitude 50 degrees")
        figure, axes = plt.subplots(len(names), 3, figsize=(12, 4.1 * len(names)), squeeze=False, layout="constrained")
        texts = []
        for row, name in zip(axes, names):
            pictures = {
                key: np.asarray(Image.open(self.folder / f"figure5-{name}-{key}.tif"), float)
                for key in ("raycasting", "shearwarp", "difference")
            }
            largest = pictures["raycasting"].max()
            difference = 100 * pictures["difference"] / largest
            bound = 5
            for axis, key, title in zip(row, ("raycasting", "shearwarp"), ("ray casting", "shear-warp")):
                axis.imshow(pictures[key], cmap="gray", vmax=np.percentile(pictures[key], 99.8))
                axis.set_title(f"{VOLUMES[name]}, {title}", fontsize=9)
            image = row[2].imshow(difference, cmap="RdBu_r", vmin=-bound, vmax=bound)
            row[2].set_title("ray casting less shear-warp", fontsize=9)
            figure.colorbar(image, ax=row[2], fraction=0.045, label="% of the maximum")
            for axis in row:
                axis.set_axis_off()
            inside = (pictures["raycasting"] > 0) & (pictures["shearwarp"] > 0)
            texts.append(
                f"{VOLUMES[name]}: mean magnitude {np.abs(difference[inside]).mean():.2f} %, mean "
                f"{difference[inside].mean():+.2f} % of the maximum"
            )
        self.add_figure("figure5.png", figure, "Figure 5: both methods and their difference")
        self.add(
            "The difference: "
            + "; ".join(texts)
            + ". It lies at the edges of vessels, as in the paper, and follows from where "
            "each method samples: ray casting every voxel's length on the exact ray, shear-warp once per slice and then between "
            "four rays."
        )

    # Figure 6

    def add_vessels(self, lines: list[dict]) -> None:
        keys = ("turn", "tilt", "profile", "digitization", "radius")
        settings = group(lines, *keys)
        methods = list(group(lines, "method"))
        shown = [method for method in methods if method != "exact-rays"]
        errors = {
            setting: {method: mean(measured, "mean_absolute") for method, measured in group(members, "method").items()}
            for setting, members in settings.items()
        }

        def name(setting) -> str:
            turn, tilt, profile, digitization, radius = setting
            place = "along the grid" if tilt == 0 else f"tilted {tilt:.0f}°"
            return f"{place}, turned about {'itself' if turn == 'vessel' else 'y'}, {profile}, {digitization}, radius {radius:g}"

        self.add(
            "## Figure 6: a vessel with a stenosis\n\n"
            "An endless cylinder whose diameter narrows to one half, known in continuous space; its true projection is the "
            "maximum along each ray of the continuous object. It is digitized (1 mm voxels), projected, and compared with the truth "
            "over the object's projection: the mean magnitude of the difference in percent of the vessel's peak, mean over 19 angles and 4 places "
            "between the voxels. The paper says neither radius nor profile, nor how the object lies in the grid and is digitized; "
            f"it has {PAPER_ERRORS['ray-casting']} % for ray casting and {PAPER_ERRORS['shear-warp']} % for shear-warp."
        )
        titles = {
            "section": "a: section, digitized",
            "truth": "b: true projection",
            "ray-casting": "c: ray casting less truth",
            "shear-warp": "d: shear-warp less truth",
            "shear-warp-oversampled": "the same, oversampling 2",
        }
        pictures = {key: np.asarray(Image.open(self.folder / f"figure6-{key}.tif"), float) for key in titles}
        bound = max(100 * np.abs(pictures[key]).max() for key in list(titles)[2:])
        figure, axes = plt.subplots(1, len(titles), figsize=(15, 3.4), layout="constrained")
        for axis, (key, title) in zip(axes, titles.items()):
            if key in ("section", "truth"):
                axis.imshow(pictures[key], cmap="gray", vmin=0, vmax=1)
            else:
                image = axis.imshow(100 * pictures[key], cmap="RdBu_r", vmin=-bound, vmax=bound)
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()
        figure.colorbar(image, ax=axes, fraction=0.01, label="% of the peak")
        self.add_figure("figure6.png", figure, "Figure 6: object, truth and errors")

        rows = []
        for setting, values in errors.items():
            ratios = [f"{values[m] / values['ray-casting']:.2f}" for m in ("shear-warp", "shear-warp-oversampled")]
            rows.append([name(setting), *(f"{values[method]:.2f}" for method in shown), *ratios])
        headings = [
            "vessel",
            *(ERROR_METHODS[method] for method in shown),
            "filter / ray casting",
            "oversampled / ray casting",
        ]
        self.add(
            "<details><summary>All settings (percent of the peak)</summary>\n\n"
            + table(headings, rows)
            + "\n\n</details>"
        )

        self.add("### Oversampling, tilted vessels\n")
        rows = []
        for (turn, tilt, profile, digitization), members in group(lines, *keys[:4]).items():
            small = [
                errors[turn, tilt, profile, digitization, radius]
                for radius in sorted({line["radius"] for line in members})
                if 2 <= radius <= 4
            ]
            ratio = [
                [e[m] / e["ray-casting"] for e in small]
                for m in ("ray-casting-half-step", "shear-warp", "shear-warp-oversampled")
            ]
            rows.append(
                [name((turn, tilt, profile, digitization, 0)).rsplit(",", 1)[0]]
                + [f"{min(values):.2f} to {max(values):.2f}" for values in ratio]
            )
        self.add(
            "Errors as multiples of that of ray casting with step 1, radius 2 to 4 voxels:\n\n"
            + table(
                [
                    "vessel",
                    *(ERROR_METHODS[m] for m in ("ray-casting-half-step", "shear-warp", "shear-warp-oversampled")),
                ],
                rows,
            )
        )

        self.add("### What gives 11.5 and 9.3 %\n")
        self.add(
            "The settings that come nearest to the paper's pair of numbers, with the error in percent of the peak or of the "
            "truth's mean over the object; first as means over the 19 angles, then at single ones, since the paper speaks of one "
            "projection angle:\n\n"
            + self.find_nearest(lines, keys, name)
            + "\n\n"
            + self.find_nearest(lines, (*keys, "angle"), lambda setting: f"{name(setting[:-1])}, {setting[-1]:.0f}°")
            + "\n\nThe paper's ratio takes a thin vessel with a parabolic profile that is strongly tilted to the grid. Along the grid, or "
            "with a uniform profile, ray casting with a step of one voxel mostly has the smaller error."
        )

    @staticmethod
    def find_nearest(lines: list[dict], keys: tuple, describe) -> str:
        candidates = []
        for setting, members in group(lines, *keys).items():
            by_method = group(members, "method")
            for unit, scale in (("the peak", 1.0), ("the mean truth", 100 / mean(members, "mean_truth"))):
                values = [scale * mean(by_method[method], "mean_absolute") for method in PAPER_ERRORS]
                distance = float(np.hypot(*(v / p - 1 for v, p in zip(values, PAPER_ERRORS.values()))))
                candidates.append((distance, setting, unit, values))
        candidates.sort(key=lambda candidate: candidate[0])
        rows = [
            [description, unit, *(f"{value:.1f}" for value in values), f"{values[1] / values[0]:.2f}"]
            for description, unit, values in [("paper", "", [*PAPER_ERRORS.values()])]
            + [(describe(setting), unit, values) for _, setting, unit, values in candidates[:5]]
        ]
        return table(["vessel", "percent of", "ray casting", "shear-warp", "ratio"], rows)

    # One step further

    def add_sphere(self, errors: dict[str, list[dict]], jumps: dict[str, list[dict]]) -> None:
        self.add(
            "## Against the exact maximum\n\n"
            "The filter takes one sample per slice and interpolates a second time in the warp. With `Exact` it finds the maximum of the trilinear "
            "interpolant on each pixel's ray in closed form. That is the reference here: each method is measured against it, from all sides. "
            "Percent of the data's range; *largest*: the largest error of all views; *underestimated*: pixels that are more than 0.1 % too low. "
            "The other columns are means over the views."
        )
        rows = []
        for name, lines in errors.items():
            for method, measured in group(lines, "method").items():
                values = {
                    key: mean(measured, key)
                    for key in ("mean_absolute", "percentile99", "largest", "mean", "underestimated")
                }
                values["largest"] = max(line["largest"] for line in measured)
                rows.append([VOLUMES[name], ERROR_METHODS[method], *(f"{value:.3g}" for value in values.values())])
        self.add(
            table(["data", "method", "mean magnitude", "99th percentile", "largest", "mean", "underestimated, %"], rows)
        )

        shown = ["ray-casting", "one-sample", "shear-warp", "shear-warp-oversampled"]
        for name, lines in errors.items():
            by_method = group(lines, "method")
            largest = max(line["mean_absolute"] for line in by_method["shear-warp"])
            figure, axes = plt.subplots(1, len(shown), figsize=(4 * len(shown), 4), layout="constrained")
            for axis, method in zip(axes, shown):
                measured = by_method[method]
                azimuth = np.radians([line["azimuth"] for line in measured])
                # equal areas
                radius = np.sqrt(2) * np.sin(
                    np.radians(90 - np.array([abs(line["elevation"]) for line in measured])) / 2
                )
                points = axis.scatter(
                    radius * np.sin(azimuth), radius * np.cos(azimuth), c=[line["mean_absolute"] for line in measured],
                    s=60, vmin=0, vmax=largest, cmap="viridis",
                )  # fmt: skip
                axis.set_title(ERROR_METHODS[method], fontsize=9)
                axis.set_aspect("equal")
                axis.set_axis_off()
            figure.colorbar(points, ax=axes, label="mean magnitude of the error, % of the range", fraction=0.02)
            figure.suptitle(VOLUMES[name], fontsize=10)
            self.add_figure(f"sphere-{name}.png", figure, f"Errors over the half sphere of views, {VOLUMES[name]}")
        self.add("The half sphere of directions as seen from its pole, in equal areas.")

        self.add(
            "### From frame to frame\n\n"
            "A turn from 0 to 90 degrees, at two elevations. *A degree*: the mean change of a pixel from frame to frame, mean over the turn, in percent of the "
            "range. *At the switch*: the mean and the largest change where the principal axis changes, over 0.002 degrees, in which the picture "
            "changes next to nothing."
        )
        rows = []
        switch_methods = ["exact", "dense-rays", "one-sample", "shear-warp", "shear-warp-oversampled"]
        for name, lines in jumps.items():
            for method in switch_methods:
                row = [VOLUMES[name], ERROR_METHODS[method]]
                for elevation in sorted({line["elevation"] for line in lines}):
                    own = [line for line in lines if line["elevation"] == elevation and line["method"] == method]
                    frames = [line for line in own if line["step"] > 0.01]
                    switches = [line for line in own if line["step"] <= 0.01]
                    row.append(number(mean(frames, "mean")))
                    row.append(
                        f"{mean(switches, 'mean'):.3g}, {max(line['largest'] for line in switches):.3g}"
                        if switches
                        else ""
                    )
                rows.append(row)
        self.add(
            table(
                ["data", "method", "elevation 0: a degree", "at the switch", "elevation 30: a degree", "at the switch"],
                rows,
            )
        )
        figure, axes = plt.subplots(1, len(jumps), figsize=(6.2 * len(jumps), 3.8), squeeze=False)
        for axis, (name, lines) in zip(axes[0], jumps.items()):
            frames = [line for line in lines if line["step"] > 0.01 and line["elevation"] > 0]
            for method in ("exact", "shear-warp", "shear-warp-oversampled"):
                own = [line for line in frames if line["method"] == method]
                axis.plot(
                    [line["azimuth"] for line in own], [line["mean"] for line in own], lw=1, label=ERROR_METHODS[method]
                )
            axis.set(
                title=f"{VOLUMES[name]}, elevation 30",
                xlabel="azimuth (degrees)",
                ylabel="change in a step (% of the range)",
            )
        axes[0][0].legend(fontsize=8)
        self.add_figure("jumps.png", figure, "Change from frame to frame")

        self.add(
            "The jump where the principal axis changes is that of the single samples, since it is there with exact rays too. Exact maxima have "
            "no principal axis and do not jump."
        )


def main() -> None:
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    VOLUMES["image"] = sys.argv[2] if len(sys.argv) > 2 else VOLUMES["image"]
    origin = f" ({sys.argv[3]})" if len(sys.argv) > 3 else ""
    folder = Path(sys.argv[1])
    report = Report(folder)
    names = [name for name in VOLUMES if (folder / f"table1-{name}.csv").exists()]
    report.add(
        "# Fang et al. 2002 again\n\n"
        "Z. Fang, Y. Wang, B. Qiu, L. Li, J. Xu. Fast Maximum Intensity Projection Algorithm Using Shear Warp Factorization and Reduced "
        "Resampling. Magn Reson Med 47:696-700, 2002: its table and its figures, measured with its methods and with the filter of this "
        "module. This page is written by `benchmark/paper/run.sh`, which repeats everything in some minutes.\n\n"
        f"Machine: {describe_machine()}. Data: a synthetic time-of-flight MR angiogram (`mra` of the benchmark)"
        + (f" and an {VOLUMES['image']}{origin}, interpolated to" if "image" in names else ", of")
        + " 256 x 256 x 64 voxels and 14 bits."
    )
    report.add_times({name: read(folder / f"table1-{name}.csv") for name in names})
    report.add_pictures(names)
    report.add_vessels(read(folder / "figure6.csv"))
    report.add_sphere(
        {name: read(folder / f"sphere-{name}.csv") for name in names},
        {name: read(folder / f"jump-{name}.csv") for name in names},
    )
    report.add(
        "## Slips in the paper\n\n"
        "The translations t_a and t_b of the appendix are twice too large where the shear is negative: with t_a = max(0, -s_a (n_k - 1)) the "
        "slices begin at the intermediate image's first pixel, as a test of the factorization shows over random views. In the comparison of speeds "
        "the time of ray casting is *longer* than that of shear-warp by 5.9, not shorter; and an interpolated value is *never larger* than the largest "
        "corner, not always smaller."
    )
    report.write()


if __name__ == "__main__":
    main()

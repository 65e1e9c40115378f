"""Draws the pictures of the documentation, with the module itself and its measured numbers.

figures.py IMAGE FOLDER

IMAGE is the head that `shear-warp-mip --write-phantom` makes. tools/docs.sh --figures runs this.
"""

import re
import sys
from pathlib import Path

import itk
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection
from PIL import Image, ImageOps

ROOT = Path(__file__).parent.parent
AZIMUTH, ELEVATION = -30, 20
CUBE = 8  # voxels along each side of a cube
TISSUE = 400  # and noise, below
TILE = 32  # columns of a tile; it has CUBE rows
BLUE, ORANGE, GREEN = "#2060c0", "#e07000", "#109050"
GREYS = {"cmap": "gray", "vmin": 0, "interpolation": "nearest"}

plt.rcParams.update({"font.size": 9, "axes.titlesize": 9, "svg.hashsalt": "0", "svg.fonttype": "none"})


class Steps:
    """One view of an image, step by step."""

    def __init__(self, image):
        direction = itk.ShearWarpMIPViewEnums.Direction_Anterior
        self.image = image
        self.view = itk.ShearWarpMIPView.MakeTransform(image, direction, AZIMUTH, ELEVATION)
        mip = itk.ShearWarpMIPImageFilter.New(image, transform=self.view)
        mip.Update()
        self.output = mip.GetOutput()
        self.factorization = itk.ShearWarpFactorization(self.view, image, self.output)
        self.shear = np.array(list(self.factorization.GetShear()))
        self.translation = np.array(list(self.factorization.GetTranslation()))
        self.size = list(self.factorization.GetIntermediateSize())
        permutation = list(self.factorization.GetPermutation())
        # slices, rows, columns
        self.voxels = itk.array_view_from_image(image).transpose([2 - axis for axis in reversed(permutation)])

        # seen along the sheared volume's slices the warp is the identity, so that the output is the intermediate image
        sheared_to_view = itk.array_from_matrix(self.factorization.GetShearedToViewMatrix())
        matrix = itk.array_from_matrix(self.view.GetMatrix()) @ sheared_to_view[:3, :3]
        self.sheared_to_physical = itk.AffineTransform[itk.D, 3].New()
        self.sheared_to_physical.SetMatrix(itk.matrix_from_array(np.ascontiguousarray(matrix)))
        self.sheared_to_physical.SetTranslation(
            list(self.view.TransformPoint(list(map(float, sheared_to_view[:3, 3]))))
        )

    def offset(self, slice_number):
        """Where voxel (0, 0) of a slice lies in the intermediate image."""
        return self.shear * slice_number + self.translation

    def intermediate(self, begin, end):
        """What slices [begin, end) leave in the intermediate image; -1 where none of them is."""
        image = itk.image_from_array(itk.array_view_from_image(self.image).astype(np.float32))
        image.CopyInformation(self.image)
        return itk.array_from_image(
            itk.shear_warp_mip_image_filter(
                image,
                transform=self.sheared_to_physical,
                size=self.size,
                output_spacing=[1.0, 1.0],
                output_origin=[0.0, 0.0],
                slab_near=begin - 0.5,
                slab_far=end - 0.5,
                default_pixel_value=-1,
            )
        )


def save(figure, path):
    figure.savefig(
        path, bbox_inches="tight", pad_inches=0.05, dpi=110, metadata={"Date": None} if path.suffix == ".svg" else {}
    )
    plt.close(figure)
    if path.suffix == ".png":
        picture = Image.open(path).convert("RGB")
        picture = picture.crop(ImageOps.invert(picture).getbbox())
        picture.quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)


def draw_geometry(path, steps):
    """The anterior view at azimuth 30 and elevation 20 beside the patient, and what is seen."""
    view = itk.ShearWarpMIPView.MakeTransform(steps.image, itk.ShearWarpMIPViewEnums.Direction_Anterior, 30.0, 20.0)
    figure = plt.figure(figsize=(9, 3.6))
    axes = figure.add_axes((0, -0.1, 0.52, 1.2), projection="3d", proj_type="ortho")
    turn, rise = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
    head = np.stack((np.cos(turn) * np.sin(rise), np.sin(turn) * np.sin(rise), np.cos(rise)))
    axes.plot_wireframe(*(head * np.array([70, 90, 75])[:, None, None]), color="#b0b0b0", linewidth=0.5)
    axes.plot((-10, 0, 10), (-84, -104, -84), (-12, -16, -12), color="#808080")
    axes.text(0, -112, -24, "nose", color="#808080", ha="center", va="top")
    for direction, name, alignment in (
        (0, "x: left", "left"),
        (1, "y: posterior", "center"),
        (2, "z: superior", "center"),
    ):
        tip = np.eye(3)[direction] * 130
        axes.quiver(0, 0, 0, *tip, color=ORANGE, arrow_length_ratio=0.08)
        axes.text(*(tip * 1.12), name, color=ORANGE, ha=alignment)

    def at(*point):
        return np.array(list(view.TransformPoint(list(map(float, point)))))

    plane = -190
    corners = ((-80, -80), (80, -80), (80, 80), (-80, 80), (-80, -80))
    axes.plot(*np.array([at(u, v, plane) for u, v in corners]).T, color=BLUE)
    for u, v, w, name in ((1, 0, 0, "u"), (0, 1, 0, "v"), (0, 0, 1, "w")):
        start, tip = at(-80, -80, plane), at(-80 + 60 * u, -80 + 60 * v, plane + 60 * w)
        axes.quiver(*start, *(tip - start), color=BLUE, arrow_length_ratio=0.15, linewidth=2)
        label = at(-80 + 66 * u - 14 * v, -80 + 14 * u + 60 * v - 8 * w, plane + 70 * w)
        axes.text(*label, name, color=BLUE, fontweight="bold", ha="center")
    for begin, end, style in ((plane, -90, "-"), (-90, 90, ":"), (90, 150, "-")):
        axes.plot(*np.array([at(20, 10, begin), at(20, 10, end)]).T, color=BLUE, linestyle=style, linewidth=1)
    axes.plot(*at(20, 10, plane), "o", color=BLUE, markersize=4)
    axes.text(*at(20, 0, plane), "(u, v)", color=BLUE, ha="center")
    axes.set(xlim=(-150, 150), ylim=(-180, 120), zlim=(-150, 150))
    axes.set_box_aspect((1, 1, 1), zoom=1.45)
    axes.view_init(elev=25, azim=-20)
    axes.set_axis_off()

    axes = figure.add_axes((0.63, 0.14, 0.36, 0.84))
    mip = itk.shear_warp_mip_image_filter(steps.image, transform=view)
    (left, top), (width, height) = mip.GetOrigin(), mip.GetSpacing()
    pixels = itk.array_view_from_image(mip)
    right, bottom = left + (pixels.shape[1] - 0.5) * width, top + (pixels.shape[0] - 0.5) * height
    axes.imshow(pixels, extent=(left - width / 2, right, bottom, top - height / 2), **GREYS)
    axes.plot(0, 0, "+", color=BLUE, markersize=12)
    axes.set(xlabel="u, mm", ylabel="v, mm")
    save(figure, path)


def draw_shear(path, steps):
    """A cut through the slices with some rays, before and after the shear."""
    row = steps.voxels.shape[1] // 2
    cut = steps.voxels[:, row, :]
    slices, columns = cut.shape
    low, high = sorted((steps.offset(0)[0], steps.offset(slices - 1)[0]))
    sheared = np.full((slices, int(np.ceil(high - low)) + columns), np.nan)
    pixels = np.arange(sheared.shape[1])
    for k in range(slices):
        sheared[k] = np.interp(pixels - steps.offset(k)[0], np.arange(columns), cut[k], np.nan, np.nan)

    figure, (left, right) = plt.subplots(
        1, 2, figsize=(9, 4), gridspec_kw={"width_ratios": [columns, sheared.shape[1]]}, layout="constrained"
    )
    left.imshow(cut, **GREYS)
    right.imshow(np.where(np.isnan(sheared), 1.15 * cut.max(), sheared), **GREYS)
    for pixel in range(30, sheared.shape[1], 50):
        inside = pixel - steps.offset(np.arange(slices)[:, None])[:, 0]
        met = np.flatnonzero((inside >= -0.5) & (inside <= columns - 0.5))
        if met.size > 20:
            left.annotate(
                "", (inside[met[-1]], met[-1]), (inside[met[0]], met[0]), arrowprops={"arrowstyle": "->", "color": BLUE}
            )
            right.annotate("", (pixel, met[-1]), (pixel, met[0]), arrowprops={"arrowstyle": "->", "color": BLUE})
    for n in range(0, slices, 32):
        left.plot([-0.5, columns - 0.5], [n, n], color=ORANGE, linewidth=0.6)
        offset = steps.offset(n)[0]
        right.plot([offset - 0.5, offset + columns - 0.5], [n, n], color=ORANGE, linewidth=0.6)
    left.set(title="slices of the image, and rays", xlabel="column i", ylabel="slice k")
    right.set(
        title=f"sheared: $s_a$ = {steps.shear[0]:.3f}, $t_a$ = {steps.translation[0]:.1f}",
        xlabel="column p",
        xlim=(-0.5, None),
    )
    right.set_yticks([])
    save(figure, path)


def find_cube_maxima(voxels):
    """The maxima of cubes of voxels; those at the ends may be smaller."""
    padded = np.pad(voxels, [(0, -length % CUBE) for length in voxels.shape])
    slices, rows, columns = (length // CUBE for length in padded.shape)
    return padded.reshape(slices, CUBE, rows, CUBE, columns, CUBE).max(axis=(1, 3, 5))


def draw_prepared(path, steps, group):
    """A slice, and the maxima of the cubes that it belongs to."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 2.6), layout="constrained")
    k = group * CUBE + CUBE // 2
    cubes = find_cube_maxima(steps.voxels)[group]
    rows, columns = steps.voxels.shape[1:]
    axes[0].imshow(steps.voxels[k], **GREYS, vmax=900, origin="lower")
    axes[0].set(title=f"slice {k}: {columns} x {rows} voxels")
    axes[1].imshow(cubes, **GREYS, vmax=900, origin="lower")
    axes[1].set(
        title=f"maxima of slices {group * CUBE} to {group * CUBE + CUBE - 1}: {cubes.shape[1]} x {cubes.shape[0]} cubes"
    )
    for one in axes:
        one.set_axis_off()
    save(figure, path)


def draw_sampling(path, steps, slices):
    """A few voxels of a slice, and where the pixels of the intermediate image lie between them."""
    k = max(slices, key=lambda n: -np.abs(steps.offset(n) % 1 - 0.4).max())
    offset = steps.offset(k)
    fraction = offset - np.floor(offset)
    brightest = np.unravel_index(np.argmax(steps.voxels[k]), steps.voxels[k].shape)
    row, column = (int(np.clip(n, 4, length - 5)) for n, length in zip(brightest, steps.voxels[k].shape))
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    placed = steps.intermediate(k, k + 1)
    axes[0].imshow(np.where(placed < 0, 300, placed), **GREYS, vmax=900, origin="lower")
    axes[0].set(title=f"slice {k} in the intermediate image", xlabel="column p", ylabel="row")

    window = np.s_[row - 3 : row + 4, column - 3 : column + 4]
    extent = (column - 3.5, column + 3.5, row - 3.5, row + 3.5)
    axes[1].imshow(steps.voxels[k][window], **GREYS, extent=extent, origin="lower")
    across, up = np.meshgrid(np.arange(column - 3, column + 4), np.arange(row - 3, row + 4))
    axes[1].plot(across.ravel(), up.ravel(), "s", color=ORANGE, markersize=4, label="voxel centers")
    axes[1].plot(
        (across - fraction[0]).ravel(), (up - fraction[1]).ravel(), "o", color=BLUE, markersize=4, label="pixels"
    )
    axes[1].set(
        title=f"x = {fraction[0]:.3f}, y = {fraction[1]:.3f} for every pixel",
        xlabel="column i",
        ylabel="row j",
        xlim=extent[:2],
        ylim=extent[2:],
    )
    figure.legend(loc="outside right upper")
    save(figure, path)


def draw_intermediate(path, steps):
    """The maximum of ever more slices."""
    slices = steps.voxels.shape[0]
    figure, axes = plt.subplots(1, 3, figsize=(9, 2), layout="constrained")
    for one, part in zip(axes, (4, 2, 1)):
        pixels = steps.intermediate(0, slices // part)
        one.imshow(np.where(pixels < 0, 300, pixels), **GREYS, vmax=900, origin="lower")
        one.set(title=f"slices 0 to {slices // part - 1}")
        one.set_axis_off()
    save(figure, path)


def suppress_tissue(image):
    """The vessels of the head alone, 0 elsewhere."""
    voxels = itk.array_from_image(image)
    voxels[voxels < TISSUE] = 0
    vessels = itk.image_from_array(voxels)
    vessels.CopyInformation(image)
    return vessels


def draw_skipping(path, steps, group):
    """Tiles of the intermediate image that eight slices cannot change, after all the others."""
    before = np.maximum(
        steps.intermediate(0, group * CUBE), steps.intermediate((group + 1) * CUBE, steps.voxels.shape[0])
    )
    cubes = find_cube_maxima(steps.voxels)[group]
    rows, columns = steps.voxels.shape[1:]
    offsets = np.array([steps.offset(group * CUBE + n) for n in range(CUBE)])
    first, last = np.floor(offsets.min(axis=0)).astype(int), np.ceil(offsets.max(axis=0)).astype(int)
    tiles = np.full((-(-before.shape[0] // CUBE), -(-before.shape[1] // TILE)), np.nan)
    for tile in np.ndindex(tiles.shape):
        part = before[tile[0] * CUBE : (tile[0] + 1) * CUBE, tile[1] * TILE : (tile[1] + 1) * TILE]
        # every voxel that a sample of the tile may come from
        low = np.array([tile[1] * TILE, tile[0] * CUBE]) - last - 1
        high = np.array([tile[1] * TILE + part.shape[1] - 1, tile[0] * CUBE + part.shape[0] - 1]) - first
        if (high < 0).any() or (low >= [columns, rows]).any():
            continue
        (i, j), (i_end, j_end) = np.maximum(low, 0) // CUBE, np.minimum(high, [columns - 1, rows - 1]) // CUBE + 1
        tiles[tile] = cubes[j:j_end, i:i_end].max() <= part[part >= 0].min(initial=np.inf)
    figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
    axes.imshow(np.where(before < 0, 300, before), **GREYS, vmax=900, origin="lower")
    for (row, column), is_skipped in np.ndenumerate(tiles):
        if not np.isnan(is_skipped):
            corner = (column * TILE - 0.5, row * CUBE - 0.5)
            colour = GREEN if is_skipped else ORANGE
            axes.add_patch(
                plt.Rectangle(corner, TILE, CUBE, facecolor=colour, alpha=0.35, edgecolor=colour, linewidth=0.5)
            )
    axes.set(
        title=f"slices {group * CUBE} to {group * CUBE + CUBE - 1}, last: {100 * np.nanmean(tiles):.0f} % of the tiles cannot change (green)",
        xlim=(-0.5, before.shape[1] - 0.5),
        ylim=(-0.5, before.shape[0] - 0.5),
    )
    axes.set_axis_off()
    save(figure, path)


def draw_warp(path, steps):
    """The output's grid in the intermediate image, and the output."""
    pixels = steps.intermediate(0, steps.voxels.shape[0])
    output = itk.array_view_from_image(steps.output)
    matrix = itk.array_from_matrix(steps.factorization.GetOutputToIntermediateMatrix())
    rows, columns = output.shape
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    axes[0].imshow(np.where(pixels < 0, 300, pixels), **GREYS, vmax=900, origin="lower")
    lines = [[(c, 0), (c, rows - 1)] for c in range(0, columns, 20)] + [
        [(0, r), (columns - 1, r)] for r in range(0, rows, 20)
    ]
    ends = np.array(lines, dtype=float)
    ends = np.concatenate((ends, np.ones((*ends.shape[:2], 1))), axis=2) @ matrix.T
    axes[0].add_collection(LineCollection(ends[..., :2], colors=BLUE, linewidths=0.6))
    axes[0].set(title="intermediate image, every 20th line of the output's grid")
    axes[0].autoscale()
    axes[0].set_aspect("equal")
    axes[1].imshow(output, **GREYS, vmax=900)
    axes[1].set(title=f"output: {columns} x {rows} pixels")
    for one in axes:
        one.set_axis_off()
    save(figure, path)


def read_table(path, heading):
    """The rows below the table's line that begins with `heading`."""
    lines = path.read_text(encoding="utf-8").splitlines()
    begin = next((n for n, line in enumerate(lines) if line.startswith(heading)), None)
    if begin is None:
        sys.exit(f"error: {path} has no table {heading}")
    rows = []
    for line in lines[begin + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip(" `") for cell in line.strip("|").split("|")])
    return rows


def draw_speed(path):
    """Times of packages, by the benchmark's table: the mean, and from the fastest view to the slowest."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 2.4), layout="constrained", sharey=True)
    for one, size in zip(axes, ("256x256x64", "512x512x512")):
        rows = [row for row in read_table(ROOT / "benchmark" / "README.md", f"| `{size}` |") if "first" not in row[0]]
        names = [row[0].replace("`", "") for row in rows]
        times = np.array([[float(re.match(r"[\d.]+", cell)[0]) for cell in row[2:]] for row in rows])
        colours = [ORANGE] + [BLUE] * (len(rows) - 1)
        one.hlines(names, times.min(axis=1), times.max(axis=1), colors=colours)
        one.scatter(times.mean(axis=1), names, color=colours)
        one.set(xscale="log", xlabel="ms a view", title=size)
        one.grid(alpha=0.3)
    axes[0].invert_yaxis()
    save(figure, path)


def draw_memory(path):
    """Peak memory against the number of divisions, by the table of the page."""
    rows = read_table(ROOT / "doc" / "speed-and-memory.md", "| divisions |")
    divisions, along_z, along_x = np.array([[float(cell) for cell in row] for row in rows]).T
    figure, axes = plt.subplots(figsize=(4.5, 2.6), layout="constrained")
    axes.loglog(divisions, along_x, "o-", color=ORANGE, label="view along the image's x axis")
    axes.loglog(divisions, along_z, "o-", color=BLUE, label="other views")
    axes.set(
        xlabel="divisions",
        ylabel="peak memory, MB",
        xticks=divisions,
        xticklabels=[f"{n:.0f}" for n in divisions],
        ylim=(20, 4000),
    )
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend()
    save(figure, path)


def draw_exact(path, steps):
    """A ray between slices, and the interpolant along it."""
    _, rows, columns = steps.voxels.shape
    # the ray of the largest voxel's neighbourhood, between the centers of voxels
    k, j, i = np.unravel_index(np.argmax(steps.voxels), steps.voxels.shape)
    peak = np.array([i, j]) + steps.offset(k)

    def interpolate(s, p, q):
        x, y = (np.array([p, q])[:, None] - steps.offset(s[:, None]).T).clip(0, [[columns - 1.001], [rows - 1.001]])
        base = [np.floor(value).astype(int) for value in (s, y, x)]
        parts = [value - whole for value, whole in zip((s, y, x), base)]
        result = 0
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod([part if side else 1 - part for part, side in zip(parts, corner)], axis=0)
            result = result + weight * steps.voxels[tuple(whole + side for whole, side in zip(base, corner))]
        return result

    first, last = k - 3, k + 4
    s = np.linspace(first, last, 2001)
    at_slices = np.arange(first, last + 1).astype(float)

    def find_missed(ray):
        return interpolate(s, *ray).max() - interpolate(at_slices, *ray).max()

    # of the rays beside it that whose samples miss most
    p, q = max(((*peak, dp, dq) for dp in np.arange(-1, 1, 0.1) for dq in np.arange(-1, 1, 0.1)), key=find_missed)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), width_ratios=(1, 2), layout="constrained")
    x = p - (steps.shear[0] * s + steps.translation[0])
    cut = steps.voxels[first : last + 1, j, int(x.min()) - 2 : int(x.max()) + 4]
    begin = int(x.min()) - 2
    left.imshow(cut, extent=(begin - 0.5, begin + cut.shape[1] - 0.5, last + 0.5, first - 0.5), **GREYS)
    left.vlines(np.arange(begin, begin + cut.shape[1]), first, last, color=BLUE, linewidth=0.5)
    left.hlines(np.arange(first, last + 1), begin, begin + cut.shape[1] - 1, color=BLUE, linewidth=0.5)
    left.annotate("", (x[-1], last), (x[0], first), arrowprops={"arrowstyle": "->", "color": ORANGE, "linewidth": 2})
    left.set(xlabel="column", ylabel="slice", aspect="auto")

    values = interpolate(s, p, q)
    right.plot(s, values, color=ORANGE)
    crossings = [
        (p_or_q - offset - whole) / shear
        for p_or_q, offset, shear in zip((p, q), steps.translation, steps.shear)
        for whole in range(-1, max(rows, columns))
        if shear and first < (p_or_q - offset - whole) / shear < last
    ]
    right.vlines(crossings, *right.get_ylim(), color=BLUE, linewidth=0.5, linestyle=":")
    right.vlines(np.arange(first, last + 1), *right.get_ylim(), color=BLUE, linewidth=0.5)
    right.plot(at_slices, interpolate(at_slices, p, q), "o", color=BLUE, label="a sample in each slice")
    best = np.argmax(values)
    right.plot(s[best], values[best], "*", color=GREEN, markersize=13, label="the exact maximum")
    right.set(xlabel="slice", ylabel="the interpolant")
    right.legend()
    save(figure, path)


def main():
    image, folder = itk.imread(sys.argv[1]), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    steps = Steps(image)
    group = steps.voxels.shape[0] // CUBE // 2
    draw_geometry(folder / "geometry.png", steps)
    draw_shear(folder / "shear.png", steps)
    draw_prepared(folder / "prepared.png", steps, group)
    draw_sampling(folder / "sampling.png", steps, range(group * CUBE, (group + 2) * CUBE))
    draw_intermediate(folder / "intermediate.png", steps)
    draw_skipping(folder / "skipping.png", Steps(suppress_tissue(image)), group)
    draw_warp(folder / "warp.png", steps)
    draw_exact(folder / "exact.png", steps)
    draw_speed(folder / "speed.svg")
    draw_memory(folder / "memory.svg")


if __name__ == "__main__":
    main()

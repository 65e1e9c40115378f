"""The projection by brute force, from the sampling rule, the geometry and the output grid alone.

Nothing of the filter is used. See include/itkShearWarpSampling.h for the rule.
"""

from typing import NamedTuple

import itk
import numpy as np

ONE = 1 << 15
INFINITY = float("inf")
# how far beyond the limits of slabs and boxes samples count, in extents of a voxel
LIMIT_TOLERANCE = 1e-9


class Rule(NamedTuple):
    """Which samples of a ray count, and which of them is its value."""

    mode: str = "maximum"
    slab_near: float = -INFINITY
    slab_far: float = INFINITY
    crop_lower: tuple[float, float, float] = (-INFINITY,) * 3
    crop_upper: tuple[float, float, float] = (INFINITY,) * 3
    mask_image: object = None
    mask_label: int = 0
    local_maximum: bool = False
    local_maximum_threshold: float = 0
    depth_attenuation: float = 0.0


def linear_map(transform) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and offset of any linear transform."""
    points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    offset, *ends = (np.array(list(transform.TransformPoint(point))) for point in points)
    return np.column_stack([end - offset for end in ends]), offset


def view_to_index(transform, image) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and offset from view space to indices relative to the first voxel."""
    matrix, offset = linear_map(transform)
    index_to_physical = itk.array_from_matrix(image.GetDirection()) @ np.diag(list(image.GetSpacing()))
    start = np.array(list(image.GetLargestPossibleRegion().GetIndex()), float)
    physical_to_index = np.linalg.inv(index_to_physical)
    return (physical_to_index @ matrix, physical_to_index @ (offset - np.array(list(image.GetOrigin()))) - start)


def principal_axis(ray: np.ndarray) -> int:
    """Of equal components, the last."""
    return max((2, 1, 0), key=lambda axis: abs(ray[axis]))


def quantize(position) -> tuple[np.ndarray, np.ndarray]:
    """Whole and fraction, in 1/2^15, of a position."""
    quantized = np.floor(np.asarray(position) * ONE + 0.5).astype(np.int64)
    return quantized >> 15, quantized & (ONE - 1)


def bilinear_weights(x, y):
    aa = (x * y + ONE // 2) >> 15
    return aa, y - aa, x - aa, ONE - x - y + aa


def sample_slice(padded: np.ndarray, x: int, y: int) -> np.ndarray:
    """One slice, padded by its edge values, at all its cells."""
    aa, ab, ba, bb = padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]
    if padded.dtype.kind == "f":
        one = padded.dtype.type(ONE)

        def interpolate(a, b, weight):
            return b if weight == 0 else b + padded.dtype.type(weight) / one * (a - b)

        return interpolate(interpolate(aa, ab, x), interpolate(ba, bb, x), y)
    weights = bilinear_weights(x, y)
    corners = (corner.astype(np.int64) for corner in (aa, ab, ba, bb))
    total = sum(weight * corner for weight, corner in zip(weights, corners))
    return ((total + ONE // 2) >> 15).astype(padded.dtype)


def oversampled_image(slices: np.ndarray, shear, translation, oversampling: int):
    """The intermediate image whose pixel x is sheared voxel (x + 1) / oversampling - 1."""
    steps = range(oversampling)
    shifts = [ONE * (oversampling - 1 - step) // oversampling for step in steps]
    phases = [[intermediate_image(slices, shear, translation, (column, row)) for column in shifts] for row in shifts]
    shape = np.max([pixels.shape for row in phases for pixels, _ in row], axis=0) * oversampling
    joined = np.zeros(shape, slices.dtype), np.zeros(shape, bool)
    for y in steps:
        for x in steps:
            for target, phase in zip(joined, phases[y][x]):
                rows, columns = phase.shape
                target[y::oversampling, x::oversampling][:rows, :columns] = phase
    return joined


def intermediate_image(slices, shear, translation, shift=(0, 0)) -> tuple[np.ndarray, np.ndarray]:
    """Maximum of the sheared slices, and which pixels some slice reaches; shift is in 1/2^15."""
    count, rows, columns = slices.shape

    def place(axis: int, k: int):
        whole, fraction = quantize(shear[axis] * k + translation[axis])
        moved = (whole << 15) + fraction + shift[axis]
        return moved >> 15, moved & (ONE - 1)

    offsets = [(place(0, k), place(1, k)) for k in range(count)]
    first = [[int(whole + (fraction > ONE // 2)) for whole, fraction in offset] for offset in offsets]
    shape = rows + max(row for _, row in first), columns + max(column for column, _ in first)
    lowest = -np.inf if slices.dtype.kind == "f" else np.iinfo(slices.dtype).min
    pixels = np.full(shape, lowest, slices.dtype)
    reached = np.zeros(shape, bool)
    for voxels, offset, (first_column, first_row) in zip(slices, offsets, first):
        (column, x), (row, y) = offset
        cells = sample_slice(np.pad(voxels, 1, mode="edge"), int(x), int(y))
        j, i = first_row - row, first_column - column
        target = np.s_[first_row : first_row + rows, first_column : first_column + columns]
        pixels[target] = np.maximum(pixels[target], cells[j : j + rows, i : i + columns])
        reached[target] = True
    return pixels, reached


def weighted_mean(values: np.ndarray, weights: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Mean of 4 x N values with 4 x N integer weights, none of whose sums is zero."""
    if dtype.kind == "f":
        mean = np.zeros(values.shape[1])
        for value, weight in zip(values, weights):
            mean += weight * np.where(weight > 0, value, 0).astype(np.float64)
        mean = (mean / weights.sum(axis=0)).astype(dtype)
        lowest = np.where(weights > 0, values, np.inf).min(axis=0)
        highest = np.where(weights > 0, values, -np.inf).max(axis=0)
        return np.clip(mean, lowest, highest)
    total = weights.sum(axis=0)
    return ((2 * (values.astype(np.int64) * weights).sum(axis=0) + total) // (2 * total)).astype(dtype)


class View:
    """The sheared geometry of a view of an image."""

    def __init__(self, image, transform):
        self.matrix, self.offset = view_to_index(transform, image)
        k = principal_axis(self.matrix[:, 2])
        i, j = (other for other in range(3) if other != k)
        self.axes = i, j, k
        self.voxels = self.slices_of(image)
        self.shear = -self.matrix[[i, j], 2] / self.matrix[k, 2]
        reach = -self.shear * (self.voxels.shape[0] - 1)
        self.translation = np.where(self.shear < 0, reach, 0.0)

    def slices_of(self, image) -> np.ndarray:
        i, j, k = self.axes
        return itk.array_view_from_image(image).transpose(2 - k, 2 - j, 2 - i)

    def sheared_positions(self, u, v) -> list[np.ndarray]:
        index = [self.matrix[n, 0] * u + self.matrix[n, 1] * v + self.offset[n] for n in self.axes]
        return [index[n] + self.shear[n] * index[2] + self.translation[n] for n in (0, 1)]


def positions(output) -> tuple[np.ndarray, np.ndarray]:
    """u and v of the pixels of a 2D image: a row and a column."""
    width, height = output.GetLargestPossibleRegion().GetSize()
    u = output.GetOrigin()[0] + output.GetSpacing()[0] * np.arange(width)
    v = output.GetOrigin()[1] + output.GetSpacing()[1] * np.arange(height)[:, np.newaxis]
    return u, v


def corners(view: View, output, reached: np.ndarray, oversampling: int):
    """Rows, columns and weights (4 each) of the intermediate pixels around the output's."""
    places = view.sheared_positions(*positions(output))
    (column, x), (row, y) = (quantize(oversampling * (place + 1) - 1) for place in places)
    aa, ab, ba, bb = bilinear_weights(x, y)
    rows, columns, weights = [], [], []
    for weight, dj, di in ((bb, 0, 0), (ba, 0, 1), (ab, 1, 0), (aa, 1, 1)):
        q, p = row + dj, column + di
        inside = (q >= 0) & (q < reached.shape[0]) & (p >= 0) & (p < reached.shape[1])
        q, p = np.where(inside, q, 0), np.where(inside, p, 0)
        rows.append(q)
        columns.append(p)
        weights.append(np.where(inside & reached[q, p], weight, 0))
    return np.array(rows), np.array(columns), np.array(weights)


def warp(view: View, output, pixels, reached, default, oversampling: int) -> np.ndarray:
    """The intermediate image, interpolated at the output's pixels."""
    rows, columns, weights = corners(view, output, reached, oversampling)
    values = pixels[rows, columns]
    result = np.full(weights.shape[1:], default, pixels.dtype)
    hit = weights.sum(axis=0) > 0
    result[hit] = weighted_mean(values[:, hit], weights[:, hit], pixels.dtype)
    return result


def project(image, transform, output, default=0, oversampling=1) -> np.ndarray:
    """The MIP of an itk.Image on the grid (size, spacing, origin) of the 2D image ``output``."""
    view = View(image, transform)
    pixels, reached = oversampled_image(view.voxels, view.shear, view.translation, oversampling)
    return warp(view, output, pixels, reached, default, oversampling)


# Rays one by one, for all that is not the plain maximum


def ranks(values: np.ndarray, mode: str) -> np.ndarray:
    """The value of a ray is the sample of the highest rank."""
    values = values.astype(np.float64)
    return {"maximum": values, "minimum": -values, "absolute": abs(values)}[mode]


def find_mean(values: np.ndarray) -> float | int:
    """The mean of a ray's samples, rounded half upward to their type."""
    if values.dtype.kind != "f":
        return (2 * sum(values.tolist()) + len(values)) // (2 * len(values))
    total = np.float64(0)
    for value in values:
        total += np.float64(value) * (2.0**-32 if values.dtype == np.float64 else 1)
    mean = total / len(values) / (2.0**-32 if values.dtype == np.float64 else 1)
    return np.clip(values.dtype.type(mean), values.min(), values.max())


def choose(values: np.ndarray, rule: Rule) -> int:
    """Which of a ray's samples, from front to back, is its value."""
    rank = ranks(values, rule.mode)
    if rule.local_maximum:
        threshold = ranks(np.array(rule.local_maximum_threshold), rule.mode)
        for n in range(len(rank) - 1):
            if rank[n] >= threshold and rank[n + 1] < rank[n]:
                # the first one of equal samples, but of magnitudes the first positive one
                first = n - np.argmax(np.append(rank[n::-1] != rank[n], True)) + 1
                return first + np.argmax(values[first : n + 1])
    best = np.flatnonzero(rank == rank.max())
    return best[np.argmax(values[best])]


def masked_samples(padded, inside, x: int, y: int) -> tuple[np.ndarray, np.ndarray]:
    """The cells of a padded slice by its voxels that are inside, and whether they count."""
    rows, columns = (length - 1 for length in padded.shape)
    # the outer half voxels have the edge's value
    of_column = np.where((np.arange(columns) % (columns - 1)) == 0, 0, x)
    of_row = np.where((np.arange(rows) % (rows - 1)) == 0, 0, y)[:, np.newaxis]
    parts = [np.s_[1:, 1:], np.s_[1:, :-1], np.s_[:-1, 1:], np.s_[:-1, :-1]]
    around = np.array([padded[part] for part in parts])
    are_inside = np.array([inside[part] for part in parts])
    aa, ab, ba, bb = bilinear_weights(of_column, of_row)
    weights = np.array([np.broadcast_to(weight, (rows, columns)) for weight in (bb, ba, ab, aa)])
    is_whole = (are_inside | (weights == 0)).all(axis=0)
    nearest = are_inside[2 * int(y > ONE // 2) + int(x > ONE // 2)]
    weights = np.where(are_inside, weights, 0)
    samples = sample_slice(padded, x, y)
    partly = nearest & ~is_whole
    samples[partly] = weighted_mean(around[:, partly], weights[:, partly], padded.dtype)
    return samples, nearest


def fade(samples: np.ndarray, depths: np.ndarray, rate: float, begin: float, to) -> np.ndarray:
    faded = to + (samples - float(to)) * np.exp(-rate * (depths - begin))
    rounded = np.floor(faded + 0.5) if samples.dtype.kind in "iu" else faded
    return rounded.astype(samples.dtype)


def sphere_depth(view: View, of_physical: np.ndarray) -> float:
    """The least depth of the sphere about the image's center that holds its voxels, not only their centers."""
    sizes = np.array(view.voxels.shape)[np.argsort(view.axes[::-1])]
    corners = np.array(np.meshgrid(*([-0.5 * size, 0.5 * size] for size in sizes))).reshape(3, -1)
    radius = np.linalg.norm(of_physical @ np.linalg.solve(view.matrix, corners), axis=0).max()
    center = np.linalg.solve(view.matrix, 0.5 * (sizes - 1) - view.offset)[2]
    return center - radius * np.linalg.norm(np.linalg.inv(of_physical)[2])


def collect_rays(view: View, transform, rule: Rule, default, oversampling: int):
    """Values of the intermediate pixels, the slices they come from, and which pixels have one."""
    count, rows, columns = view.voxels.shape
    i, j, k = view.axes
    of_physical, physical_offset = linear_map(transform)
    begin = max(sphere_depth(view, of_physical), rule.slab_near)
    view_steps = np.linalg.inv(view.matrix)
    depth_slack = LIMIT_TOLERANCE * abs(view_steps[2]).sum()
    slacks = LIMIT_TOLERANCE * abs(of_physical @ view_steps).sum(axis=1)
    labels = None
    if rule.mask_image is not None:
        labels = view.slices_of(rule.mask_image)
        labels = labels == rule.mask_label if rule.mask_label else labels != 0
    rays = {}
    is_ascending = view.matrix[k, 2] > 0
    for step in np.ndindex(oversampling, oversampling):
        # phase pixel (0, 0), in voxels
        corner = [(step[1 - n] + 1) / oversampling - 1 for n in (0, 1)]
        for slice_number in range(count) if is_ascending else reversed(range(count)):
            moved = [view.shear[n] * slice_number + view.translation[n] for n in (0, 1)]
            whole, weight, first = [], [], []
            for n in (0, 1):
                place, fraction = quantize(moved[n])
                shifted = (int(place) << 15) + int(fraction) - round(ONE * corner[n])
                whole.append(shifted >> 15)
                weight.append(shifted & (ONE - 1))
                first.append(int(weight[n] > ONE // 2))
            cells = np.s_[first[1] : first[1] + rows, first[0] : first[0] + columns]
            padded = np.pad(view.voxels[slice_number], 1, mode="edge")
            if labels is None:
                samples = sample_slice(padded, *weight)
                counts = np.ones(samples.shape, bool)
            else:
                inside = np.pad(labels[slice_number], 1, mode="edge")
                samples, counts = masked_samples(padded, inside, *weight)
            samples, counts = samples[cells], counts[cells].copy()

            p, q = np.meshgrid(np.arange(columns) + whole[0] + first[0], np.arange(rows) + whole[1] + first[1])
            index = np.empty((3, *samples.shape))
            index[i], index[j] = p + corner[0] - moved[0], q + corner[1] - moved[1]
            index[k] = slice_number
            of_view = np.linalg.solve(view.matrix, index.reshape(3, -1) - view.offset[:, np.newaxis])
            depths = of_view[2].reshape(samples.shape)
            points = of_physical @ of_view + physical_offset[:, np.newaxis]
            counts &= (depths >= rule.slab_near - depth_slack) & (depths <= rule.slab_far + depth_slack)
            for axis, position in enumerate(points.reshape(3, *samples.shape)):
                lower, upper = rule.crop_lower[axis] - slacks[axis], rule.crop_upper[axis] + slacks[axis]
                counts &= (position >= lower) & (position <= upper)
            if rule.depth_attenuation > 0:
                samples = fade(samples, depths, rule.depth_attenuation, begin, default)
            counts &= samples == samples
            for row, column in np.argwhere(counts):
                place = (oversampling * q[row, column] + step[0], oversampling * p[row, column] + step[1])
                rays.setdefault(place, []).append((samples[row, column], slice_number))

    shape = np.max([*rays, (0, 0)], axis=0) + 1
    values, slices = np.zeros(shape, view.voxels.dtype), np.full(shape, -1)
    for place, collected in rays.items():
        samples = np.array([value for value, _ in collected])
        if rule.mode == "mean":
            values[place], slices[place] = find_mean(samples), 0
        else:
            values[place], slices[place] = collected[choose(samples, rule)]
    return values, slices, slices >= 0


def project_rays(image, transform, output, rule: Rule, default=0, oversampling=1):
    """Values and depths on the grid of the 2D image ``output``."""
    view = View(image, transform)
    pixels, slices, reached = collect_rays(view, transform, rule, default, oversampling)
    values = warp(view, output, pixels, reached, default, oversampling)

    rows, columns, weights = corners(view, output, reached, oversampling)
    largest = np.argmax(weights, axis=0)[np.newaxis]
    row, column = (np.take_along_axis(each, largest, 0)[0] for each in (rows, columns))
    k = view.axes[2]
    u, v = positions(output)
    at_zero = view.matrix[k, 0] * u + view.matrix[k, 1] * v + view.offset[k]
    depths = (slices[row, column] - at_zero) / view.matrix[k, 2]
    return values, np.where(weights.any(axis=0), depths, np.nan)

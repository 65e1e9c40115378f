"""The projection by brute force, from the sampling rule, the geometry and the output grid alone.

Nothing of the filter is used. See include/itkShearWarpKernels.h for the rule.
"""

import itk
import numpy as np

ONE = 1 << 15


def linear_map(transform) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and offset of any linear transform."""
    points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    offset, *ends = (np.array(list(transform.TransformPoint(point))) for point in points)
    return np.column_stack([end - offset for end in ends]), offset


def view_to_index(transform, image) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and offset from view space to indices relative to the first voxel."""
    matrix, offset = linear_map(transform)
    index_to_physical = itk.array_from_matrix(image.GetDirection()) @ np.diag(
        list(image.GetSpacing())
    )
    start = np.array(list(image.GetLargestPossibleRegion().GetIndex()), float)
    physical_to_index = np.linalg.inv(index_to_physical)
    return (
        physical_to_index @ matrix,
        physical_to_index @ (offset - np.array(list(image.GetOrigin()))) - start,
    )


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
    phases = [
        [intermediate_image(slices, shear, translation, (column, row)) for column in shifts]
        for row in shifts
    ]
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
    first = [
        [int(whole + (fraction > ONE // 2)) for whole, fraction in offset] for offset in offsets
    ]
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
    return ((2 * (values.astype(np.int64) * weights).sum(axis=0) + total) // (2 * total)).astype(
        dtype
    )


def project(image, transform, output, default=0, oversampling=1) -> np.ndarray:
    """The MIP of an itk.Image on the grid (size, spacing, origin) of the 2D image ``output``."""
    matrix, offset = view_to_index(transform, image)
    axis = principal_axis(matrix[:, 2])
    i, j, k = [other for other in range(3) if other != axis] + [axis]
    voxels = itk.array_view_from_image(image)
    slices = voxels.transpose(2 - k, 2 - j, 2 - i)

    shear = -matrix[[i, j], 2] / matrix[k, 2]
    translation = np.where(shear < 0, -shear * (slices.shape[0] - 1), 0.0)
    pixels, reached = oversampled_image(slices, shear, translation, oversampling)

    width, height = output.GetLargestPossibleRegion().GetSize()
    u = output.GetOrigin()[0] + output.GetSpacing()[0] * np.arange(width)
    v = output.GetOrigin()[1] + output.GetSpacing()[1] * np.arange(height)[:, np.newaxis]
    index = [matrix[n, 0] * u + matrix[n, 1] * v + offset[n] for n in (i, j, k)]
    sheared = [index[n] + shear[n] * index[2] + translation[n] for n in (0, 1)]
    (column, x), (row, y) = (quantize(oversampling * (place + 1) - 1) for place in sheared)

    aa, ab, ba, bb = bilinear_weights(x, y)
    values, weights = [], []
    for weight, dj, di in ((bb, 0, 0), (ba, 0, 1), (ab, 1, 0), (aa, 1, 1)):
        q, p = row + dj, column + di
        inside = (q >= 0) & (q < pixels.shape[0]) & (p >= 0) & (p < pixels.shape[1])
        q, p = np.where(inside, q, 0), np.where(inside, p, 0)
        values.append(pixels[q, p])
        weights.append(np.where(inside & reached[q, p], weight, 0))
    values, weights = np.array(values), np.array(weights)
    result = np.full((height, width), default, voxels.dtype)
    hit = weights.sum(axis=0) > 0
    result[hit] = weighted_mean(values[:, hit], weights[:, hit], voxels.dtype)
    return result

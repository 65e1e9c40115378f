"""The projection of a chunked volume: chunks to pieces of the intermediate image, these to one, and that to the picture."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import dask
import itk
import numpy as np

from itk_shearwarpmip._volume import Volume, open_volume

_MERGED_TOGETHER = 8


class _Piece(NamedTuple):
    """Pixels of the intermediate image of the whole volume, from a row and a column on."""

    row: int
    column: int
    pixels: np.ndarray


class _Pieces(NamedTuple):
    """One for each view, and the bytes of all that they were merged from, and of themselves."""

    views: list[_Piece]
    bytes_sent: int


def mip(
    volume: Any,
    transform: Any = None,
    *,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: Any = None,
    size: Sequence[int] | None = None,
    output_spacing: float | Sequence[float] | None = None,
    output_origin: Sequence[float] | None = None,
    default_pixel_value: float = 0,
    oversampling: int = 1,
    level: int | None = None,
    time: int = 0,
    channel: int = 0,
) -> itk.Image:
    """Maximum intensity projection (MIP) of a volume in chunks, by Dask's current scheduler: threads, processes or the
    workers of a distributed.Client.

    Each chunk is projected where it is, to its piece of the intermediate image of the whole; pieces are merged in a tree,
    and the last one is warped to the picture here. The picture has the bits that itk.ShearWarpMIPImageFilter gives for
    the whole volume.

    volume, spacing, origin, direction, level, time, channel: see open_volume().
    transform: an itk.Transform, linear, from view space to the volume's physical space; the identity by default. See
        itk.ShearWarpMIPView, whose functions take open_volume(...).make_image().
    size: columns and rows; output_spacing and output_origin: of the picture, in the units of view space (for a rigid
        transform those of spacing). What is not given is fitted to the view. One number is a spacing of both.
    default_pixel_value: where rays miss the volume.
    oversampling: pixels of the intermediate image per voxel, 1 or 2.

    Returns a 2D itk.Image. Its entry "BytesSent" is the number of bytes of all pieces: the most that can have moved
    between workers, but for the faces of chunks.

    Raises ValueError, TypeError: see open_volume(); OSError for a chunk that cannot be read, with its voxels; RuntimeError
    for a transform that is not linear and invertible and for parameters out of their range.
    """
    if isinstance(output_spacing, int | float):
        output_spacing = [float(output_spacing)] * 2
    opened = open_volume(
        volume,
        spacing=spacing,
        origin=origin,
        direction=direction,
        level=level,
        output_spacing=output_spacing,
        time=time,
        channel=channel,
    )
    transform = itk.IdentityTransform[itk.D, 3].New() if transform is None else transform
    picture = _make_filter(itk.ShearWarpMIPImageFilter, opened, oversampling, default_pixel_value)
    picture.SetTransform(transform)
    _set_grid(picture, size, output_spacing, output_origin)
    picture.UpdateOutputInformation()
    pieces = _project(opened, [transform], oversampling)
    image = _warp(picture, pieces.views[0])
    image["BytesSent"] = pieces.bytes_sent
    return image


def mip_cine(
    volume: Any,
    transforms: Sequence[Any] | None = None,
    *,
    number_of_frames: int = 36,
    rotation_axis: Sequence[float] = (0.0, 0.0, 1.0),
    angular_range: float = 2 * np.pi,
    start_angle: float = 0.0,
    rocking: bool = False,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
    direction: Any = None,
    size: Sequence[int] | None = None,
    output_spacing: float | Sequence[float] | None = None,
    output_origin: Sequence[float] | None = None,
    default_pixel_value: float = 0,
    oversampling: int = 1,
    level: int | None = None,
    time: int = 0,
    channel: int = 0,
) -> itk.Image:
    """Maximum intensity projections of a volume in chunks from many directions, each chunk being read once for all.

    transforms: the view of each frame. Without them the frames turn about the centre of the volume:
    number_of_frames, rotation_axis (x, y, z), angular_range and start_angle (radians), rocking: as of
        itk.ShearWarpMIPCineImageFilter, whose frames these are.
    All else: see mip(); the frames have one grid.

    Returns a 3D itk.Image, its third axis the frames, with the entry "BytesSent"; raises what mip() does.
    """
    if isinstance(output_spacing, int | float):
        output_spacing = [float(output_spacing)] * 2
    opened = open_volume(
        volume,
        spacing=spacing,
        origin=origin,
        direction=direction,
        level=level,
        output_spacing=output_spacing,
        time=time,
        channel=channel,
    )
    cine = _make_filter(itk.ShearWarpMIPCineImageFilter, opened, oversampling, default_pixel_value)
    cine.SetNumberOfFrames(number_of_frames)
    cine.SetRotationAxis(rotation_axis)
    cine.SetAngularRange(angular_range)
    cine.SetStartAngle(start_angle)
    cine.SetRocking(rocking)
    cine.SetTransforms(transforms or [])
    _set_grid(cine, size, output_spacing, output_origin)
    cine.UpdateOutputInformation()
    grid = cine.GetOutput()
    columns, rows, frames = grid.GetLargestPossibleRegion().GetSize()
    views = [cine.GetFrameTransform(frame) for frame in range(frames)]
    pieces = _project(opened, views, oversampling)

    stack = np.empty((frames, rows, columns), opened.array.dtype.newbyteorder("="))
    for frame, (view, piece) in enumerate(zip(views, pieces.views, strict=True)):
        picture = _make_filter(itk.ShearWarpMIPImageFilter, opened, oversampling, default_pixel_value)
        picture.SetTransform(view)
        _set_grid(picture, [columns, rows], list(grid.GetSpacing())[:2], list(grid.GetOrigin())[:2])
        stack[frame] = itk.array_view_from_image(_warp(picture, piece))
    image = itk.image_from_array(stack)
    image.CopyInformation(grid)
    image["BytesSent"] = pieces.bytes_sent
    return image


def _make_filter(template: Any, volume: Volume, oversampling: int, default_pixel_value: float) -> Any:
    image = volume.make_image()
    made = template.New(image)
    made.SetOversampling(oversampling)
    made.SetDefaultPixelValue(volume.array.dtype.type(default_pixel_value).item())
    return made


def _set_grid(
    projection: Any,
    size: Sequence[int] | None,
    spacing: Sequence[float] | None,
    origin: Sequence[float] | None,
) -> None:
    if size is not None:
        projection.SetSize([int(length) for length in size])
    if spacing is not None:
        projection.SetOutputSpacing([float(step) for step in spacing])
    if origin is not None:
        projection.SetOutputOrigin([float(position) for position in origin])


def _warp(picture: Any, piece: _Piece) -> itk.Image:
    part = itk.image_view_from_array(piece.pixels)
    region = part.GetLargestPossibleRegion()
    region.SetIndex([piece.column, piece.row])
    part.SetRegions(region)
    picture.SetPart(0, part)
    picture.Update()
    image = picture.GetOutput()
    image.DisconnectPipeline()
    return image


def _project(volume: Volume, transforms: Sequence[Any], oversampling: int) -> _Pieces:
    """The intermediate images of all views."""
    geometry = Volume(_Shape(volume.array.shape, volume.array.dtype), volume.spacing, volume.origin, volume.direction)
    chunks = volume.array.to_delayed()
    firsts = [np.concatenate([[0], np.cumsum(lengths)[:-1]]) for lengths in volume.array.chunks]
    get_ends = dask.delayed(copy_ends, pure=False)
    project = dask.delayed(project_chunk, pure=False)
    merge = dask.delayed(merge_pieces, pure=False)

    ends = {place: get_ends(chunk) for place, chunk in np.ndenumerate(chunks)}
    pieces = []
    for place, chunk in np.ndenumerate(chunks):
        # samples lie between voxels: a chunk needs the last voxels of those before it
        before = {}
        for steps in product((0, 1), repeat=3):
            neighbour = tuple(np.subtract(place, steps))
            if any(steps) and min(neighbour) >= 0:
                before[steps] = ends[neighbour]
        first = tuple(int(firsts[axis][n]) for axis, n in enumerate(place))
        pieces.append(project(chunk, before, first, geometry, transforms, oversampling))
    while len(pieces) > 1:
        pieces = [merge(pieces[n : n + _MERGED_TOGETHER]) for n in range(0, len(pieces), _MERGED_TOGETHER)]
    return dask.compute(pieces[0])[0]


class _Shape(NamedTuple):
    """What a chunk must know of the volume's array."""

    shape: tuple[int, ...]
    dtype: np.dtype


def copy_ends(chunk: np.ndarray) -> list[np.ndarray]:
    """The last voxels of a chunk along each axis."""
    return [np.array(chunk[(slice(None),) * axis + (slice(-1, None),)]) for axis in range(3)]


def extend_chunk(chunk: np.ndarray, before: dict[tuple[int, ...], list[np.ndarray]]) -> np.ndarray:
    """The chunk with the last voxels of those before it: of the neighbour that is `steps` (z, y, x) back."""
    margin = [max((steps[axis] for steps in before), default=0) for axis in range(3)]
    dtype = chunk.dtype.newbyteorder("=")
    if not any(margin):
        return np.ascontiguousarray(chunk, dtype)
    extended = np.empty(np.add(chunk.shape, margin), dtype)
    extended[tuple(slice(each, None) for each in margin)] = chunk
    for steps, ends in before.items():
        last = tuple(slice(-1, None) if step else slice(None) for step in steps)
        extended[
            tuple(slice(0, 1) if step else slice(each, None) for step, each in zip(steps, margin, strict=True))
        ] = ends[steps.index(1)][last]
    return extended


def project_chunk(
    chunk: np.ndarray,
    before: dict[tuple[int, ...], list[np.ndarray]],
    first: tuple[int, ...],
    geometry: Volume,
    transforms: Sequence[Any],
    oversampling: int,
) -> _Pieces:
    """Projects a chunk, whose first voxel is number `first` (z, y, x) of the volume."""
    extended = extend_chunk(chunk, before)
    start = tuple(end - length for end, length in zip(np.add(first, chunk.shape), extended.shape, strict=True))
    projection = itk.ShearWarpMIPPartImageFilter.New(geometry.make_part(extended, start))
    projection.SetWholeRegion(geometry.region)
    projection.SetOversampling(oversampling)
    # chunks are what is done at once
    projection.SetNumberOfWorkUnits(1)
    views = []
    for transform in transforms:
        projection.SetTransform(transform)
        projection.Update()
        output = projection.GetOutput()
        column, row = output.GetLargestPossibleRegion().GetIndex()
        views.append(_Piece(row, column, itk.array_from_image(output)))
    return _Pieces(views, sum(piece.pixels.nbytes for piece in views))


def merge_pieces(pieces: list[_Pieces]) -> _Pieces:
    """The maximum of pieces, as large as they are together."""
    views = []
    for parts in zip(*(each.views for each in pieces), strict=True):
        row, column = (min(part[axis] for part in parts) for axis in range(2))
        rows = max(part.row + part.pixels.shape[0] for part in parts) - row
        columns = max(part.column + part.pixels.shape[1] for part in parts) - column
        dtype = parts[0].pixels.dtype
        lowest = -np.inf if np.issubdtype(dtype, np.floating) else np.iinfo(dtype).min
        merged = np.full((rows, columns), lowest, dtype)
        for part in parts:
            top, left = part.row - row, part.column - column
            place = merged[top : top + part.pixels.shape[0], left : left + part.pixels.shape[1]]
            np.maximum(place, part.pixels, out=place)
        views.append(_Piece(row, column, merged))
    sent = sum(each.bytes_sent for each in pieces)
    return _Pieces(views, sent + sum(piece.pixels.nbytes for piece in views))

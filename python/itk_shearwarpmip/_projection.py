"""The projection of a chunked volume: chunks to pieces of the intermediate image, these to one, and that to the picture."""

from collections.abc import Sequence
from itertools import count, product
from operator import sub
from typing import Any, NamedTuple
from uuid import uuid4

import dask
import itk
import numpy as np
from dask.core import flatten
from dask.delayed import Delayed

from itk_shearwarpmip._volume import Volume, open_volume

_MERGED_TOGETHER = 8


class _Piece(NamedTuple):
    """Pixels of the intermediate image of the whole volume, from a row and a column on."""

    row: int
    column: int
    pixels: np.ndarray


class _Ends(NamedTuple):
    """The first and the last voxels of a chunk along each axis; None along an axis without seams."""

    first: list[np.ndarray | None]
    last: list[np.ndarray | None]


class _Pieces(NamedTuple):
    """One for each view, and the bytes of all that they were merged from, and of themselves; if they are of one chunk,
    perhaps its ends."""

    views: list[_Piece]
    bytes_sent: int
    ends: _Ends | None = None


def mip(
    volume: Any,
    transform: Any = None,
    *,
    size: Sequence[int] | None = None,
    output_spacing: float | Sequence[float] | None = None,
    output_origin: Sequence[float] | None = None,
    default_pixel_value: float = 0,
    oversampling: int = 1,
    **place: Any,
) -> itk.Image:
    """Maximum intensity projection (MIP) of a volume in chunks, by Dask's current scheduler: threads, processes or the
    workers of a distributed.Client.

    Each chunk is projected where it is, to its piece of the intermediate image of the whole; pieces are merged in a tree,
    and the last one is warped to the picture here. The picture has the bits that itk.ShearWarpMIPImageFilter gives for
    the whole volume.

    volume: a dask.array.Array with the axes z, y, x, or an OME-Zarr image: see open_volume().
    transform: an itk.Transform, linear, from view space to the volume's physical space; the identity by default. See
        itk.ShearWarpMIPView, whose functions take open_volume(...).make_image().
    size: columns and rows; output_spacing and output_origin: of the picture, in the units of view space (for a rigid
        transform those of spacing). What is not given is fitted to the view. One number is a spacing of both.
    default_pixel_value: where rays miss the volume.
    oversampling: pixels of the intermediate image per voxel, 1 or 2.
    place: spacing, origin, direction, level, time and channel: see open_volume().

    Returns a 2D itk.Image. Its entry "BytesSent" is the number of bytes of all pieces: the most that can have moved
    between workers, but for the faces of chunks.

    Raises ValueError, TypeError: see open_volume(); OSError for a chunk that cannot be read, with its voxels; RuntimeError
    for a transform that is not linear and invertible and for parameters out of their range.
    """
    grid = (size, _make_pair(output_spacing), output_origin)
    opened = open_volume(volume, output_spacing=output_spacing, **place)
    picture = _make_filter(itk.ShearWarpMIPImageFilter, opened, oversampling, default_pixel_value, grid)
    view = itk.IdentityTransform[itk.D, 3].New() if transform is None else transform
    picture.SetTransform(view)
    picture.UpdateOutputInformation()
    pieces = _project(opened, [view], oversampling)
    image = _warp(picture, pieces.views[0])
    image["BytesSent"] = pieces.bytes_sent
    return image


def mip_cine(
    volume: Any,
    transforms: Sequence[Any] | None = None,
    *,
    number_of_frames: int = 36,
    rotation_axis: Sequence[float] = (0.0, 0.0, 1.0),
    angular_range: float = 360.0,
    start_angle: float = 0.0,
    rocking: bool = False,
    size: Sequence[int] | None = None,
    output_spacing: float | Sequence[float] | None = None,
    output_origin: Sequence[float] | None = None,
    default_pixel_value: float = 0,
    oversampling: int = 1,
    **place: Any,
) -> itk.Image:
    """Maximum intensity projections of a volume in chunks from many directions, each chunk being read once for all.

    transforms: the view of each frame. Without them the frames turn about the centre of the volume:
    number_of_frames, rotation_axis (x, y, z), angular_range and start_angle (degrees), rocking: as of
        itk.ShearWarpMIPCineImageFilter, whose frames these are.
    All else: see mip(); the frames have one grid.

    Returns a 3D itk.Image, its third axis the frames, with the entries of that filter's output and "BytesSent"; raises
    what mip() does.
    """
    opened = open_volume(volume, output_spacing=output_spacing, **place)
    grid = (size, _make_pair(output_spacing), output_origin)
    cine = _make_filter(itk.ShearWarpMIPCineImageFilter, opened, oversampling, default_pixel_value, grid)
    cine.SetNumberOfFrames(number_of_frames)
    cine.SetRotationAxis(rotation_axis)
    cine.SetAngularRange(angular_range)
    cine.SetStartAngle(start_angle)
    cine.SetRocking(rocking)
    cine.SetTransforms(transforms or [])
    cine.UpdateOutputInformation()
    stack = cine.GetOutput()
    columns, rows, frames = stack.GetLargestPossibleRegion().GetSize()
    views = [cine.GetFrameTransform(frame) for frame in range(frames)]
    pieces = _project(opened, views, oversampling)

    grid = ([columns, rows], list(stack.GetSpacing())[:2], list(stack.GetOrigin())[:2])
    pixels = np.empty((frames, rows, columns), opened.array.dtype.newbyteorder("="))
    for frame, (view, piece) in enumerate(zip(views, pieces.views, strict=True)):
        picture = _make_filter(itk.ShearWarpMIPImageFilter, opened, oversampling, default_pixel_value, grid)
        picture.SetTransform(view)
        pixels[frame] = itk.array_view_from_image(_warp(picture, piece))
    image = itk.image_from_array(pixels)
    image.CopyInformation(stack)
    image.SetMetaDataDictionary(stack.GetMetaDataDictionary())
    image["BytesSent"] = pieces.bytes_sent
    return image


def _make_pair(spacing: float | Sequence[float] | None) -> Sequence[float] | None:
    return None if spacing is None else np.broadcast_to(spacing, 2)


def _make_filter(template: Any, volume: Volume, oversampling: int, default_pixel_value: float, grid: tuple) -> Any:
    """A filter for the volume; `grid` is size, spacing and origin of the output, or None."""
    made = template.New(volume.make_image())
    made.SetOversampling(oversampling)
    made.SetDefaultPixelValue(volume.array.dtype.type(default_pixel_value).item())
    size, spacing, origin = grid
    if size is not None:
        made.SetSize([int(length) for length in size])
    if spacing is not None:
        made.SetOutputSpacing([float(step) for step in spacing])
    if origin is not None:
        made.SetOutputOrigin([float(position) for position in origin])
    return made


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


class _View(NamedTuple):
    """What chunks must know of the volume and of its views."""

    volume: Volume
    transforms: Sequence[Any]
    oversampling: int


class _Shape(NamedTuple):
    """What chunks must know of the volume's array."""

    shape: tuple[int, ...]
    dtype: np.dtype


def _project(volume: Volume, transforms: Sequence[Any], oversampling: int) -> _Pieces:
    """The intermediate images of all views."""
    array = volume.array
    token = uuid4().hex
    view = f"view-{token}"
    # what is on the workers already is left out by the optimization
    graph = {key: array.__dask_graph__()[key] for key in flatten(array.__dask_keys__())}
    graph.update(array.__dask_optimize__(array.__dask_graph__(), array.__dask_keys__()))
    outline = Volume(_Shape(array.shape, array.dtype), volume.spacing, volume.origin, volume.direction)
    graph[view] = _View(outline, transforms, oversampling)
    firsts = [np.cumsum((0, *lengths[:-1])) for lengths in array.chunks]
    # samples lie between voxels: there are seams between chunks, but for those that follow each other along the rays
    sliced = _find_principal_axes(volume, transforms)
    axes = [axis for axis in range(3) if sliced != {axis}]
    steps_back = [steps for steps in product((0, 1), repeat=3) if all(axis in axes for axis in np.flatnonzero(steps))]
    # a task more costs more than moving the pieces of one view with the ends
    ends_task, projected_ends = ("project_chunk", axes) if len(transforms) == 1 else ("copy_ends", [])
    chunks = []
    for place in np.ndindex(array.numblocks):
        chunk = (array.name, *place)
        first = [int(firsts[axis][n]) for axis, n in enumerate(place)]
        if ends_task == "copy_ends":
            graph[f"copy_ends-{token}", *place] = (copy_ends, chunk, axes)
        graph[f"project_chunk-{token}", *place] = (project_chunk, chunk, first, view, projected_ends)
        neighbours = {steps: tuple(map(sub, place, steps)) for steps in steps_back}
        around = {steps: neighbour for steps, neighbour in neighbours.items() if min(neighbour) >= 0}
        ends = [(f"{ends_task}-{token}", *neighbour) for neighbour in around.values()]
        chunks.append([(f"project_chunk-{token}", *place), first, list(around), ends])
    if len(chunks) == 1:
        return dask.compute(Delayed(chunks[0][0], graph))[0]
    groups = [chunks[n : n + _MERGED_TOGETHER] for n in range(0, len(chunks), _MERGED_TOGETHER)]
    pieces = [(f"merge_chunks-{token}", n) for n in range(len(groups))]
    graph.update({piece: (merge_chunks, group, view) for piece, group in zip(pieces, groups, strict=True)})
    for level in count():
        if len(pieces) == 1:
            break
        groups = [pieces[n : n + _MERGED_TOGETHER] for n in range(0, len(pieces), _MERGED_TOGETHER)]
        pieces = [(f"merge_pieces-{token}", level, n) for n in range(len(groups))]
        graph.update({piece: (merge_pieces, group) for piece, group in zip(pieces, groups, strict=True)})
    return dask.compute(Delayed(pieces[0], graph))[0]


def _find_principal_axes(volume: Volume, transforms: Sequence[Any]) -> set[int]:
    """The array's axes along which slices are taken."""
    image = volume.make_image()
    grid = itk.Image[itk.UC, 2].New()
    return {2 - itk.ShearWarpFactorization(view, image, grid).GetPrincipalAxis() for view in transforms}


def copy_ends(chunk: np.ndarray, axes: Sequence[int]) -> _Ends:
    """The ends of a chunk along some axes (0 is z)."""

    native = chunk.dtype.newbyteorder("=")

    def copy(axis: int, place: slice) -> np.ndarray | None:
        return np.array(chunk[(slice(None),) * axis + (place,)], native) if axis in axes else None

    return _Ends([copy(axis, slice(0, 1)) for axis in range(3)], [copy(axis, slice(-1, None)) for axis in range(3)])


def project_chunk(chunk: np.ndarray, first: Sequence[int], view: _View, axes: Sequence[int]) -> _Pieces:
    """Projects a chunk, whose first voxel is number `first` (z, y, x) of the volume; gives its ends along `axes` too."""
    voxels = np.ascontiguousarray(chunk, chunk.dtype.newbyteorder("="))
    pieces = _project_part(voxels, first, view)
    return _Pieces(pieces, sum(piece.pixels.nbytes for piece in pieces), copy_ends(voxels, axes) if axes else None)


def make_seam(around: dict[tuple[int, ...], _Ends], axis: int) -> tuple[np.ndarray, np.ndarray]:
    """The last voxels before a chunk along an axis and its own first ones, as far as samples lie between them; and how
    far back from the chunk's first voxel they begin (z, y, x). `around` has the ends of the chunks that are `steps` back,
    and of the chunk itself."""
    margin = np.max(list(around), axis=0)
    shape = np.add(around[0, 0, 0].first[axis].shape, margin)
    seam = np.empty(shape, around[0, 0, 0].first[axis].dtype)
    for steps, ends in around.items():
        voxels = ends.last[steps.index(1)] if any(steps) else ends.first[axis]
        voxels = voxels[tuple(slice(-1, None) if back else slice(None) for back in steps)]
        if not steps[axis]:
            voxels = voxels[(slice(None),) * axis + (slice(0, 1),)]
        starts = [0 if back else each for back, each in zip(steps, margin, strict=True)]
        seam[tuple(slice(start, start + length) for start, length in zip(starts, voxels.shape, strict=True))] = voxels
    return seam, margin


def merge_chunks(chunks: Sequence[tuple], view: _View) -> _Pieces:
    """Merges the pieces of chunks and, projected here, of the seams between them and those before them. Of each chunk:
    its pieces, its first voxel (z, y, x), and the `steps` back to those before it and to itself, with their ends or with
    pieces that have them."""
    pieces = [chunk[0] for chunk in chunks]
    seams = []
    for _, first, steps, ends in chunks:
        found = [each.ends if isinstance(each, _Pieces) else each for each in ends]
        around = dict(zip(map(tuple, steps), found, strict=True))
        for axis in range(3):
            if any(each[axis] for each in around):
                seam, margin = make_seam(around, axis)
                seams.append(_Pieces(_project_part(seam, np.subtract(first, margin), view), 0))
    return merge_pieces(pieces + seams)


def _project_part(voxels: np.ndarray, first: Sequence[int], view: _View) -> list[_Piece]:
    projection = itk.ShearWarpMIPPartImageFilter.New(view.volume.make_part(voxels, first))
    projection.SetWholeRegion(view.volume.region)
    projection.SetOversampling(view.oversampling)
    # chunks are what is done at once
    projection.SetNumberOfWorkUnits(1)
    if len(view.transforms) == 1:
        # one view does not pay for its preparation
        projection.SetReducedResampling(itk.ShearWarpMIPImageFilterEnums.ReducedResampling_Off)
    pieces = []
    for transform in view.transforms:
        projection.SetTransform(transform)
        projection.Update()
        output = projection.GetOutput()
        column, row = output.GetLargestPossibleRegion().GetIndex()
        pieces.append(_Piece(row, column, itk.array_from_image(output)))
    return pieces


def merge_pieces(pieces: list[_Pieces]) -> _Pieces:
    """The maximum of pieces, as large as they are together."""
    merged = [_merge(of_view) for of_view in zip(*(each.views for each in pieces), strict=True)]
    return _Pieces(merged, sum(each.bytes_sent for each in pieces) + sum(piece.pixels.nbytes for piece in merged))


def _merge(pieces: Sequence[_Piece]) -> _Piece:
    if len(pieces) == 1:
        return pieces[0]
    row, column = (min(piece[axis] for piece in pieces) for axis in range(2))
    rows = max(piece.row + piece.pixels.shape[0] for piece in pieces) - row
    columns = max(piece.column + piece.pixels.shape[1] for piece in pieces) - column
    dtype = pieces[0].pixels.dtype
    lowest = -np.inf if np.issubdtype(dtype, np.floating) else np.iinfo(dtype).min
    merged = np.full((rows, columns), lowest, dtype)
    for piece in pieces:
        top, left = piece.row - row, piece.column - column
        place = merged[top : top + piece.pixels.shape[0], left : left + piece.pixels.shape[1]]
        np.maximum(place, piece.pixels, out=place)
    return _Piece(row, column, merged)

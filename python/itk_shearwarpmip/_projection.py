"""The projection of a volume in chunks, by pieces of the intermediate image."""

from collections import ChainMap, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, product
from typing import Any, NamedTuple
from uuid import uuid4

import dask
import dask.array
import itk
import numpy as np
from dask.delayed import Delayed
from dask.highlevelgraph import HighLevelGraph, MaterializedLayer

from itk_shearwarpmip._inputs import make_view
from itk_shearwarpmip._parameters import Parameters, find_lowest, set_background, set_parameters, update
from itk_shearwarpmip._volume import Volume

_Place = tuple[int, ...]
"""The numbers of a chunk along z, y, x."""


class _Piece(NamedTuple):
    """A projection of itk.ShearWarpMIPPartsImageFilter: its first row and column, and the records of its pixels, bytes
    (row, column, byte)."""

    row: int
    column: int
    records: np.ndarray

    @classmethod
    def take(cls, projection: Any) -> "_Piece":
        _, column, row = projection.GetLargestPossibleRegion().GetIndex()
        return cls(row, column, itk.array_from_image(projection, update=False))

    def add_to(self, made: Any) -> None:
        made.AddPart(make_view(self.records, (self.row, self.column, 0)))


class _Ends(NamedTuple):
    """The first and the last layer of voxels of a chunk along axes (0 is z)."""

    first: dict[int, np.ndarray]
    last: dict[int, np.ndarray]


_EndsOf = dict[_Place, _Ends]


class _Pieces(NamedTuple):
    """The result for some chunks: one piece for each view; the bytes of all pieces, including those that were merged;
    the background by these chunks; and the ends of the projected chunks along the axes with seams."""

    views: list[_Piece]
    bytes_sent: int
    background: float = 0
    ends: _EndsOf | None = None

    def get_ends(self) -> _EndsOf:
        return self.ends or {}


def project(volume: Volume, view: Any, parameters: Parameters) -> tuple[Any, Any, float]:
    """Returns the picture of a volume in chunks, its depths or None, and its background, by Dask's current scheduler.
    Each chunk is projected where it is, to its piece of the intermediate image of the whole. Pieces are merged in a tree,
    and the last one is warped to the picture here. The picture has the bits that itk.ShearWarpMIPImageFilter gives for
    the whole volume. Its entry "BytesSent" is the number of bytes of all pieces. Pieces cannot have moved more bytes
    between workers; the faces of chunks are not included.
    """
    picture = _make_filter(itk.ShearWarpMIPPartsImageFilter, volume, parameters)
    picture.SetTransform(view)
    update(picture, information=True)
    pieces = _project(volume, [view], _fix_grid(parameters, picture.GetOutput()))
    image, depths = _warp(picture, pieces.views[0], pieces.background)
    image["BytesSent"] = pieces.bytes_sent
    return image, depths, pieces.background


def project_turn(
    volume: Volume, set_turn: Callable[[Any, Any], None], parameters: Parameters
) -> tuple[Any, Any, float, list[Any]]:
    """Returns the frames of an itk.ShearWarpMIPCineImageFilter, their depths or None, their background and their views.
    `set_turn` sets the turn of the filter for an image of the volume's geometry. Each chunk is read once for all frames.
    """
    cine = _make_filter(itk.ShearWarpMIPCineImageFilter, volume, parameters)
    set_turn(cine, volume.make_image())
    update(cine, information=True)
    stack = cine.GetOutput()
    views = [cine.GetFrameTransform(frame) for frame in range(stack.GetLargestPossibleRegion().GetSize()[2])]
    parameters = _fix_grid(parameters, stack)
    picture = _make_filter(itk.ShearWarpMIPPartsImageFilter, volume, parameters)
    picture.SetTransform(views[0])
    update(picture, information=True)
    pieces = _project(volume, views, parameters)

    def warp(view: Any, piece: _Piece) -> list[Any]:
        picture.SetTransform(view)
        return [each and itk.array_from_image(each) for each in _warp(picture, piece, pieces.background)]

    frames, depths = zip(*map(warp, views, pieces.views), strict=True)
    image = _stack(frames, stack)
    image["BytesSent"] = pieces.bytes_sent
    return image, None if depths[0] is None else _stack(depths, stack), pieces.background, views


def _stack(frames: Sequence[Any], like: Any) -> Any:
    image = itk.image_from_array(np.stack(frames))
    image.CopyInformation(like)
    image.SetMetaDataDictionary(like.GetMetaDataDictionary())
    return image


def _fix_grid(parameters: Parameters, picture: Any) -> Parameters:
    """The same parameters, with the grid of a picture or of frames."""
    return replace(
        parameters,
        size=list(picture.GetLargestPossibleRegion().GetSize())[:2],
        output_spacing=list(picture.GetSpacing())[:2],
        output_origin=list(picture.GetOrigin())[:2],
    )


def _make_filter(template: Any, volume: Volume, parameters: Parameters) -> Any:
    made = template.New(volume.make_image())
    set_parameters(made, parameters, 0 if parameters.background == "auto" else parameters.background)
    return made


def _warp(picture: Any, piece: _Piece, background: Any) -> tuple[Any, Any]:
    """The picture of a piece, and its depths or None."""
    picture.ClearParts()
    piece.add_to(picture)
    set_background(picture, background)
    picture.Update()
    image, depths = picture.GetOutput(), picture.GetDepthOutput()
    for each in (image, *([depths] if depths else [])):
        each.DisconnectPipeline()
    return image, depths


@dataclass(frozen=True)
class _View:
    """What the tasks of chunks need of the volume and of its views."""

    volume: Volume
    firsts: list[list[int]]
    """The first voxel of each chunk along z, y, x."""
    seams: list[int]
    """The axes along which there are seams (0 is z)."""
    transforms: Sequence[Any]
    parameters: Parameters

    def find_background(self, voxels: np.ndarray) -> float:
        background = self.parameters.background
        return find_lowest(voxels) if background == "auto" else background

    @property
    def adds(self) -> bool:
        """Whether each sample must be in one part alone."""
        return self.parameters.mode == "mean"

    def make_filter(self) -> Any:
        made = _make_filter(itk.ShearWarpMIPPartsImageFilter, self.volume, self.parameters)
        # chunks are what is done at once, also by threads
        made.SetNumberOfWorkUnits(1)
        return made

    def find_first(self, place: Sequence[int]) -> list[int]:
        return [firsts[n] for firsts, n in zip(self.firsts, place, strict=True)]


class _Shape(NamedTuple):
    """What the tasks of chunks need of the volume's array."""

    shape: tuple[int, ...]
    dtype: np.dtype


def _project(volume: Volume, transforms: Sequence[Any], parameters: Parameters) -> _Pieces:
    """Returns the intermediate images of all views."""
    array = volume.array
    token = uuid4().hex
    outline = Volume(_Shape(array.shape, array.dtype), volume.spacing, volume.origin, volume.direction)
    firsts = [np.cumsum((0, *lengths[:-1])).tolist() for lengths in array.chunks]
    # samples lie between voxels, so there are seams between chunks; extrema need none between chunks that follow each
    # other along the rays
    needs_all = parameters.mode == "mean" or parameters.exact
    sliced = set() if needs_all else _find_principal_axes(volume, transforms)
    seams = [axis for axis in range(3) if array.numblocks[axis] > 1 and sliced != {axis}]
    view = _View(outline, firsts, seams, transforms, parameters)
    owners = _find_owners(array)
    if owners:
        edge = 4
        graph, tasks = _project_together(array, _group(owners, edge), view, token)
    else:
        edge = 2
        graph, tasks = _project_each(array, view, token)
    pieces, priorities = _add_boxes(graph, tasks, edge, view, array.numblocks, token)
    last = _add_tree(graph, pieces, f"merge_pieces-{token}", view, token)
    layer = MaterializedLayer(graph, {"priority": priorities})
    pieces_of_all: _Pieces
    (pieces_of_all,) = dask.compute(Delayed(last, HighLevelGraph({token: layer}, {token: set()}), layer=token))
    return pieces_of_all


def _add_boxes(
    graph: dict[Any, Any], tasks: dict[_Place, Any], edge: int, view: _View, numblocks: _Place, token: str
) -> tuple[list[Any], "_Priorities"]:
    """Adds and returns the tasks that merge boxes of `edge` chunks a side, with the seams inside of a box and at the
    boxes before it. `tasks` project the chunks."""
    pieces: list[Any] = []
    ends: dict[_Place, Any] = {}
    priorities = _Priorities()
    of_view = _get_shared(graph, view, token)
    for low in product(*(range(0, length, edge) for length in numblocks)):
        high = np.minimum(np.add(low, edge), numblocks).tolist()
        places = list(product(*map(range, low, high)))
        outside = product(*(range(max(n - (axis in view.seams), 0), high[axis]) for axis, n in enumerate(low)))
        projected = list(dict.fromkeys(tasks[place] for place in places))
        before = list(dict.fromkeys(ends[place] for place in outside if place in ends))
        merge, keep = (f"merge_chunks-{token}", *low), (f"get_ends-{token}", *low)
        graph[merge] = (merge_chunks, projected, before, low, high, of_view)
        outer = [axis for axis in view.seams if high[axis] < numblocks[axis]]
        if outer:
            graph[keep] = (get_ends, projected, high, outer)
            ends.update(dict.fromkeys(places, keep))
        pieces.append(merge)
        priorities.add_box(graph, [*projected, merge, keep])
    return pieces, priorities


def _get_shared(graph: dict[Any, Any], view: _View, token: str) -> Any:
    """The key of the view in the graph, or the view itself."""
    shared = f"view-{token}"
    return shared if shared in graph else view


class _Priorities:
    """Lets a cluster do one box after the other, and merge boxes as soon as possible, so that few pieces and ends wait.
    Dask's own order begins many boxes."""

    def __init__(self) -> None:
        self._boxes: dict[Any, int] = {}
        self._count = 0

    def add_box(self, graph: dict[Any, Any], tasks: Iterable[Any]) -> None:
        """Adds the next box: its tasks, and their dependencies that no box before needs."""
        waiting = list(tasks)
        while waiting:
            task = waiting.pop()
            if task not in self._boxes:
                self._boxes[task] = self._count
                waiting.extend(getattr(graph.get(task), "dependencies", ()))
        self._count += 1

    def __call__(self, task: Any) -> float:
        # the tasks of others have 0
        return -self._boxes.get(task, 0) / self._count


def _project_each(array: dask.array.Array, view: _View, token: str) -> tuple[dict[Any, Any], dict[_Place, Any]]:
    """Returns a graph that projects each chunk in the task that reads it, and the task of each chunk. The tasks share
    one view."""
    shared = dask.delayed(view, name=f"view-{token}", traverse=False)
    projected = array.map_blocks(
        project_chunk, view=shared, name=f"project_chunks-{token}", dtype=object, meta=np.empty((0, 0, 0), object)
    )
    graph = dict(projected.__dask_optimize__(projected.__dask_graph__(), projected.__dask_keys__()))
    return graph, {place: (projected.name, *place) for place in np.ndindex(array.numblocks)}


def _project_together(
    array: dask.array.Array, groups: Iterable[list[_Place]], view: _View, token: str
) -> tuple[dict[Any, Any], dict[_Place, Any]]:
    """Returns a graph that projects groups of chunks, and the task of each chunk."""
    graph, tasks = dict(array.__dask_graph__()), {}
    for places in groups:
        task = f"project_chunks-{token}", *places[0]
        graph[task] = (project_chunks, [(array.name, *place) for place in places], places, view)
        tasks.update(dict.fromkeys(places, task))
    return graph, tasks


def _add_tree(graph: dict[Any, Any], pieces: list[Any], name: str, view: _View, token: str) -> Any:
    """Adds the tasks that merge all pieces to one, and returns it."""
    for level in count():
        if len(pieces) == 1:
            break
        # later ones are nearly as large as the whole
        length = 2 if level else 8
        groups = [pieces[n : n + length] for n in range(0, len(pieces), length)]
        pieces = [(name, level, n) for n in range(len(groups))]
        of_view = _get_shared(graph, view, token)
        graph.update({piece: (merge_pieces, group, of_view) for piece, group in zip(pieces, groups, strict=True)})
    return pieces[0]


def _find_owners(array: dask.array.Array) -> dict[_Place, tuple[str, int]]:
    """Returns the worker that has each chunk, and the number of its threads, if all chunks are futures in the memory
    of a cluster; otherwise nothing."""
    layer = array.__dask_graph__().layers.get(array.name)
    # others would be made here for nothing
    if not isinstance(layer, MaterializedLayer):
        return {}
    chunks = {place: layer[array.name, *place] for place in np.ndindex(array.numblocks)}
    clients: set[Any] = {getattr(chunk, "client", None) for chunk in chunks.values()}
    if len(clients) > 1 or None in clients:
        return {}
    (client,) = clients
    workers = client.who_has(list(chunks.values()))
    threads = client.nthreads()
    owners = {place: next(iter(workers.get(chunk.key, ())), "") for place, chunk in chunks.items()}
    if not all(owners.values()):
        return {}
    return {place: (worker, threads.get(worker, 1)) for place, worker in owners.items()}


def _group(owners: dict[_Place, tuple[str, int]], edge: int) -> Iterator[list[_Place]]:
    """In each box of `edge` chunks a side, divides the chunks of a worker into two groups for each of its threads."""
    groups = defaultdict(list)
    for place, owner in owners.items():
        groups[*np.floor_divide(place, edge), owner].append(place)
    for (*_, (_, threads)), own in groups.items():
        length = -(-len(own) // (2 * threads))
        yield from (own[n : n + length] for n in range(0, len(own), length))


def _find_principal_axes(volume: Volume, transforms: Sequence[Any]) -> set[int]:
    """The array's axes along which slices are taken."""
    image = volume.make_image()
    grid = itk.Image[itk.UC, 2].New()
    return {2 - itk.ShearWarpFactorization(view, image, grid).GetPrincipalAxis() for view in transforms}


def project_chunk(chunk: np.ndarray, *, view: _View, block_id: _Place) -> _Pieces:
    """Projects one chunk, as project_chunks() does."""
    return project_chunks([chunk], [block_id], view)


def project_chunks(chunks: Sequence[np.ndarray], places: Sequence[_Place], view: _View) -> _Pieces:
    """Projects chunks together, and also returns their ends."""
    chunks = [np.ascontiguousarray(chunk, chunk.dtype.newbyteorder("=")) for chunk in chunks]
    parts = ((chunk, view.find_first(place)) for chunk, place in zip(chunks, places, strict=True))
    pieces, ends = [], {}
    for chunk, place, projected in zip(chunks, places, _project_parts(parts, view), strict=True):
        # while the cache has the chunk
        pieces.append(_Pieces(projected, 0, view.find_background(chunk)))
        ends[place] = _copy_ends(chunk, view)
    return merge_pieces(pieces, view)._replace(ends=ends)


_FIRST, _LAST = slice(0, 1), slice(-1, None)


def _copy_ends(chunk: np.ndarray, view: _View) -> _Ends:
    def copy(voxels: slice) -> dict[int, np.ndarray]:
        return {axis: chunk[(slice(None),) * axis + (voxels,)].copy() for axis in view.seams}

    return _Ends(copy(_FIRST), copy(_LAST))


def get_ends(projected: list[_Pieces], high: _Place, axes: Sequence[int]) -> _EndsOf:
    """Returns the last voxels of a box of chunks along some axes, which the boxes after it need. The box ends before
    `high`."""
    return {
        place: _Ends({}, {axis: ends.last[axis] for axis in axes if place[axis] == high[axis] - 1})
        for of_chunks in projected
        for place, ends in of_chunks.get_ends().items()
    }


def make_seam(
    ends: _EndsOf, low: _Place, high: _Place, axis: int, number: int, view: _View
) -> tuple[np.ndarray, list[int]]:
    """Returns the voxels on both sides of a seam, and the first of them (z, y, x). The seam lies in a box of chunks,
    from `low` to before `high`, before the chunks of a number along an axis. Along the other axes, the voxels begin
    with the last voxels of the chunks before the box, because samples lie between these and the box. If samples add,
    the seam of the first of several axes has the samples between all chunks."""
    places = [
        range(n - (n > 0 and other in view.seams and not (view.adds and other < axis)), end)
        for other, (n, end) in enumerate(zip(low, high, strict=True))
    ]
    places[axis] = range(number - 1, number + 1)

    def get_face(place: _Place) -> np.ndarray:
        index = [_LAST if n < first else slice(None) for n, first in zip(place, low, strict=True)]
        # chunks before the box have nothing but their last voxels
        side = index.index(_LAST) if _LAST in index else axis
        index[axis] = _LAST if place[axis] < number else _FIRST
        face = ends[place].last if index[side] == _LAST else ends[place].first
        return face[side][tuple(index)]

    seam = np.block([[[get_face((z, y, x)) for x in places[2]] for y in places[1]] for z in places[0]])
    inner = [number if each == axis else low[each] for each in range(3)]
    margin = [numbers[0] < n for numbers, n in zip(places, inner, strict=True)]
    return seam, np.subtract(view.find_first(inner), margin).tolist()


def merge_chunks(projected: list[_Pieces], before: list[_EndsOf], low: _Place, high: _Place, view: _View) -> _Pieces:
    """Merges the pieces of a box of chunks, from `low` to before `high`. Also projects and merges the seams between
    these chunks, and to the chunks before the box, whose ends are `before`."""
    ends = dict(ChainMap(*before, *(of_chunks.get_ends() for of_chunks in projected)))
    seams = (
        make_seam(ends, first, last, axis, number, view)
        for axis in view.seams
        for first, last in _split_box(low, high, axis, view)
        for number in range(max(low[axis], 1), high[axis])
    )
    background = projected[0].background
    return merge_pieces(projected + [_Pieces(pieces, 0, background) for pieces in _project_parts(seams, view)], view)


def _split_box(low: _Place, high: _Place, axis: int, view: _View) -> Iterator[tuple[_Place, _Place]]:
    """Yields the boxes that have seams of their own along an axis: all chunks or, if samples add, the chunks between the
    seams along the axes before it."""
    spans = [
        [(n, n + 1) for n in range(first, end)]
        if view.adds and other < axis and other in view.seams
        else [(first, end)]
        for other, (first, end) in enumerate(zip(low, high, strict=True))
    ]
    for box in product(*spans):
        yield tuple(first for first, _ in box), tuple(end for _, end in box)


def _project_parts(parts: Iterable[tuple[np.ndarray, Sequence[int]]], view: _View) -> Iterator[list[_Piece]]:
    """Yields the pieces of each part. A part is its voxels and the place of its first voxel (z, y, x)."""
    projection = view.make_filter()
    if len(view.transforms) == 1:
        # one view does not pay for its preparation
        projection.SetReducedResampling(itk.ShearWarpMIPImageFilterEnums.ReducedResampling_Off)
    for voxels, first in parts:
        part = view.volume.make_part(voxels, first)
        pieces = []
        for transform in view.transforms:
            projection.SetTransform(transform)
            pieces.append(_Piece.take(projection.ProjectPart(part)))
        yield pieces


def merge_pieces(pieces: list[_Pieces], view: _View) -> _Pieces:
    """Returns pieces as one, with the extent of all of them."""
    merged = pieces[0].views if len(pieces) == 1 else _merge(zip(*(each.views for each in pieces), strict=True), view)
    bytes_sent = sum(each.bytes_sent for each in pieces) + sum(piece.records.nbytes for piece in merged)
    return _Pieces(merged, bytes_sent, min(each.background for each in pieces))


def _merge(pieces_of_views: Iterable[Sequence[_Piece]], view: _View) -> list[_Piece]:
    merger, merged = view.make_filter(), []
    for transform, pieces in zip(view.transforms, pieces_of_views, strict=True):
        merger.SetTransform(transform)
        merger.ClearParts()
        for piece in pieces:
            piece.add_to(merger)
        merged.append(_Piece.take(merger.MergeParts()))
    return merged

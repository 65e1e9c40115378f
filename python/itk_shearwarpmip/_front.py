"""mip() and turn(): projections of volumes of many kinds."""

import difflib
import inspect
import os
import sys
import threading
import warnings
import weakref
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip import _entries, _write
from itk_shearwarpmip._inputs import (
    get_shape,
    is_chunked,
    is_of,
    is_ome_zarr,
    is_plain_array,
    make_count,
    make_flag,
    make_numbers,
    make_view,
    open_image,
    place,
    take,
)
from itk_shearwarpmip._labels import get_matrix
from itk_shearwarpmip._parameters import (
    Interpolation,
    Mode,
    Parameters,
    check_mode,
    find_lowest,
    set_parameters,
    set_value,
    update,
)
from itk_shearwarpmip._places import find_places
from itk_shearwarpmip._views import list_views, make_transform
from itk_shearwarpmip._window import find_window, is_background
from itk_shearwarpmip._write import OutputOptions


class Place(TypedDict, total=False):
    """The geometry of the source, and the choice of voxels: see open_image()."""

    spacing: Sequence[float] | None
    origin: Sequence[float] | None
    direction: Any
    series: str | int | None
    volume: str | int | None
    suv: bool
    level: int | None
    time: int | None
    channel: int


def mip(
    source: Any,
    view: Any = "anterior",
    *,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    mode: Mode = "maximum",
    interpolation: Interpolation = "linear",
    slab: Sequence[float] | None = None,
    crop: Sequence[Sequence[float]] | None = None,
    mask: Any = None,
    mask_label: int | None = None,
    depth: bool = False,
    places: bool = False,
    attenuation: float = 0.0,
    local_maximum: float | None = None,
    background: float | Literal["auto"] = "auto",
    exact: bool = False,
    oversampling: int = 1,
    output_spacing: float | Sequence[float] | None = None,
    size: Sequence[int] | None = None,
    output_origin: Sequence[float] | None = None,
    threads: int | None = None,
    geometry: bool = False,
    **where: Unpack[Place],
) -> Any:
    """The maximum intensity projection (MIP) of a volume from any direction.

    source: the volume: see open_image(). A Dask array, an xarray.DataArray of a Dask array and an OME-Zarr image stay
        in chunks: see open_volume(). Arrays have the axes z, y, x.
    view: the side from which the viewer looks, "anterior", "posterior", "left", "right", "superior" or "inferior"; or a
        linear itk.Transform or a 4 x 4 matrix from view space (u right, v down, w away) to physical space (LPS, mm).
        "superior" is from above, with the patient's left at the left of the picture; "inferior" is the axial view of
        radiology, from the feet.
    azimuth, elevation: degrees that the viewer then moves towards the right and towards the top of the picture.
    mode: "maximum", "minimum", "absolute_maximum" for the value with the largest magnitude, with its sign, or "mean".
    interpolation: "linear", or "nearest" for labels: the picture then has only values of voxels.
    slab: (near, far): only samples between these depths count. For a view by name, depths are mm behind the volume's
        center.
    crop: (lower, upper), two corners x, y, z: only samples in this box count, in mm (LPS); infinity is no limit.
    mask: a volume of whole numbers on the source's grid, of any kind that source can be. An array takes the source's
        geometry. Only voxels where the mask is `mask_label` count; without `mask_label`, where the mask is not 0.
    depth: True to return the depths too, in mm, as float32; pixels without a value are not-a-number.
    places: True to return also where each value comes from: an array of NumPy (rows, columns, 3) of points x, y, z, in mm
        (LPS), as float64; pixels without a value are not-a-number. sample() has the values of another volume there.
    attenuation: how fast values fade to the background with depth, per mm.
    local_maximum: rays end behind their first local maximum of at least this value.
    background: the value of pixels beside the volume; "auto" is 0, or the volume's least value if it is negative.
    exact: True for the maximum of the interpolated volume, 8 to 40 times as slow.
    oversampling: 1, or 2 for twice as many pixels along both axes of the intermediate image.
    output_spacing: spacing of the pixels, in mm: one number, or (u, v). By default the volume's smallest spacing.
    size: columns and rows; output_origin: (u, v) of the first pixel in the view plane, in mm. By default the picture
        shows the whole volume.
    threads: how many to use; by default ITK's number.
    geometry: True for an itk.Image, which has a geometry, whatever the kind of the source.
    where: spacing, origin, direction, series, volume, suv, level, time and channel of open_image().

    Volumes in chunks have no mask, attenuation, local_maximum and threads, and no mean of floating-point voxels.

    Returns a 2D itk.Image with spacing and origin in the view plane, in mm, which a notebook shows. For an array, returns
    an array of the same package; for a SimpleITK.Image or an xarray.DataArray, an object of the same type. With `depth` or
    `places`, returns a tuple: the picture, its depths, its places.

    The entry "Background" of an itk.Image is the value of pixels beside the volume. Its entry "FrameTransforms" has
    16 numbers, the view's matrix from view space to physical space, row by row: a pixel at (u, v) mm with the depth w
    lies at np.reshape(picture["FrameTransforms"], (4, 4)) @ [u, v, w, 1].

    The preparation of an itk.Image is kept as long as the image object exists, so further views are faster. After you
    change its voxels in memory, as by image[...] = 0, call image.Modified(); otherwise the picture may show the old
    values. Arrays are read again by each call.

    Raises ValueError for unsuitable values, TypeError for unsupported types, OSError for files that cannot be read, and
    ImportError with the name of a missing package.

    >>> import numpy as np
    >>> volume = np.zeros((10, 20, 30), np.uint8)
    >>> volume[5, 3, 7] = 200
    >>> mip(volume, view="superior").shape
    (20, 30)
    >>> image = open_image(volume, spacing=(0.5, 0.5, 1.0))
    >>> picture, depths = mip(image, "left", azimuth=30, slab=(-5, 5), depth=True)
    >>> list(picture.GetSpacing()), depths.shape == picture.shape
    ([0.5, 0.5], True)
    """
    mode = check_mode(mode)
    parameters = Parameters(
        mode, slab, crop, mask, mask_label, depth, attenuation, local_maximum, background, exact, oversampling,
        output_spacing, size, output_origin, threads, places, interpolation,
    )  # fmt: skip
    require_known(mip, where)
    make_flag("geometry", geometry)
    if is_chunked(source):
        pictures = _project_chunks(source, view, azimuth, elevation, parameters, where)
    else:
        image = open_image(source, **where)
        transform = make_transform(image, view, azimuth, elevation)
        with _get_filters(image) as filters:
            made = filters.get(itk.ShearWarpMIPImageFilter)
            made.SetTransform(transform)
            pictures = filters.project(made, parameters)
    picture, depths = pictures if geometry else (each and give_back(source, each) for each in pictures)
    found = [picture, *([depths] if depth else []), *([find_places(*pictures)] if places else [])]
    return tuple(found) if len(found) > 1 else picture


@dataclass(eq=False, repr=False)
class Turn:
    """Projections of a volume from many directions, made by turn(); a notebook shows them as a page."""

    frames: Any
    """3D itk.Image, its third axis the frames; its entries "FrameAngles" and "FrameTransforms" are the entries of
    itk.ShearWarpMIPCineImageFilter."""
    transforms: list[Any]
    """The itk.Transform of each frame's view, from view space to physical space."""
    source_metadata: dict[str, Any] = field(default_factory=dict)
    """Texts and numbers of the source's meta data dictionary, such as DICOM attributes."""
    depths: Any = None
    """3D itk.Image of float32, in mm, if depths were asked for."""
    places: Any = None
    """Array (frames, rows, columns, 3) of points x, y, z, in mm (LPS), if places were asked for."""
    mode: Mode = "maximum"
    slab: Sequence[float] | None = None
    center: Sequence[float] | None = None
    """Of the volume, in mm (LPS)."""
    source_files: Sequence[Path] = ()
    """The files of the volume."""
    mask_files: Sequence[Path] = ()
    """The file of the mask. Files of the volume and the mask are never written."""

    _window: tuple[float, float] | None = None

    @property
    def window(self) -> tuple[float, float]:
        """The values that become black and white. It can be set; by default the program chooses it."""
        return find_window(self.frames) if self._window is None else self._window

    @window.setter
    def window(self, window: tuple[float, float] | None) -> None:
        self._window = window

    def save(self, path: str | os.PathLike[str], **options: Unpack[OutputOptions]) -> None:
        """Writes the frames, by the program shear-warp-mip.

        path: its extension selects the format. A file appears only when it is complete; after an error, an older file
            is unchanged. Files that the turn was made from are never written.
            .html: a page that turns, in one file.
            .gif, .apng, .mp4: an animation, by the program ffmpeg.
            .png, .jpg, .tif: a picture of 8 bits for each frame: turn-000.png, turn-001.png and so on.
            .nrrd, .nii, .nii.gz, .mha: the values, a stack of the frames with spacing and origin in mm.
            none: a DICOM series in a folder that is new or empty.
        window: values that become black and white, (low, high), or the name of a usual window, such as "bone"; by default
            the attribute `window` if it was set, otherwise the program's or, for DICOM, the source's window.
        wl: the middle and the width of the window, instead of `window`.
        labels: False for pictures and animations without letters; a page then hides them when it opens. See save_png().
        annotate: True for pictures and animations with a scale bar and the angles of each view.
        rate: frames per second of pages and animations, from 0.1 to 100; by default the turn takes four seconds.
        page_bits: 16 for a page that stores the whole range of the values; by default 8, or 16 for a page of a volume
            whose mode is not the maximum.
        dicom_out: a folder for a DICOM series beside `path`.
        multi_frame: True for a DICOM series in one file.

        Raises TypeError for unknown options, ValueError for unsuitable ones, OSError for files that cannot be written,
        and without the program or ffmpeg, with the program's sentence; RuntimeError if the program was ended.
        """
        _write.save_turn(self, path, options)

    def __len__(self) -> int:
        return int(self.frames.shape[0])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The frames' pixels (frame, v, u)."""
        pixels = np.asarray(self.frames, dtype)
        return pixels.copy() if copy else pixels

    def __repr__(self) -> str:
        frames, rows, columns = self.frames.shape
        return f"<Turn of {frames} frames, {columns} x {rows} pixels>"

    def _repr_html_(self) -> str:
        return _write.make_frame(self)


def turn(
    source: Any,
    view: Any = "anterior",
    *,
    azimuth: float = 0.0,
    elevation: float = 0.0,
    frames: int = 36,
    rotation_axis: str | Sequence[float] = "superior",
    center: Sequence[float] | None = None,
    start_angle: float = 0.0,
    angular_range: float = 360.0,
    rocking: bool = False,
    transforms: Sequence[Any] | None = None,
    mode: Mode = "maximum",
    interpolation: Interpolation = "linear",
    slab: Sequence[float] | None = None,
    crop: Sequence[Sequence[float]] | None = None,
    mask: Any = None,
    mask_label: int | None = None,
    depth: bool = False,
    places: bool = False,
    attenuation: float = 0.0,
    local_maximum: float | None = None,
    background: float | Literal["auto"] = "auto",
    exact: bool = False,
    oversampling: int = 1,
    output_spacing: float | Sequence[float] | None = None,
    size: Sequence[int] | None = None,
    output_origin: Sequence[float] | None = None,
    threads: int | None = None,
    **where: Unpack[Place],
) -> Turn:
    """Projections of a volume from many directions, on one grid: a series that turns. The volume is read only once.

    view, azimuth, elevation: the view at angle 0.
    frames: the number of frames, 1 to 65535.
    rotation_axis: the axis that the viewer moves about: the patient's "left", "posterior" or "superior", the volume's
        "i", "j" or "k", or a direction x, y, z (LPS). About "superior", the viewer moves from anterior towards the
        patient's left.
    center: a point of the axis, x, y, z in mm; by default the volume's center.
    start_angle, angular_range: degrees: frame n of N is at start_angle + angular_range n / N.
    rocking: True to move to and fro over the range instead, half of it to either side; both ends are frames.
    transforms: the view of each frame, of any kind that view can be, instead of all parameters above.
    For all other parameters, see mip().

    Raises the same exceptions as mip().

    >>> import numpy as np
    >>> series = turn(np.ones((10, 20, 30), np.uint8), frames=8, spacing=(0.5, 0.5, 1.0))
    >>> series.frames.shape[0], len(series.transforms), series.frames["FrameAngles"][1]
    (8, 8, 45.0)
    """
    mode = check_mode(mode)
    parameters = Parameters(
        mode, slab, crop, mask, mask_label, depth, attenuation, local_maximum, background, exact, oversampling,
        output_spacing, size, output_origin, threads, places, interpolation,
    )  # fmt: skip

    require_known(turn, where)
    if transforms is not None:
        instead = {
            "view": view, "azimuth": azimuth, "elevation": elevation, "frames": frames, "rotation_axis": rotation_axis,
            "center": center, "start_angle": start_angle, "angular_range": angular_range, "rocking": rocking,
        }  # fmt: skip
        default = inspect.signature(turn).parameters
        if wrong := [name for name, value in instead.items() if _is_given(value, default[name].default)]:
            raise ValueError(f"{', '.join(wrong)} cannot be given with transforms, which are the views of all frames")

    def set_turn(made: Any, image: Any) -> None:
        made.ClearTransforms()
        made.SetTransform(make_transform(image, view, azimuth, elevation))
        for each in [] if transforms is None else list_views(transforms):
            made.AddTransform(make_transform(image, each))
        set_value(made, "NumberOfFrames", "frames", frames)
        made.SetRotationAxis(_find_axis(rotation_axis, image))
        made.UseImageCenter()
        if center is not None:
            made.SetCenter(make_numbers("center", center, 3))
        set_value(made, "StartAngle", "start_angle", start_angle)
        set_value(made, "AngularRange", "angular_range", angular_range)
        made.SetRocking(make_flag("rocking", rocking))

    if is_chunked(source):
        stack, depths, views, middle = _project_chunks_turning(source, set_turn, parameters, where)
        found = find_places(stack, depths) if places else None
        return Turn(stack, views, {}, depths if depth else None, found, mode, slab, middle)
    image = open_image(source, **where)
    with _get_filters(image) as filters:
        made = filters.get(itk.ShearWarpMIPCineImageFilter)
        set_turn(made, image)
        stack, depths = filters.project(made, parameters)
        views = [made.GetFrameTransform(frame) for frame in range(stack.shape[0])]
    if transforms is None:
        stack["Loop"] = "swing" if rocking else "turn" if abs(angular_range) == 360.0 else "none"
    return Turn(
        stack,
        views,
        _copy_metadata(image),
        depths if depth else None,
        find_places(stack, depths) if places else None,
        mode,
        slab,
        list(itk.ShearWarpMIPView.GetCenter(image)),
        _entries.get_source_files(image),
        _find_files(mask),
    )


def _find_files(mask: Any) -> list[Path]:
    """The files of a mask, never to be written."""
    if isinstance(mask, str | os.PathLike):
        return [Path(mask).absolute()]
    return _entries.get_source_files(mask) if isinstance(mask, itk.ImageBase[3]) else []


def _copy_metadata(image: Any) -> dict[str, Any]:
    """Texts and numbers; other values end with the image."""
    entries = {key: image[key] for key in image.GetMetaDataDictionary().GetKeys()}
    return {key: value for key, value in entries.items() if isinstance(value, str | int | float)}


def require_known(function: Callable[..., Any], given: Any, others: Iterable[str] = ()) -> None:
    """Raises TypeError for keywords that are neither of the place of an image nor among others."""
    if unknown := given.keys() - Place.__annotations__.keys() - set(others):
        own = [each.name for each in inspect.signature(function).parameters.values() if each.kind != each.VAR_KEYWORD]
        known = [*own, *Place.__annotations__, *others]
        similar = [match for name in sorted(unknown) for match in difflib.get_close_matches(name, known, 1, 0.75)]
        hint = f": did you mean {' and '.join(similar)}?" if similar else ""
        raise TypeError(f"{function.__name__}() has no parameter {', '.join(sorted(unknown))}{hint}")


class _Filters:
    """The filters of one image, which keep the prepared image."""

    def __init__(self, image: Any) -> None:
        # the filters hold its voxels
        self._image = weakref.ref(image)
        self._made: dict[Any, Any] = {}
        self._threads = 0
        self._lowest: tuple[int, float] | None = None
        self._lock = threading.RLock()

    def __enter__(self) -> "_Filters":
        self._lock.acquire()
        return self

    def __exit__(self, *error: object) -> None:
        self._lock.release()

    def is_free(self) -> bool:
        """Whether no other thread projects."""
        free = self._lock.acquire(blocking=False)
        if free:
            self._lock.release()
        return free

    def get(self, template: Any) -> Any:
        if template not in self._made:
            self._made[template] = template.New(self._image())
            self._threads = self._made[template].GetNumberOfWorkUnits()
        return self._made[template]

    def project(self, made: Any, parameters: Parameters) -> tuple[Any, Any]:
        """The picture of a filter, and its depths or None."""
        image: Any = self._image()
        background = parameters.background
        is_auto = isinstance(background, str) and background == "auto"
        set_parameters(made, parameters, self._find_lowest() if is_auto else background)
        threads = parameters.threads
        threads = self._threads if threads is None else make_count("threads", threads)
        set_value(made, "NumberOfWorkUnits", "threads", threads)
        # its voxels live while this does
        mask = None if parameters.mask is None else open_mask(parameters.mask, parameters.mask_label, image)
        made.SetMaskImage(mask)
        try:
            update(made, "depth" if parameters.depth else "places")
        finally:
            made.SetMaskImage(None)
        picture = made.GetOutput()
        depths = made.GetDepthOutput() if parameters.depth or parameters.places else None
        background = made.GetDefaultPixelValue()
        for each, beside in ((picture, background), (depths, np.nan)):
            if each is not None:
                each.DisconnectPipeline()
                show_itself(each, beside, image, made.GetTransform())
        _warn_if_empty(picture, background, parameters)
        return picture, depths

    def _find_lowest(self) -> float:
        """The least voxel, if it is negative, or 0."""
        image: Any = self._image()
        time = image.GetMTime()
        if self._lowest is None or self._lowest[0] != time:
            voxels = itk.array_view_from_image(image)
            # the filter says that there are none
            self._lowest = time, 0 if voxels is None else find_lowest(voxels)
        return self._lowest[1]


_FILTERS: dict[int, _Filters] = {}
"""By the id of an itk.Image, which lives."""
_FILTERS_LOCK = threading.Lock()


def _warn_if_empty(picture: Any, background: float, parameters: Parameters) -> None:
    limits = [name for name in ("slab", "crop") if getattr(parameters, name) is not None]
    if limits and is_background(itk.array_view_from_image(picture), background).all():
        question = f"is the image within {' and '.join(limits)}?"
        hint = " A slab must be at least as thick as the voxels." if "slab" in limits else ""
        warnings.warn(f"there is only background in the picture: {question}{hint}", stacklevel=4)


def _renew_locks() -> None:
    """In a forked process, which has the locks of its parent's threads, but not these threads."""
    global _FILTERS_LOCK  # noqa: PLW0603
    _FILTERS_LOCK = threading.Lock()
    for key, filters in [*_FILTERS.items()]:
        if not filters.is_free():
            del _FILTERS[key]


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_locks)


def _get_filters(image: Any) -> _Filters:
    with _FILTERS_LOCK:
        if id(image) not in _FILTERS:
            _FILTERS[id(image)] = _Filters(image)
            weakref.finalize(image, _FILTERS.pop, id(image), None).atexit = False
        return _FILTERS[id(image)]


def _find_axis(axis: str | Sequence[float], image: Any) -> list[float]:
    patient, volume = ("left", "posterior", "superior"), ("i", "j", "k")
    if not isinstance(axis, str):
        return make_numbers("rotation_axis", axis, 3)
    if axis in patient:
        return [float(name == axis) for name in patient]
    if axis in volume:
        direction: list[float] = itk.array_from_matrix(image.GetDirection())[:, volume.index(axis)].tolist()
        return direction
    names = ", ".join(patient + volume)
    raise ValueError(f"rotation_axis must be one of {names} or a direction x, y, z, but it is {axis!r}")


def open_mask(mask: Any, label: int | None, image: Any) -> Any:
    """A mask of 0 and 1 on the grid of an image."""
    is_read = isinstance(mask, str | os.PathLike) or is_ome_zarr(mask)
    try:
        placed = take(open_image(mask) if is_read else mask)
    except (TypeError, ValueError) as error:
        raise type(error)(f"mask: {error}") from None
    voxels = np.asarray(placed.array)
    if voxels.dtype.kind not in "biu":
        raise TypeError(f"a mask must have whole numbers, but its voxels are {voxels.dtype}: use astype(np.uint8)")
    if voxels.shape != (shape := get_shape(image)):
        raise ValueError(
            f"a mask must be on the volume's grid: it has the shape {voxels.shape} instead of {shape}. Resample an "
            "image with a place of its own, as by itk.resample_image_filter()"
        )
    chosen = voxels != 0 if label is None else voxels == make_count("mask_label", label)
    if not chosen.any():
        labels = np.unique(voxels).tolist()
        present = f"its labels are {', '.join(f'{n:d}' for n in labels[:20])}{', ...' if len(labels) > 20 else ''}"
        what = "no voxel is in the mask: all are 0" if label is None else f"the mask has no label {label}: {present}"
        warnings.warn(what, stacklevel=4)
    binary = make_view(chosen.astype(np.uint8))
    if not is_plain_array(mask):
        place(binary, placed.replace(None, None, None))
        _require_grid(binary, image)
    binary.SetRegions(image.GetLargestPossibleRegion())
    binary.CopyInformation(image)
    return binary


def _require_grid(mask: Any, image: Any) -> None:
    start, size = (np.array(list(each)) for each in (_get_start(image), image.GetLargestPossibleRegion().GetSize()))
    distance = 0.0
    for corner in np.ndindex(2, 2, 2):
        index = np.array(corner) * (size - 1)
        points = [
            np.array(list(each.TransformIndexToPhysicalPoint((index + first).tolist())))
            for each, first in ((mask, 0), (image, start))
        ]
        distance = max(distance, float(np.linalg.norm(points[0] - points[1])))
    # file formats round positions
    if not distance <= 0.01 * min(image.GetSpacing()):
        raise ValueError(
            f"a mask must be on the volume's grid: a corner is {distance:g} mm away from where it should be. Resample it, as "
            "by itk.resample_image_filter()"
        )


def _get_start(image: Any) -> Any:
    return image.GetLargestPossibleRegion().GetIndex()


def _is_given(value: Any, default: Any) -> bool:
    return value is not default and not (np.isscalar(value) and value == default)


def _open_chunks(source: Any, parameters: Parameters, where: Any) -> Any:
    from itk_shearwarpmip import open_volume

    for name in ("series", "volume", "suv"):
        if where.pop(name, None):
            raise ValueError(f"{name} is for a DICOM folder or file")
    where["time"] = where.get("time") or 0
    default = Parameters()

    others = ("mask", "mask_label", "attenuation", "local_maximum", "threads")
    if wrong := [name for name in others if _is_given(getattr(parameters, name), getattr(default, name))]:
        raise ValueError(
            f"{', '.join(wrong)} cannot be given for a volume in chunks: give an array in memory, or an image"
        )
    spacing = parameters.output_spacing
    return open_volume(source, output_spacing=spacing, **where)


def _project_chunks(
    source: Any, view: Any, azimuth: float, elevation: float, parameters: Parameters, where: Any
) -> tuple[Any, Any]:
    """The picture, and its depths or None."""
    volume = _open_chunks(source, parameters, where)
    from itk_shearwarpmip import _projection

    transform = make_transform(volume.make_image(), view, azimuth, elevation)
    picture, depths, background = _projection.project(volume, transform, parameters)
    _warn_if_empty(picture, background, parameters)
    return show_itself(picture, background, volume, transform), depths and show_itself(
        depths, np.nan, volume, transform
    )


def _project_chunks_turning(
    source: Any, set_turn: Any, parameters: Parameters, where: Any
) -> tuple[Any, Any, list[Any], Any]:
    """The frames, their depths or None, their views and the center of the volume."""
    volume = _open_chunks(source, parameters, where)
    from itk_shearwarpmip import _projection

    stack, depths, background, views = _projection.project_turn(volume, set_turn, parameters)
    _warn_if_empty(stack, background, parameters)
    center = list(itk.ShearWarpMIPView.GetCenter(volume.make_image()))
    return show_itself(stack, background, volume), depths and show_itself(depths, np.nan, volume), views, center


def show_itself(picture: Any, background: float, source: Any, view: Any = None) -> Any:
    """Adds to an itk.Image, the projection of an image or a Volume, the entries for its display, and returns it."""
    is_image = isinstance(source, itk.Object)
    _entries.put(picture, "Background", float(background))
    _entries.put(picture, "IsInverted", "1" if is_image and _entries.is_inverted(source) else None)
    _entries.put(picture, "IsSuv", _entries.get(source, "IsSuv") if is_image else None)
    if is_image:
        _entries.put_place(picture, _entries.has_direction(source), _entries.get_unit(source))
    else:
        _entries.put_place(picture, source.has_direction, source.unit)
    if view is not None and picture.GetImageDimension() == 2:
        _entries.put(picture, "FrameTransforms", get_matrix(view).ravel().tolist())
    shown = type(picture).New()
    # the method of a picture that nobody keeps has the pixels
    shown.Graft(picture)
    shown.SetMetaDataDictionary(picture.GetMetaDataDictionary())
    if view is not None:
        picture._repr_png_ = lambda: _write.make_png(shown)
    return picture


def give_back(source: Any, picture: Any) -> Any:
    """Converts a picture to the type of the source."""
    is_placed = is_of(source, "nibabel", "SpatialImage") or is_of(source, "monai", "MetaTensor")
    if isinstance(source, str | os.PathLike | itk.Object) or is_placed:
        return picture
    if is_of(source, "xarray", "DataArray"):
        made = itk.xarray_from_image(picture)
        unit = _entries.get_unit(picture)
        for axis in made.dims if unit else ():
            made[axis].attrs["units"] = unit
        return made
    if is_chunked(source):
        return picture
    pixels = itk.array_from_image(picture)
    if is_of(source, "SimpleITK", "Image"):
        simple = sys.modules["SimpleITK"].GetImageFromArray(pixels)
        simple.SetSpacing(list(picture.GetSpacing()))
        simple.SetOrigin(list(picture.GetOrigin()))
        return simple
    if is_of(source, "torch", "Tensor"):
        return sys.modules["torch"].from_numpy(pixels)
    get_namespace = getattr(source, "__array_namespace__", None)
    return pixels if isinstance(source, np.ndarray) or get_namespace is None else get_namespace().asarray(pixels)

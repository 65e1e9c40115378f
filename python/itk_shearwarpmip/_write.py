"""Writes pictures, pages, animations, values and DICOM series, by the program shear-warp-mip."""

import html
import inspect
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip import _entries, _program
from itk_shearwarpmip._inputs import (
    find_millimetres,
    is_ome_zarr,
    is_plain_array,
    make_flag,
    open_grid,
    open_image,
    show_value,
)
from itk_shearwarpmip._labels import get_matrix
from itk_shearwarpmip._views import list_views, make_affine, make_transform

if TYPE_CHECKING:
    from itk_shearwarpmip._front import Turn


class OutputOptions(TypedDict, total=False):
    """The program's options of outputs, with underscores; see shear-warp-mip --help-all."""

    window: Sequence[float] | str
    """Values that become black and white, (low, high), or the name of a usual window."""
    wl: Sequence[float]
    """Middle and width of the window."""
    labels: bool
    """False for no letters of the patient's sides, L R A P H F."""
    annotate: bool
    """True for a scale bar and the angles of each view."""
    rate: float
    """Frames per second."""
    page_bits: int
    """8 or 16 bits per pixel of a page."""
    title: str
    """Title of a page."""
    dicom_out: str | os.PathLike[str]
    """A folder for a DICOM series too."""
    multi_frame: bool
    """True for a DICOM series in one file."""
    threads: int
    verbose: bool


_VOLUMES = ("mask", "overlay", "segments")
_WHERE = tuple(inspect.signature(open_image).parameters)[1:]
_NOT_OF_IMAGES = ("help", "help_all", "version")
_FLAGS = (
    "annotate", "exact", "in_place", "labels", "multi_frame", "no_labels", "page_volume", "rocking", "suv",
    "verbose", "with_attributes",
)  # fmt: skip


def make_arguments(options: Mapping[str, Any]) -> list[str]:
    """Arguments of the program, which refuses unknown ones. Options that are None are left out."""
    arguments = []
    for keyword, value in options.items():
        name = keyword.replace("-", "_")
        option = f"--{name.replace('_', '-')}"
        if name in _NOT_OF_IMAGES:
            raise TypeError(f"{name} is no option for an image")
        if value is None:
            continue
        if name == "labels":
            arguments += [] if make_flag(name, value) else ["--no-labels"]
        elif name in _FLAGS:
            arguments += [option] if make_flag(name, value) else []
        elif (text := _format(name, value)) is not None:
            arguments.append(f"{option}={text}")
        else:
            # the program refuses an unknown name
            with suppress(_program.ProgramError):
                _program.run([f"{option}=?", "--", os.devnull, os.devnull])
            raise ValueError(f"{name} must be a number, a text or a sequence, but it is {show_value(value)}")
    return arguments


_MOST_NUMBERS = 4096
"""That fit in one argument on every system."""
_LENGTHS = ("center", "crop", "output_spacing", "slab", "sliding_slab")


def _scale(options: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Options in mm, of options in a unit of so many mm, which is the image's."""
    if factor == 1.0:
        return dict(options)
    scaled = {name: factor * np.array(options[name], float) for name in _LENGTHS if options.get(name) is not None}
    if options.get("attenuation") is not None:
        scaled["attenuation"] = options["attenuation"] / factor
    return dict(options) | scaled


def _format(name: str, value: Any) -> str | None:
    """The text of a value, or None if no option has such a value."""
    if name == "mode":
        return str(value).replace("_", "-")
    if name == "crop" and np.shape(value) == (2, 3):
        # corners, as mip() takes them
        value = np.transpose(value).ravel()
    if isinstance(value, str | os.PathLike):
        return os.fspath(value)
    if isinstance(value, Integral) and not isinstance(value, bool):
        return str(int(value))
    if isinstance(value, Real) and not isinstance(value, bool):
        return repr(float(value))
    if isinstance(value, Sequence | np.ndarray) and np.ndim(value) == 1 and len(value) <= _MOST_NUMBERS:
        texts = [_format(name, each) for each in value]
        return None if None in texts else ",".join(filter(None, texts))
    return None


def write(source: Any, output: str | os.PathLike[str], **options: Any) -> None:
    """Projects a volume and writes the result, by the program shear-warp-mip: all that the program can do.

    source: the path of an image file, or of a DICOM folder; or another volume: see open_image().
    output: the file to write; its extension selects the format. Without an extension, it is a folder for a DICOM series,
        which is new or empty.
    options: spacing, origin, direction, series, volume, suv, level, time and channel of the source, as in open_image();
        and the program's long options, with underscores instead of hyphens: see `shear-warp-mip --help-all`. Lengths
        are in the unit of the source, which is mm for paths. Values are numbers, texts, paths, or sequences of numbers.
        Flags are True or False; labels=False is --no-labels. mask, overlay and segments may be volumes too. An array as
        mask, overlay or segments lies where the source does. view and transforms may also be what they are for turn().

    Raises TypeError for unknown options and unsupported types; ValueError for unsuitable values, with the program's
    sentence; FileNotFoundError for files that are missing, and without the program; OSError for files that cannot be
    read or written, and without ffmpeg; RuntimeError if the program was ended.

    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write(np.ones((30, 40, 50), np.int16), Path(folder, "turn.html"), frames=8, direction=np.eye(3))
    ...     os.listdir(folder)
    ['turn.html']
    """
    volumes = {name: options.pop(name) for name in _VOLUMES if options.get(name) is not None}
    where = {name: options.pop(name) for name in _WHERE if options.get(name) is not None}
    views = []
    if options.get("transforms") is not None:
        views = list_views(options.pop("transforms"))
    elif not isinstance(options.get("view"), str | None):
        views = [options.pop("view")]
    opened = None
    if _is_path(source) and where.keys() <= {"series", "volume", "suv"}:
        options |= where
    else:
        if not _is_path(source) and "suv" in where:
            # an overlay may be PET
            options["suv"] = where.pop("suv")
        opened = open_image(source, **where)
    grid = opened
    if opened is None and (views or any(map(_is_plain, volumes.values()))):
        grid = open_grid(os.fspath(source), where.get("series"), where.get("volume"))
    with _temporary_folder() as folder:
        factor = 1.0 if opened is None else find_millimetres(_entries.get_unit(opened))
        arguments = make_arguments(_scale(options, factor))
        for name, volume in volumes.items():
            if _is_path(volume):
                path = os.fspath(volume)
            else:
                try:
                    image, texts = _place_like(grid, volume) if _is_plain(volume) else (open_image(volume), None)
                except (TypeError, ValueError) as error:
                    raise type(error)(f"{name}: {error}") from None
                path = _write_volume(folder / f"{name}.nrrd", image, texts)
            arguments.append(f"--{name}={path}")
        if views:
            matrices = [get_matrix(make_transform(grid, view)) for view in views]
            arguments.append(f"--transform={_write_views(folder / 'view.tfm', matrices, factor)}")
        given = os.fspath(source) if opened is None else _write_volume(folder / "source.nrrd", opened)
        _run(folder, given, output, arguments)


def save_turn(turn: "Turn", path: str | os.PathLike[str], options: OutputOptions, with_notes: bool = True) -> None:
    """See Turn.save()."""
    window = {} if turn._window is None or "wl" in options else {"window": turn._window}
    arguments = make_arguments(window | dict(options))
    with _temporary_folder() as folder:
        _run(folder, _write_turn(folder / "turn.nrrd", turn), path, arguments, with_notes)


def make_page(turn: "Turn", options: OutputOptions | None = None) -> str:
    """The text of a web page that turns and plays a turn."""
    with _temporary_folder() as folder:
        save_turn(turn, folder / "page.html", options or {}, with_notes=False)
        return (folder / "page.html").read_text(encoding="utf-8")


def make_frame(turn: "Turn", *, height: int = 480) -> str:
    """The page of make_page() in an HTML element for notebooks; `height` is in pixels."""
    page = html.escape(make_page(turn))
    return f'<iframe srcdoc="{page}" style="width: 100%; height: {height}px; border: 0" allowfullscreen></iframe>'


def save_png(picture: Any, path: str | os.PathLike[str], **options: Unpack[OutputOptions]) -> None:
    """Writes a picture of mip() as a PNG of 8 bits, by the program shear-warp-mip.

    picture: a 2D itk.Image. To write its values, pass it to itk.imwrite() instead.
    options: window, wl, labels, annotate and others of the program's options of outputs: see Turn.save().

    Letters of the patient's sides are at the edges, L R A P H F. Oblique views have two letters, with the nearer side
    first. There are letters only if the volume has a direction; an array has one only if `direction` is given. Pictures
    with less than 48 columns or rows have no letters.

    Raises ValueError for another extension than .png, for unsuitable options, and for a picture that mip() did not make
    if it is to be annotated; TypeError for other objects, such as arrays; OSError if the file cannot be written.

    >>> from itk_shearwarpmip import mip
    >>> picture = mip(itk.image_from_array(np.ones((30, 40, 50), np.int16)), azimuth=30)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_png(picture, Path(folder, "mip.png"), annotate=True)
    """
    _save_png(picture, path, options)


def _save_png(picture: Any, path: str | os.PathLike[str], options: OutputOptions, with_notes: bool = True) -> None:
    if Path(path).suffix.lower() != ".png":
        raise ValueError(f"'{path}' must be a name that ends in .png: itk.imwrite() writes the values")
    if not isinstance(picture, itk.Object) or not hasattr(picture, "GetImageDimension"):
        raise TypeError(
            f"a picture is an itk.Image, but this is a {type(picture).__module__}.{type(picture).__qualname__}: of an array "
            "mip(open_image(array, spacing=...)) gives one"
        )
    if picture.GetImageDimension() != 2 or not itk.size(picture)[0]:
        raise ValueError(
            f"a picture has 2 dimensions and pixels, but this one has the size {list(itk.size(picture))}: see Turn.save()"
        )
    arguments = make_arguments(options)
    view = _entries.get_view(picture)
    if view is None:
        if options.get("annotate"):
            raise ValueError("annotate is for a picture as mip() gives it: this one has no view")
        arguments += [] if "--no-labels" in arguments else ["--no-labels"]
    with _temporary_folder() as folder:
        _run(folder, _write_picture(folder / "picture.nrrd", picture, view), path, arguments, with_notes)


def make_png(picture: Any) -> bytes:
    """The bytes of a PNG of a picture of mip()."""
    with _temporary_folder() as folder:
        _save_png(picture, folder / "picture.png", {}, with_notes=False)
        return (folder / "picture.png").read_bytes()


# ---- Temporary files


@contextmanager
def _temporary_folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(prefix="shear-warp-mip-") as name:
        yield Path(name)


def _run(
    folder: Path, source: str, output: str | os.PathLike[str], arguments: list[str], with_notes: bool = True
) -> None:
    path = os.fspath(output)
    name = Path(path).name
    if name and not Path(name).suffix and not name.startswith("."):
        path = os.path.join(path, "")
    trust = [f"--trust={file}" for file in folder.glob("*.nrrd")]
    _program.run([*arguments, *trust, "--", source, path], temporary=[*folder.iterdir()], with_notes=with_notes)


def _is_path(source: Any) -> bool:
    return isinstance(source, str | os.PathLike) and not is_ome_zarr(source)


def _is_plain(source: Any) -> bool:
    return not _is_path(source) and is_plain_array(source)


def _place_like(image: Any, array: Any) -> tuple[Any, dict[str, str]]:
    """An array as an image where another one lies, and what is known of that place."""
    placed = open_image(array)
    if placed.shape != image.shape:
        raise ValueError(
            f"an array must have the source's shape here, {tuple(image.shape)}, but it has "
            f"{tuple(placed.shape)}: give an image with a place of its own"
        )
    # itk.Image.CopyInformation() would leave another index
    placed.SetSpacing(image.GetSpacing())
    placed.SetOrigin(image.TransformIndexToPhysicalPoint(image.GetLargestPossibleRegion().GetIndex()))
    placed.SetDirection(image.GetDirection())
    return placed, {key: text for key, text in _describe(image).items() if key in ("HasOrientation", "Unit")}


def _write_views(path: Path, matrices: Sequence[NDArray[np.float64]], factor: float) -> str:
    for matrix in matrices:
        matrix[:3, 3] *= factor
    itk.transformwrite([make_affine(matrix) for matrix in matrices], str(path))
    return str(path)


def _write_volume(path: Path, image: Any, known: dict[str, str] | None = None) -> str:
    """Writes a 3D image, with its place in mm and what is known of it."""
    texts = _describe(image) if known is None else dict(known)
    factor = find_millimetres(texts.pop("Unit", None))
    start = image.TransformIndexToPhysicalPoint(image.GetBufferedRegion().GetIndex())
    axes = itk.array_from_matrix(image.GetDirection()) * np.array(image.GetSpacing()) * factor
    return _write_nrrd(path, itk.array_view_from_image(image), axes.T, factor * np.array(start), texts)


def _write_turn(path: Path, turn: "Turn") -> str:
    """Writes the frames of a turn, with what is known of them."""
    texts = _describe(turn.frames) | {"Mode": turn.mode}
    factor = find_millimetres(texts.get("Unit"))
    for key, lengths in {"Slab": turn.slab, "Center": turn.center}.items():
        if lengths is not None:
            texts[key] = _join(factor * np.array(lengths, float))
    texts |= {key: value for key, value in turn.source_metadata.items() if _is_dicom(key) and isinstance(value, str)}
    texts |= _name_files("SourceFiles", turn.source_files) | _name_files("MaskFiles", turn.mask_files)
    return _write_frames(path, turn.frames, [get_matrix(each) for each in turn.transforms], texts)


def _write_picture(path: Path, picture: Any, view: NDArray[np.float64] | None) -> str:
    return _write_frames(path, picture, [np.eye(4) if view is None else view], _describe(picture))


def _write_frames(path: Path, frames: Any, views: Sequence[NDArray[np.float64]], texts: dict[str, str]) -> str:
    """Writes frames in mm, whose other texts are in mm."""
    factor = find_millimetres(texts.pop("Unit", None))
    dimension = frames.GetImageDimension()
    scale = np.array([factor, factor, 1.0][:dimension])
    matrices = np.array(views, float)
    matrices[:, :3, 3] *= factor
    texts["FrameTransforms"] = _join(np.ravel(matrices))
    axes, origin = np.diag(scale * list(frames.GetSpacing())), scale * list(frames.GetOrigin())
    return _write_nrrd(path, itk.array_view_from_image(frames), axes, origin, texts)


def _is_dicom(key: str) -> bool:
    return re.fullmatch(r"[0-9a-fA-F]{4}\|[0-9a-fA-F]{4}", key) is not None


_CARRIED = "Background FrameAngles Loop HasOrientation IsInverted IsSuv Unit".split()


def _describe(image: Any) -> dict[str, str]:
    """What is known of an image beside its voxels and geometry, as text."""
    keys = image.GetMetaDataDictionary().GetKeys()
    texts = {key: _join(image[key]) for key in keys if key in _CARRIED}
    texts |= {key: image[key] for key in keys if _is_dicom(key) and isinstance(image[key], str)}
    return texts | _name_files("SourceFiles", _entries.get_source_files(image))


def _name_files(key: str, files: Sequence[Any]) -> dict[str, str]:
    return {key: _entries.pack_files([os.path.abspath(each) for each in files])} if files else {}


def _join(value: Any) -> str:
    if isinstance(value, str):
        return value
    return " ".join(repr(float(each)) for each in (value if np.ndim(value) else [value]))


def _write_nrrd(path: Path, pixels: NDArray[Any], axes: NDArray[Any], origin: Any, texts: Mapping[str, str]) -> str:
    """Writes an uncompressed NRRD of two or three axes, whose rows are the axes' vectors in LPS."""
    dimension = len(axes)
    vectors = [f"({','.join(repr(float(each)) for each in axis)})" for axis in axes]
    kinds = ["domain"] * dimension
    if pixels.ndim > dimension:
        vectors.insert(0, "none")
        kinds.insert(0, "vector")
    is_placed = dimension == 3 and texts.get("HasOrientation") != "0"
    names = {"float32": "float", "float64": "double"}
    # the components are the fastest axis of a file
    sizes = [*pixels.shape[dimension:], *reversed(pixels.shape[:dimension])]
    lines = [
        "NRRD0005",
        f"type: {names.get(pixels.dtype.name, pixels.dtype.name)}",
        f"dimension: {pixels.ndim}",
        "space: left-posterior-superior" if is_placed else f"space dimension: {dimension}",
        f"sizes: {' '.join(map(str, sizes))}",
        f"space directions: {' '.join(vectors)}",
        f"kinds: {' '.join(kinds)}",
        "endian: little",
        "encoding: raw",
        f"space origin: ({','.join(repr(float(each)) for each in origin)})",
    ]
    for key, text in texts.items():
        escaped = text.replace("\\", "\\\\").replace("\r", " ").replace("\n", "\\n")
        lines.append(f"{key}:={escaped}")
    try:
        with open(path, "wb") as file:
            file.write(("\n".join(lines) + "\n\n").encode("utf-8", "surrogateescape"))
            np.ascontiguousarray(pixels, pixels.dtype.newbyteorder("<")).tofile(file)
    except OSError as error:
        message = f"the {path.stem} needs more room than '{tempfile.gettempdir()}' has: set TMPDIR to another folder"
        raise OSError(message) from error
    return str(path)

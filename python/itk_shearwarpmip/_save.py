"""Files and pages of a turn, as the program shear-warp-mip writes them."""

import base64
import html
import json
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from importlib import resources
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip import _entries
from itk_shearwarpmip._inputs import find_millimetres, make_flag, make_view
from itk_shearwarpmip._labels import draw, find_sides, get_matrix

if TYPE_CHECKING:
    from itk_shearwarpmip._front import Turn

Window = tuple[float, float]

_VALUES = (".mha", ".nrrd", ".nii", ".nii.gz")
_ANIMATIONS = (".gif", ".apng", ".mp4")
_SUFFIXES = (".html", *_ANIMATIONS, ".png", *_VALUES)


def find_window(image: Any) -> Window:
    """The window that the program shear-warp-mip chooses: percentiles 1 and 99.8 of the pixels that are finite and not
    background.

    image: an itk.Image of any dimension, with one or several components. The entry "Background" of its dictionary is
        the value of the background. Without this entry, the background is 0, or the least pixel if it is negative.

    Returns the values that become black and white, low < high.

    >>> image = itk.image_from_array(np.arange(1001, dtype=np.uint16).reshape(7, 143))
    >>> find_window(image)
    (11.0, 998.0)
    """
    return find_window_of(itk.array_view_from_image(image), _find_background(image))


def find_window_of(pixels: NDArray[Any], background: float) -> Window:
    """The window of an array of pixels: see find_window()."""
    values = _select_values(pixels, background)
    if values.size == 0:
        low = float(background) if math.isfinite(background) else 0.0
        return low, max(low + 1.0, math.nextafter(low, math.inf))
    ranks = [math.floor(fraction * (values.size - 1) + 0.5) for fraction in (0.01, 0.998)]
    low, high = (float(value) for value in np.partition(values, ranks)[ranks])
    return (low, high) if low < high else (min(high - 1.0, math.nextafter(high, -math.inf)), high)


def make_grey(pixels: NDArray[Any], window: Window, is_inverted: bool = False) -> NDArray[np.uint8]:
    """Converts pixels to 8 bits: the window becomes 0 to 255, or 255 to 0."""
    low, high = window
    values = np.asarray(pixels, np.float64)
    values = np.where(values > low, np.minimum(values, high), low)
    grey = _round(255.0 * (values - low) / (high - low)).astype(np.uint8)
    return 255 - grey if is_inverted else grey


def encode_png(pixels: NDArray[Any], spacing: Sequence[float] = (1.0, 1.0)) -> bytes:
    """The bytes of a grey PNG.

    pixels: uint8 or uint16, of shape (rows, columns).
    spacing: of columns and rows, in mm.

    Raises TypeError for pixels of other types, and OSError if there is no room for a temporary file.

    >>> encode_png(np.zeros((4, 6), np.uint16))[:4]
    b'\\x89PNG'
    """
    if pixels.ndim != 2 or pixels.dtype not in (np.uint8, np.uint16):
        raise TypeError(f"a PNG has pixels of uint8 or uint16 in rows and columns, not {pixels.dtype} {pixels.shape}")
    with tempfile.TemporaryDirectory(prefix="shear-warp-mip-") as folder:
        path = Path(folder, "picture.png")
        _write_image(_make_image(pixels, spacing), path)
        return path.read_bytes()


def make_page(turn: "Turn", *, rate: float | None = None, window: Window | None = None, labels: bool = True) -> str:
    """The text of a web page that turns and plays a turn, with window and level. The page is complete in itself.

    rate: frames per second, from 0.1 to 100; by default 5 to 25, so that the turn takes about four seconds.
    window: low and high value, which are black and white when the page opens; by default the window of the turn.
    labels: whether the page shows the letters of the patient's sides and the scale bar when it opens. There are letters
        only if the volume has a direction, as in save_png().

    The page stores the frames with 8 bits, whose grey levels cover twice the range of the window in 254 steps.

    Raises ValueError and TypeError as save_turn() does.
    """
    pixels = _get_pixels(turn)
    rate = _get_rate(rate, len(pixels))
    low, high = _get_window(turn, window)
    background = _find_background(turn.frames)
    values = _select_values(pixels, background)
    blank = background if math.isfinite(background) else 0.0
    margin = 0.5 * (high - low)
    least = max(float(values.min()) if values.size else blank, low - margin)
    most = max(least, min(float(values.max()) if values.size else blank, high + margin))
    is_exact = pixels.dtype.kind in "iu" and most - least <= 254.0
    slope = 1.0 if is_exact or least == most else (most - least) / 254.0
    intercept = least - slope

    millimetres = find_millimetres(_entries.get_unit(turn.frames))
    spacing, origin = (
        [millimetres * each for each in list(place)[:2]]
        for place in (turn.frames.GetSpacing(), turn.frames.GetOrigin())
    )
    angles = _get_angles(turn)
    series: dict[str, Any] = {
        "title": _find_title(turn),
        "width": pixels.shape[2],
        "height": pixels.shape[1],
        "spacing": spacing,
        "origin": origin,
        "bits": 8,
        "slope": slope,
        "intercept": intercept,
        "background": 0,
        "inverted": _entries.is_inverted(turn.frames),
        "window": [low, high],
        "rate": rate,
        "loop": _find_loop(angles),
        "labels": make_flag("labels", labels),
        "frames": [],
    }
    if angles:
        series["angles"] = angles
    if _entries.has_direction(turn.frames):
        sides = [find_sides(get_matrix(transform)) for transform in turn.transforms]
        series["letters"] = [" ".join(each.values()) for each in sides]
    for frame in pixels:
        stored = _round((np.clip(frame.astype(np.float64), least, most) - intercept) / slope)
        stored[is_background(frame, background)] = 0
        series["frames"].append(base64.b64encode(encode_png(stored.astype(np.uint8), spacing)).decode())
    template = resources.files("itk_shearwarpmip").joinpath("cine.html").read_text(encoding="utf-8")
    return template.replace("@SERIES@", json.dumps(series).replace("<", "\\u003c"), 1)


def make_frame(turn: "Turn", *, height: int = 480) -> str:
    """The page of make_page() in an HTML element for notebooks; `height` is in pixels."""
    page = html.escape(make_page(turn))
    return f'<iframe srcdoc="{page}" style="width: 100%; height: {height}px; border: 0" allowfullscreen></iframe>'


def save_png(
    picture: Any,
    path: str | os.PathLike[str],
    *,
    window: Window | None = None,
    labels: bool = True,
    annotate: bool = False,
) -> None:
    """Writes a picture of mip() as a grey PNG of 8 bits, as the program shear-warp-mip does.

    picture: a 2D itk.Image. To write its values, pass it to itk.imwrite() instead.
    window: the values that become black and white, (low, high); by default the window that the program chooses.
    labels: True for letters of the patient's sides at the edges, L R A P H F. Oblique views have two letters, with the
        nearer side first. There are letters only if the volume has a direction; an array has one only if `direction` is
        given. Pictures with less than 48 columns or rows have no letters.
    annotate: True for a scale bar with its length, and the angles of the view: degrees to the left or right anterior
        oblique side (LAO, RAO) and to cranial or caudal (CRA, CAU).

    Raises ValueError for another extension than .png, for an unsuitable window, and with `annotate` for a picture that
    mip() did not make; TypeError for other objects, such as arrays; OSError if the file cannot be written.

    >>> from itk_shearwarpmip import mip
    >>> picture = mip(itk.image_from_array(np.ones((30, 40, 50), np.int16)), azimuth=30)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_png(picture, Path(folder, "mip.png"), annotate=True)
    """
    if Path(path).suffix.lower() != ".png":
        raise ValueError(f"'{path}' must be a name that ends in .png: itk.imwrite() writes the values")
    if not isinstance(picture, itk.Object) or not hasattr(picture, "GetImageDimension"):
        raise TypeError(
            f"a picture is an itk.Image, but this is a {type(picture).__module__}.{type(picture).__qualname__}: of an array "
            "mip(open_image(array, spacing=...)) gives one"
        )
    dimension, components = picture.GetImageDimension(), picture.GetNumberOfComponentsPerPixel()
    if dimension != 2 or components != 1 or not itk.size(picture)[0]:
        raise ValueError(
            f"a picture has 2 dimensions, 1 component and pixels, but this one has {dimension}, {components} and the size "
            f"{list(itk.size(picture))}: see Turn.save()"
        )
    if annotate and _entries.get_view(picture) is None:
        raise ValueError("annotate is for a picture as mip() gives it: this one has no view")
    grey = make_picture(picture, window, make_flag("labels", labels), make_flag("annotate", annotate))
    target = _find_target(Path(path))
    _require_writable(target)
    with tempfile.TemporaryDirectory(prefix=".shear-warp-mip-", dir=target.parent) as folder:
        made = Path(folder, target.name.lower())
        _write_image(_make_image(grey, list(picture.GetSpacing())), made)
        _publish({made: target}, Path(folder))


def make_picture(
    picture: Any, window: Window | None = None, labels: bool = True, annotate: bool = False
) -> NDArray[np.uint8]:
    """Returns the grey pixels of a picture of mip()."""
    window = find_window(picture) if window is None else check_window(window)
    pixels = itk.array_view_from_image(picture)
    return _make_labelled(pixels, window, picture, _entries.get_view(picture), labels, annotate)


def _make_labelled(
    pixels: NDArray[Any], window: Window, image: Any, view: NDArray[np.float64] | None, labels: bool, annotate: bool
) -> NDArray[np.uint8]:
    """Returns the grey pixels of an image of mip() or turn(), with letters and annotations."""
    grey = make_grey(pixels, window, _entries.is_inverted(image))
    if view is None:
        return grey
    has_sides = labels and _entries.has_direction(image)
    spacing = image.GetSpacing()[0] * find_millimetres(_entries.get_unit(image))
    return draw(grey, view, spacing, has_sides=has_sides, has_scale=annotate)


def save_turn(
    turn: "Turn",
    path: str | os.PathLike[str],
    *,
    rate: float | None = None,
    window: Window | None = None,
    labels: bool = True,
    annotate: bool = False,
) -> None:
    """See Turn.save(). Also raises TypeError for frames of several components."""
    given = Path(path)
    suffix = _get_suffix(given)
    make_flag("labels", labels)
    make_flag("annotate", annotate)
    pixels = _get_pixels(turn)
    rate = _get_rate(rate, len(pixels))
    if window is not None:
        _get_window(turn, window)
    target = _find_target(given)
    names = [target.name]
    if suffix == ".png":
        width = max(3, len(str(len(pixels) - 1)))
        names = [f"{target.stem}-{frame:0{width}}.png" for frame in range(len(pixels))]
    for name in names:
        _require_writable(target.parent / name, (*turn.source_files, *turn.mask_files), is_folder=not suffix)
    if suffix in _ANIMATIONS:
        _find_ffmpeg()

    with tempfile.TemporaryDirectory(prefix=".shear-warp-mip-", dir=target.parent) as folder:
        # ITK knows no capitals
        files = {Path(folder, name.lower()): target.parent / name for name in names}
        made = next(iter(files))
        if not suffix:
            _write_dicom(turn, made, window)
        elif suffix == ".html":
            made.write_text(make_page(turn, rate=rate, window=window, labels=labels), encoding="utf-8")
        elif suffix in _VALUES:
            stack = make_view(pixels)
            stack.CopyInformation(turn.frames)
            _write_image(stack, made)
        else:
            chosen = _get_window(turn, window)
            pictures = np.stack(
                [
                    _make_labelled(frame, chosen, turn.frames, get_matrix(transform), labels, annotate)
                    for frame, transform in zip(pixels, turn.transforms, strict=True)
                ]
            )
            if suffix == ".png":
                for place, picture in zip(files, pictures, strict=True):
                    _write_image(_make_image(picture, list(turn.frames.GetSpacing())[:2]), place)
            else:
                _write_animation(pictures, rate, made)
        _publish(files, Path(folder))


def _round(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rounds to whole numbers, halves up, like std::lround for numbers that are not negative."""
    whole = np.floor(values)
    return whole + (values - whole >= 0.5)


def _find_background(image: Any) -> float:
    if image.GetMetaDataDictionary().HasKey("Background"):
        return float(image["Background"])
    return min(0.0, float(np.fmin.reduce(itk.array_view_from_image(image), axis=None)))


def is_background(pixels: NDArray[Any], background: float) -> NDArray[np.bool_]:
    """Whether pixels are background or not-a-number."""
    found: NDArray[np.bool_] = (pixels == background) | np.isnan(pixels)
    return found


def _select_values(pixels: NDArray[Any], background: float) -> NDArray[Any]:
    values: NDArray[Any] = pixels[~is_background(pixels, background) & np.isfinite(pixels)]
    return values


def _get_pixels(turn: "Turn") -> NDArray[Any]:
    """Of shape (frames, rows, columns), not copied."""
    frames = turn.frames
    components = frames.GetNumberOfComponentsPerPixel()
    if components != 1:
        raise TypeError(f"frames must have one value for each pixel, but they have {components}: save the components")
    pixels: NDArray[Any] = itk.array_view_from_image(frames)
    if pixels.ndim != 3:
        raise TypeError(f"frames must be a 3D image, their third axis the frames, but it has {pixels.ndim} dimensions")
    return pixels


def _get_rate(rate: float | None, frames: int) -> float:
    if rate is None:
        return min(max(math.floor(frames / 4 + 0.5), 5), 25)
    if not isinstance(rate, Real) or not 0.1 <= rate <= 100.0:
        raise ValueError(f"rate must be from 0.1 to 100 frames per second, but it is {rate!r}")
    return rate if isinstance(rate, int) else float(rate)


def _get_window(turn: "Turn", window: Window | None) -> Window:
    given = turn.window if window is None else window
    if given is None:
        return find_window(turn.frames)
    return check_window(given)


def check_window(window: Any) -> Window:
    message = f"window must be two finite numbers, the lower one first, but it is {window!r}"
    try:
        low, high = (float(value) for value in window)
    except (TypeError, ValueError) as error:
        raise ValueError(message) from error
    if not low < high or not math.isfinite(high - low):
        raise ValueError(message)
    return low, high


def _get_angles(turn: "Turn") -> list[float]:
    return list(dict(turn.frames).get("FrameAngles", []))


def _find_loop(angles: list[float]) -> str:
    """How a turn continues after its last frame: "turn" in the same direction, "swing" to and fro, or "none"."""
    if len(angles) == 1:
        return "turn"
    steps = np.diff(angles)
    if steps.size and steps.min() < 0.0 < steps.max():
        return "swing"
    return "turn" if steps.size and math.isclose(abs(steps[0]) * len(angles), 360.0) else "none"


def _find_title(turn: "Turn") -> str:
    """The name of the source's file; the name of a folder is often a patient's."""
    paths = [Path(path) for path in turn.source_files]
    return paths[0].name if len(paths) == 1 else "Maximum intensity projection"


def _get_suffix(path: Path) -> str:
    if path.suffix:
        for suffix in _SUFFIXES:
            if path.name.lower().endswith(suffix):
                return suffix
    elif path.name and path.name.lower() not in _SUFFIXES:
        return ""
    raise ValueError(
        f"'{path}' must be a name that ends in one of {' '.join(_SUFFIXES)}, or be a folder for DICOM, without a suffix"
    )


def _find_target(given: Path) -> Path:
    """Follows a link; the folder of the target must exist."""
    target = Path(os.path.realpath(given))
    if not target.parent.is_dir():
        raise FileNotFoundError(f"'{target.parent}' is no folder to write '{given.name}' into: make it first")
    return target


def _require_writable(path: Path, sources: Sequence[Path] = (), *, is_folder: bool = False) -> None:
    if not path.exists():
        return
    if is_folder and not (path.is_dir() and not any(path.iterdir())):
        raise FileExistsError(f"'{path}' is there already: a DICOM series needs a folder that is new or empty")
    if not is_folder and not path.is_file():
        raise ValueError(f"'{path}' is a folder or a device: only files can be written")
    if not os.access(path, os.W_OK):
        raise PermissionError(f"'{path}' is write-protected")
    for source in sources:
        if os.path.exists(source) and path.samefile(source):
            raise ValueError(f"'{path}' was read to make this turn: give another name")


def _make_image(pixels: NDArray[Any], spacing: Sequence[float]) -> Any:
    image = make_view(np.ascontiguousarray(pixels))
    image.SetSpacing([float(step) for step in spacing])
    return image


def _write_image(image: Any, path: Path) -> None:
    """Writes an image, and notices a full disk, which not all of ITK's writers do."""
    pixels = itk.array_view_from_image(image)
    full = OSError(f"cannot write all of '{path.name}'; is the disk full?")
    try:
        itk.imwrite(image, str(path))
        is_complete = np.array_equal(itk.imread(str(path)), pixels, equal_nan=True)
    except (RuntimeError, OSError) as error:
        raise full from error
    if not is_complete:
        raise full


def _find_ffmpeg() -> str:
    found = shutil.which("ffmpeg")
    if not found:
        raise RuntimeError("an animation needs the program ffmpeg: install it, as by apt install ffmpeg")
    return found


def _write_animation(pictures: NDArray[np.uint8], rate: float, path: Path) -> None:
    """Writes an animation by ffmpeg, with the arguments of apps/Animation.cxx."""
    encoding = {
        # sizes must be even
        ".mp4": "-vf pad=ceil(iw/2)*2:ceil(ih/2)*2 -c:v libx264 -crf 18 -pix_fmt yuv420p -movflags +faststart -f mp4",
        ".apng": "-pix_fmt gray -pred mixed -plays 0 -f apng",
        ".gif": "-pix_fmt gray -f gif",
    }[path.suffix].split()
    size = f"{pictures.shape[2]}x{pictures.shape[1]}"
    source = f"-f rawvideo -pixel_format gray -video_size {size} -framerate {rate:g} -i pipe:".split()
    start = [_find_ffmpeg(), "-nostdin", "-v", "error"]
    for command, data in (
        ([*start, "-y", *source, *encoding, "-bitexact", f"file:{path}"], pictures.tobytes()),
        # it does not notice each full disk
        ([*start, "-i", f"file:{path}", "-f", "null", "-"], b""),
    ):
        done = subprocess.run(command, input=data, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        if done.returncode != 0 or done.stdout:
            raise RuntimeError(f"ffmpeg failed: {done.stdout.decode(errors='replace').strip()}")


def _write_dicom(turn: "Turn", folder: Path, window: Window | None) -> None:
    unit = _entries.get_unit(turn.frames)
    if find_millimetres(unit) != 1.0:
        raise ValueError(f"a DICOM series has mm, but this turn has {unit}: give spacing= and origin= in mm")
    try:
        from itk_shearwarpmip import _dicom_series
    except ImportError as error:
        raise ImportError("a DICOM series needs pydicom: pip install itk-shearwarpmip[dicom]") from error
    _dicom_series.write_series(turn, folder, window)


def _publish(files: Mapping[Path, Path], folder: Path) -> None:
    """Renames all files (the keys) to their names (the values), or none. Meanwhile `folder` keeps the older files."""
    with ExitStack() as undo:
        for number, (made, target) in enumerate(files.items()):
            if not target.exists():
                os.replace(made, target)
                undo.callback(os.replace, target, made)
                continue
            shutil.copymode(target, made)
            former = folder / f"former-{number}"
            if target.is_file():
                try:
                    os.link(target, former)
                except OSError:
                    shutil.copy2(target, former)
                undo.callback(os.replace, former, target)
            elif os.name == "nt":
                target.rmdir()
                undo.callback(target.mkdir)
            os.replace(made, target)
        undo.pop_all()

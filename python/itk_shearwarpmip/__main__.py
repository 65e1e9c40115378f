"""python -m itk_shearwarpmip [mip]: projects an OME-Zarr image to a picture or a series of frames.

python -m itk_shearwarpmip view, and shear-warp-mip-view: opens the viewer in the browser.
"""

import argparse
import os
import stat
import sys
from contextlib import ExitStack

import itk
import numpy as np

import itk_shearwarpmip
from itk_shearwarpmip._inputs import describe
from itk_shearwarpmip._parameters import MODES


def _make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m itk_shearwarpmip",
        description="Maximum intensity projection (MIP) of an OME-Zarr volume of any size, chunk by chunk. "
        "For other files, use the program shear-warp-mip. For the viewer, see python -m itk_shearwarpmip view --help.",
    )
    parser.add_argument("input", metavar="INPUT", help="path or URL of an OME-Zarr image, version 0.4 or 0.5")
    parser.add_argument(
        "output",
        metavar="OUTPUT",
        help="image file that ITK writes: .mha, .nrrd, .nii.gz, .tif, ...; frames as a stack",
    )
    parser.add_argument(
        "--angles",
        metavar=("X", "Y", "Z"),
        nargs=3,
        type=float,
        default=(0.0, 0.0, 0.0),
        help="turns the view about the volume's center and axes, in degrees; by default the view is along z",
    )
    parser.add_argument("--frames", metavar="N", type=int, help="makes a turn of N views about the y axis")
    parser.add_argument(
        "--output-spacing", metavar="S", type=float, help="spacing of the output, in the units of the file"
    )
    parser.add_argument("--oversampling", type=int, choices=(1, 2), default=1, help="intermediate pixels per voxel")
    parser.add_argument(
        "--level", metavar="N", type=int, help="resolution; 0 is the finest; by default chosen for --output-spacing"
    )
    parser.add_argument("--time", metavar="N", type=int, default=0, help="number of the time point")
    parser.add_argument("--channel", metavar="N", type=int, default=0, help="number of the channel")
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a Dask cluster; by default threads of this computer"
    )
    parser.add_argument("--quiet", action="store_true", help="shows no progress bar")
    return parser


def _holds(path: str, wanted: os.stat_result) -> bool:
    """Whether a path is the wanted file, or a folder that contains it, by any name."""
    waiting, seen = [path], set()
    while waiting:
        path = waiting.pop()
        try:
            found = os.stat(path)
        except FileNotFoundError:
            continue
        if os.path.samestat(found, wanted):
            return True
        key = found.st_dev, found.st_ino
        if stat.S_ISDIR(found.st_mode) and key not in seen:
            seen.add(key)
            waiting.extend(entry.path for entry in os.scandir(path))
    return False


def _is_read(path: str, source: str) -> bool:
    """Whether a path is the source, or a part of the source. URLs may be chained."""
    written = os.path.realpath(path)
    for part in {source, *source.split("::")}:
        scheme, _, read = part.rpartition("://")
        if read and scheme in ("", "file", "local"):
            read = os.path.realpath(read)
            if written == read or written.startswith(os.path.join(read, "")):
                return True
            if os.path.exists(written) and _holds(read, os.stat(written)):
                return True
    return False


_FLAT = {"BMPImageIO", "JPEGImageIO", "JPEG2000ImageIO", "PNGImageIO"}
"""Writers that store one picture per file."""


def _require_writable(path: str, has_frames: bool) -> None:
    folder = os.path.dirname(path) or "."
    writer = itk.ImageIOFactory.CreateImageIO(path, itk.CommonEnums.IOFileMode_WriteMode)
    if not writer:
        raise ValueError(f"ITK writes no image of the name '{path}'")
    if has_frames and writer.GetNameOfClass() in _FLAT:
        raise ValueError(f"--frames needs OUTPUT to end in .mha, .nrrd, .nii.gz or .tif: '{path}' would hold one frame")
    if not os.access(folder, os.W_OK):
        raise ValueError(f"'{folder}' is no folder that files can be written into")


def _project(options: argparse.Namespace) -> itk.Image:
    volume = itk_shearwarpmip.open_volume(
        options.input,
        output_spacing=options.output_spacing,
        level=options.level,
        time=options.time,
        channel=options.channel,
    )
    outline = volume.make_image()
    shared = {"output_spacing": options.output_spacing, "oversampling": options.oversampling}
    with ExitStack() as stack:
        if options.scheduler:
            from distributed import Client

            stack.enter_context(Client(options.scheduler))
        if not options.quiet:
            from dask.diagnostics import ProgressBar

            stack.enter_context(ProgressBar())
        if options.frames is not None:
            axis = (0.0, 1.0, 0.0)
            upright = itk.ShearWarpMIPView.MakeUprightTransform(outline, axis)
            return itk_shearwarpmip.turn(volume, upright, frames=options.frames, rotation_axis=axis, **shared).frames
        view = itk.CenteredEuler3DTransform[itk.D].New()
        view.SetCenter(itk.ShearWarpMIPView.GetCenter(outline))
        view.SetRotation(*np.radians(options.angles))
        return itk_shearwarpmip.mip(volume, view, **shared)


def _make_view_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="shear-warp-mip-view",
        description="Maximum intensity projection (MIP) that turns with the mouse, in a page that the browser opens. "
        "? in the page lists gestures and keys. Ctrl-C ends the program.",
        epilog="The page is served on this computer only, and its address contains a token that nobody can guess. "
        "With --host, everyone who has the address can see and turn the picture. There is no encryption, so others in "
        "the network can read it.",
    )
    parser.add_argument("input", metavar="FILE", help="an image file, a DICOM folder or an OME-Zarr image")
    parser.add_argument(
        "--series",
        metavar="SERIES",
        help="DICOM series, if the folder has several: its number, a part of its description, or its UID",
    )
    parser.add_argument("--volume", metavar="NUMBER", help="volume of a DICOM series or file that has several")
    parser.add_argument(
        "--suv",
        action="store_true",
        default=argparse.SUPPRESS,
        help="values of a DICOM PET series as SUV by body weight",
    )
    parser.add_argument(
        "--level",
        metavar="N",
        type=int,
        help="resolution of an OME-Zarr image, needed if it has several; 0 is the finest",
    )
    for name in ("time", "channel"):
        of = "a 4D file or an OME-Zarr image" if name == "time" else "an OME-Zarr image"
        parser.add_argument(f"--{name}", metavar="N", type=int, default=argparse.SUPPRESS, help=f"of {of}")
    parser.add_argument(
        "--overlay", metavar="FILE", help="a second image of the same patient, in colours over the first"
    )
    parser.add_argument("--view", metavar="SIDE", default="anterior", help="anterior, posterior, left, ...")
    parser.add_argument("--azimuth", metavar="DEGREES", type=float, default=0.0)
    parser.add_argument("--elevation", metavar="DEGREES", type=float, default=0.0)
    for name in ("window", "overlay-window"):
        parser.add_argument(f"--{name}", metavar=("LOW", "HIGH"), nargs=2, type=float, help="values of black and white")
    parser.add_argument("--mode", default="maximum", help=f"one of {', '.join(MODES)}".replace("_", "-"))
    parser.add_argument("--slab", metavar=("NEAR", "FAR"), nargs=2, type=float, help="depths to project, in mm")
    parser.add_argument("--exact", action="store_true", help="exact maxima while the picture is at rest")
    parser.add_argument("--title", metavar="TEXT", default="", help="in the picture; by default no name of a file")
    parser.add_argument("--host", default="127.0.0.1", help="address to serve at; by default this computer only")
    parser.add_argument("--port", type=int, default=0, help="port of the page; by default a free one")
    parser.add_argument("--no-browser", action="store_true", help="only prints the page's address")
    return parser


def view(arguments: list[str] | None = None) -> int:
    """shear-warp-mip-view."""
    options = vars(_make_view_parser().parse_args(arguments))
    options["mode"] = options["mode"].replace("-", "_")
    page = {name: options.pop(name) for name in ("host", "port", "no_browser")}
    try:
        itk_shearwarpmip.show(options.pop("input"), page=page, block=True, **options)
    except Exception as error:
        print(f"shear-warp-mip-view: {describe(error)}", file=sys.stderr)
        return 1
    return 0


def main(arguments: list[str] | None = None) -> int:
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["view"]:
        return view(arguments[1:])
    if arguments[:1] == ["mip"] and not os.path.exists("mip"):
        arguments = arguments[1:]
    options = _make_parser().parse_args(arguments)
    try:
        if os.path.isfile(options.input) and not options.input.endswith(".zip"):
            raise ValueError(f"INPUT must be an OME-Zarr, but '{options.input}' is another file: use shear-warp-mip")
        if _is_read(options.output, options.input):
            raise ValueError(f"OUTPUT must not be in INPUT, but {options.output} is")
        _require_writable(options.output, options.frames is not None)
        picture = _project(options)
        itk.imwrite(picture, options.output)
    except Exception as error:
        print(f"itk_shearwarpmip: {describe(error)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

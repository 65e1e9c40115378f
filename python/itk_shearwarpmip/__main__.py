"""python -m itk_shearwarpmip: the projection of an OME-Zarr to a picture or a series of frames."""

import argparse
import sys
from contextlib import ExitStack

import itk
import numpy as np
from dask.diagnostics import ProgressBar

from itk_shearwarpmip import mip, mip_cine, open_volume


def _make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m itk_shearwarpmip",
        description="Maximum intensity projection (MIP) of an OME-Zarr volume of any size, chunk by chunk.",
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
        help="turns of the view about the volume's centre and axes, in degrees; by default it looks along z",
    )
    parser.add_argument("--frames", metavar="N", type=int, help="this many views around the axis y instead of one")
    parser.add_argument("--spacing", metavar="S", type=float, help="of the output, in the units of the file")
    parser.add_argument("--oversampling", type=int, choices=(1, 2), default=1, help="intermediate pixels per voxel")
    parser.add_argument("--level", metavar="N", type=int, help="resolution, 0 is the finest; by default for --spacing")
    parser.add_argument("--time", metavar="N", type=int, default=0, help="which point in time")
    parser.add_argument("--channel", metavar="N", type=int, default=0, help="which channel")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster; by default threads of this computer")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser


def _project(options: argparse.Namespace) -> itk.Image:
    place = {
        "output_spacing": options.spacing,
        "level": options.level,
        "time": options.time,
        "channel": options.channel,
    }
    if options.frames is not None:
        turn = {"number_of_frames": options.frames, "rotation_axis": (0.0, 1.0, 0.0)}
        return mip_cine(options.input, oversampling=options.oversampling, **turn, **place)
    view = itk.CenteredEuler3DTransform[itk.D].New()
    view.SetCenter(itk.ShearWarpMIPView.GetCentre(open_volume(options.input, **place).make_image()))
    view.SetRotation(*np.radians(options.angles))
    return mip(options.input, view, oversampling=options.oversampling, **place)


def main(arguments: list[str] | None = None) -> int:
    options = _make_parser().parse_args(arguments)
    try:
        with ExitStack() as stack:
            if options.scheduler:
                from distributed import Client

                stack.enter_context(Client(options.scheduler))
            if not options.quiet:
                stack.enter_context(ProgressBar())
            picture = _project(options)
        itk.imwrite(picture, options.output)
    except (OSError, RuntimeError, TypeError, ValueError) as error:
        print(f"itk_shearwarpmip: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

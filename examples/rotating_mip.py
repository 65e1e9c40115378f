#!/usr/bin/env python3
"""Animation of a volume's maximum intensity projection, turning about the patient's long axis.

rotating_mip.py angiogram.nrrd angiogram.gif
rotating_mip.py dicom_folder/ head.webp --frames 72 --elevation 15
"""

import argparse
import sys
import time
from pathlib import Path

import itk
import numpy as np
from PIL import Image

FORMATS = (".gif", ".webp", ".png")


def read_volume(path: Path):
    """A 3D image from a file or a folder of DICOM files, in a pixel type that the filter knows."""
    if not path.exists():
        sys.exit(f"error: {path} does not exist")
    source = str(path)
    if path.is_dir():
        names = itk.GDCMSeriesFileNames.New(Directory=source)
        series = names.GetSeriesUIDs()
        if not series:
            sys.exit(f"error: no DICOM series in {path}")
        source = max((names.GetFileNames(uid) for uid in series), key=len)
    try:
        image = itk.imread(source)
        if type(image) not in (types[0] for types in itk.ShearWarpMIPImageFilter.keys()):
            image = itk.imread(source, itk.F)
    except (RuntimeError, KeyError, itk.TemplateTypeError):
        sys.exit(f"error: {path} is not an image that ITK can read")
    if image.GetImageDimension() != 3:
        sys.exit(f"error: {path} has {image.GetImageDimension()} dimensions, not 3")
    return image


def render(image, frames: int, elevation: float) -> list[np.ndarray]:
    """One projection per frame, all on one grid."""
    anterior = itk.ShearWarpMIPViewEnums.Direction_Anterior
    series = itk.shear_warp_mip_cine_image_filter(
        image,
        transform=itk.ShearWarpMIPView.MakeTransform(image, anterior, 0.0, elevation),
        number_of_frames=frames,
        default_pixel_value=itk.array_view_from_image(image).min().item(),
    )
    return list(itk.array_from_image(series))


def to_grey(pictures: list[np.ndarray], percentiles: tuple[float, float]) -> list[np.ndarray]:
    """8-bit pictures; one window for all, by percentiles of what is not background."""
    stack = np.stack(pictures).astype(np.float32)
    seen = stack[stack > stack.min()]
    low, high = np.percentile(seen, percentiles) if seen.size else (0.0, 1.0)
    return list((255 * np.clip((stack - low) / max(high - low, 1e-6), 0, 1) + 0.5).astype(np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", type=Path, help="a 3D image file, or a folder of DICOM files")
    parser.add_argument("output", type=Path, help="the animation: .gif, .webp or .png")
    parser.add_argument("--frames", type=int, default=36, help="frames of a full turn [36]")
    parser.add_argument("--elevation", type=float, default=0.0, help="degrees from above [0]")
    parser.add_argument("--seconds", type=float, default=3.6, help="time of a full turn [3.6]")
    parser.add_argument(
        "--window",
        type=float,
        nargs=2,
        default=(2.0, 99.8),
        metavar=("LOW", "HIGH"),
        help="percentiles shown as black and white [2 99.8]",
    )
    arguments = parser.parse_args()
    if arguments.output.suffix.lower() not in FORMATS:
        sys.exit(f"error: the output must end in {', '.join(FORMATS)}, not {arguments.output.name}")
    if arguments.frames < 1:
        sys.exit(f"error: --frames must be at least 1, not {arguments.frames}")

    image = read_volume(arguments.image)
    start = time.perf_counter()
    pictures = render(image, arguments.frames, arguments.elevation)
    seconds = time.perf_counter() - start
    height, width = pictures[0].shape
    spacing = min(image.GetSpacing())
    print(
        f"{len(pictures)} frames of {width} x {height} pixels of {spacing:.3g} mm: "
        f"{1000 * seconds / len(pictures):.1f} ms per frame"
    )

    first, *others = (Image.fromarray(grey) for grey in to_grey(pictures, arguments.window))
    duration = max(20, round(1000 * arguments.seconds / arguments.frames))
    try:
        first.save(arguments.output, save_all=True, append_images=others, duration=duration, loop=0)
    except OSError as error:
        sys.exit(f"error: {arguments.output} can't be written: {error.strerror}")


if __name__ == "__main__":
    main()

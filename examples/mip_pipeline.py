#!/usr/bin/env python3
"""The projection at the end of an ITK pipeline: vessels are enhanced, then projected.

The picture shows the projection of the volume beside the projection of its vesselness (Sato
et al. 1998, the largest response over several widths of vessel).

    mip_pipeline.py angiogram.nrrd vessels.png --azimuth 30
"""

import argparse
import sys
from pathlib import Path

import itk
import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np


def vesselness(image, sigmas: list[float]):
    """Largest response of bright tubes over the given Gaussian widths, in mm."""
    hessian = itk.HessianRecursiveGaussianImageFilter.New(image, NormalizeAcrossScale=True)
    measure = itk.Hessian3DToVesselnessMeasureImageFilter[itk.F].New(hessian.GetOutput())
    largest = None
    for sigma in sigmas:
        hessian.SetSigma(sigma)
        measure.Update()
        response = itk.array_from_image(measure.GetOutput())
        largest = response if largest is None else np.maximum(largest, response)
    result = itk.image_from_array(largest)
    result.CopyInformation(image)
    return result


def show(axes, mip, title: str) -> None:
    pixels = itk.array_view_from_image(mip)
    seen = pixels[pixels > pixels.min()]
    low, high = np.percentile(seen, (2, 99.5)) if seen.size else (0, 1)
    (width, height), (x, y) = itk.size(mip), mip.GetSpacing()
    axes.imshow(pixels, cmap="gray", vmin=low, vmax=high, extent=(0, width * x, height * y, 0))
    axes.set_title(title, color="white")
    axes.set_axis_off()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", type=Path, help="a 3D image file")
    parser.add_argument("output", type=Path, help="the picture: .png, .jpg, .pdf, ...")
    parser.add_argument("--azimuth", type=float, default=0.0, help="degrees to the patient's left [0]")
    parser.add_argument("--elevation", type=float, default=0.0, help="degrees from above [0]")
    parser.add_argument(
        "--sigma",
        type=float,
        nargs="+",
        default=[1.0, 2.0],
        metavar="MM",
        help="widths of the vessels, as standard deviations in mm [1 2]",
    )
    arguments = parser.parse_args()
    if not arguments.image.is_file():
        sys.exit(f"error: {arguments.image} does not exist")
    if min(arguments.sigma) <= 0:
        sys.exit("error: --sigma must be positive")
    try:
        image = itk.imread(str(arguments.image), itk.F)
    except (RuntimeError, KeyError, itk.TemplateTypeError):
        sys.exit(f"error: {arguments.image} is not an image that ITK can read")
    if image.GetImageDimension() != 3:
        sys.exit(f"error: {arguments.image} has {image.GetImageDimension()} dimensions, not 3")

    view = itk.ShearWarpMIPView.MakeTransform(
        image,
        itk.ShearWarpMIPViewEnums.Direction_Anterior,
        arguments.azimuth,
        arguments.elevation,
    )
    darkest = itk.array_view_from_image(image).min().item()
    before = itk.shear_warp_mip_image_filter(image, transform=view, default_pixel_value=darkest)
    after = itk.shear_warp_mip_image_filter(vesselness(image, arguments.sigma), transform=view)

    (columns, rows), (x, y) = itk.size(before), before.GetSpacing()
    figure, (left, right) = plt.subplots(
        1,
        2,
        figsize=(10, 5 * (rows * y) / (columns * x) + 0.4),
        facecolor="black",
        layout="constrained",
    )
    show(left, before, "Volume")
    show(right, after, "Vesselness")
    try:
        figure.savefig(arguments.output, dpi=150)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {arguments.output} can't be written: {error}")
    print(f"{arguments.output}: azimuth {arguments.azimuth:g}, elevation {arguments.elevation:g}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The projection of every channel of a colour or vector image, or of every time point of a 4D image.

All are seen by one view, on one grid. The result has as many channels or time points; its first two
axes are the axes of the view plane.

    channels_mip.py cells.tif mip.tif --azimuth 30
    channels_mip.py perfusion.nii.gz mip.nrrd --elevation 20
"""

import argparse
import sys
from pathlib import Path

import itk
import numpy as np

COLOURS = {"rgb": itk.RGBPixel, "rgba": itk.RGBAPixel}

# others are read as float
PIXEL_TYPES = {
    "unsigned_char": itk.UC,
    "short": itk.SS,
    "unsigned_short": itk.US,
    "double": itk.D,
}


def read_image(path: Path):
    """A scalar image, or one whose pixels are vectors of the channels."""
    if not path.is_file():
        sys.exit(f"error: {path} does not exist")
    file = itk.ImageIOFactory.CreateImageIO(str(path), itk.CommonEnums.IOFileMode_ReadMode)
    if not file:
        sys.exit(f"error: {path} is not an image that ITK can read")
    try:
        file.SetFileName(str(path))
        file.ReadImageInformation()
        if file.GetNumberOfDimensions() not in (3, 4):
            sys.exit(f"error: {path} has {file.GetNumberOfDimensions()} dimensions, not 3 or 4")
        pixel_type = PIXEL_TYPES.get(file.GetComponentTypeAsString(file.GetComponentType()), itk.F)
        if file.GetNumberOfComponents() > 1:
            colour = COLOURS.get(file.GetPixelTypeAsString(file.GetPixelType()))
            is_colour = colour and pixel_type == itk.UC
            pixel_type = colour[itk.UC] if is_colour else itk.VariableLengthVector[pixel_type]
        return itk.imread(str(path), pixel_type)
    except RuntimeError:
        sys.exit(f"error: {path} is not an image that ITK can read")


def make_volume(voxels: np.ndarray, image):
    """A scalar 3D image at the place of ``image``."""
    volume = itk.image_from_array(np.ascontiguousarray(voxels))
    volume.SetSpacing(list(image.GetSpacing())[:3])
    volume.SetOrigin(list(image.GetOrigin())[:3])
    volume.SetDirection(itk.array_from_matrix(image.GetDirection())[:3, :3])
    return volume


def project(image, azimuth: float, elevation: float):
    """An image of the pixel type of ``image`` and one dimension less."""
    channels = image.GetNumberOfComponentsPerPixel()
    *times, depth, height, width = list(itk.size(image))[::-1]
    array = itk.array_view_from_image(image)
    voxels = array.reshape(-1, depth, height, width, channels)

    mip, pictures = None, []
    for volume in (make_volume(voxels[t, ..., c], image) for t, c in np.ndindex(len(voxels), channels)):
        if mip is None:
            view = itk.ShearWarpMIPView.MakeTransform(
                volume, itk.ShearWarpMIPViewEnums.Direction_Anterior, azimuth, elevation
            )
            mip = itk.ShearWarpMIPImageFilter.New(volume, Transform=view, DefaultPixelValue=voxels.min().item())
        mip.SetInput(volume)
        mip.Update()
        pictures.append(itk.array_from_image(mip.GetOutput()))

    rows, columns = pictures[0].shape
    pixels = np.moveaxis(np.reshape(pictures, (-1, channels, rows, columns)), 1, -1)
    container, (pixel_type, dimension) = itk.template(image)
    pixels = pixels.reshape(*times, rows, columns, *array.shape[dimension:])
    result = itk.image_from_array(pixels, ttype=container[pixel_type, dimension - 1])
    for name in ("Spacing", "Origin"):
        of_view_plane = getattr(mip.GetOutput(), f"Get{name}")()
        of_time = getattr(image, f"Get{name}")()
        getattr(result, f"Set{name}")([*of_view_plane, *list(of_time)[3:]])
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", type=Path, help="a file with a 3D image of several channels, or with a 4D image")
    parser.add_argument("output", type=Path, help="the projection: .nrrd, .mha, .tif, ...")
    parser.add_argument("--azimuth", type=float, default=0.0, help="degrees to the patient's left [0]")
    parser.add_argument("--elevation", type=float, default=0.0, help="degrees from above [0]")
    arguments = parser.parse_args()

    result = project(read_image(arguments.image), arguments.azimuth, arguments.elevation)
    try:
        itk.imwrite(result, str(arguments.output))
    except RuntimeError:
        sys.exit(f"error: {arguments.output} can't be written")
    width, height, *times = itk.size(result)
    print(
        f"{arguments.output}: {width} x {height} pixels of {result.GetSpacing()[0]:.3g} mm, "
        f"{result.GetNumberOfComponentsPerPixel()} channels, {times[0] if times else 1} time points"
    )


if __name__ == "__main__":
    main()

"""An image in every form that the package takes."""

import importlib

import itk
import nibabel
import numpy as np
import SimpleITK


class ArrayLike:
    """Of a package that NumPy does not know."""

    def __init__(self, array):
        self._array = array

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self._array, dtype)


class Exchanged:
    """Has DLPack only."""

    def __init__(self, array):
        self._array = array

    def __dlpack__(self, **options):
        return self._array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self._array.__dlpack_device__()


def get_geometry(image):
    direction = itk.array_from_matrix(image.GetDirection())
    return {"spacing": list(image.GetSpacing()), "origin": list(image.GetOrigin()), "direction": direction}


def make_simple_itk(image):
    geometry = get_geometry(image)
    simple = SimpleITK.GetImageFromArray(itk.array_from_image(image))
    simple.SetSpacing(geometry["spacing"])
    simple.SetOrigin(geometry["origin"])
    simple.SetDirection(geometry["direction"].ravel().tolist())
    return simple


def make_nibabel(image):
    geometry = get_geometry(image)
    affine = np.eye(4)
    affine[:3, :3] = geometry["direction"] * geometry["spacing"]
    affine[:3, 3] = geometry["origin"]
    return nibabel.Nifti1Image(itk.array_from_image(image).T, np.diag([-1, -1, 1, 1]) @ affine)


def write(image, path):
    itk.imwrite(image, path)
    return path


FORMS = {
    "path": lambda image, folder: write(image, folder / "volume.mha"),
    "text": lambda image, folder: str(write(image, folder / "volume.nrrd")),
    "itk": lambda image, folder: image,
    "SimpleITK": lambda image, folder: make_simple_itk(image),
    "nibabel": lambda image, folder: make_nibabel(image),
    "xarray": lambda image, folder: itk.xarray_from_image(image),
    "xarray of Dask": lambda image, folder: itk.xarray_from_image(image).chunk(17),
}
# of an array; the geometry is in keywords
ARRAYS = {
    "NumPy": lambda array: array,
    "Dask": lambda array: importlib.import_module("dask.array").from_array(array, 17),
    "Fortran": np.asfortranarray,
    "swapped": lambda array: array.astype(">i2"),
    "strided": lambda array: np.repeat(array, 2, axis=2)[..., ::2],
    "int64": lambda array: array.astype(np.int64),
    "__array__": ArrayLike,
    "DLPack": Exchanged,
}


def make_form(name, image, folder):
    """A source and keywords."""
    if name in ARRAYS:
        return ARRAYS[name](itk.array_from_image(image)), get_geometry(image)
    return FORMS[name](image, folder), {}


IN_MEMORY = [name for name in (*FORMS, *ARRAYS) if "Dask" not in name]


def compare_datasets(one, other):
    """Of DICOM, without what is new in each."""
    assert one.keys() == other.keys()
    for element in one:
        if not element.keyword.endswith(("UID", "Time")):
            assert other[element.tag].value == element.value, element.keyword

# Part of the wrapped module. ITK takes the axes of an array in Fortran's order for x, y, z: the functions of this
# module take the axes of each array as z, y, x.

import functools
import importlib

import numpy as np


def _require_image(name, array):
    import itk

    images = itk.ShearWarpMIPPartsImageFilter.keys() if name == "input" else [(itk.Image[itk.UC, 3],)]
    dtypes = {np.dtype(itk.template(image)[1][0].dtype) for (image,) in images}
    if array.ndim != 3:
        raise ValueError(f"{name} must have the axes z, y, x, but its shape is {array.shape}")
    if isinstance(array.dtype, np.dtype) and array.dtype.newbyteorder("=") not in dtypes:
        names = ", ".join(sorted(map(str, dtypes)))
        raise TypeError(f"{name} must have voxels of {names}, but they are {array.dtype}: use astype()")


def _prepare(value, name):
    import itk
    from itk.support import helpers

    if isinstance(getattr(value, "_meta", value), np.ma.MaskedArray):
        raise TypeError(
            "a masked array loses its mask, which is what is left out: give its data, and "
            "mask_image=(~np.ma.getmaskarray(array)).astype(np.uint8)"
        )
    if name == "input" and (value is None or isinstance(value, (str, int, float))):
        raise TypeError(f"input must be an itk.Image or an array with the axes z, y, x, but it is {value!r}")
    of_torch = type(value).__module__.partition(".")[0] == "torch"
    if isinstance(value, itk.Object) or of_torch or not helpers.is_arraylike(value):
        return value
    if name in ("input", "mask_image"):
        _require_image(name, value)
    if value.ndim != 3:
        return value
    with_dims = set(getattr(value, "dims", ())) == set("zyx")
    if with_dims:
        value = value.transpose(*"zyx")
    array = np.asarray(value)
    if len(array) > 1 and array.size == len(array):
        raise ValueError(f"ITK cannot tell the order of an array of shape {array.shape}: give an itk.Image")
    ordered = np.ascontiguousarray(array, array.dtype.newbyteorder("="))
    return value.copy(data=ordered) if with_dims else ordered


def _wrap(module_name, name):
    module = importlib.import_module(module_name)
    # ITK runs this file twice
    function = vars(module).setdefault(f"_{name}", getattr(module, name))

    @functools.wraps(function)
    def call(*args, **kwargs):
        names = ("input",) + ("",) * len(args)
        picture = function(
            *map(_prepare, args, names), **{key: _prepare(value, key.lower()) for key, value in kwargs.items()}
        )
        # ITK's array loses its image in np.asarray
        return np.array(picture) if isinstance(picture, np.ndarray) else picture

    setattr(module, name, call)
    return call


shear_warp_mip_image_filter = _wrap("itk.itkShearWarpMIPImageFilterPython", "shear_warp_mip_image_filter")
shear_warp_mip_cine_image_filter = _wrap("itk.itkShearWarpMIPCineImageFilterPython", "shear_warp_mip_cine_image_filter")

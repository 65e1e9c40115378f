"""Views by name, transform or matrix."""

import math
from collections.abc import Sequence
from typing import Any

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._inputs import is_number, show_value

SIDES = ("anterior", "posterior", "left", "right", "superior", "inferior")


def make_transform(image: Any, view: Any = "anterior", azimuth: float = 0.0, elevation: float = 0.0) -> Any:
    """Returns the itk.Transform, from view space to physical space (LPS, mm), of a view of a 3D itk.Image.

    view: the side of the patient from which the viewer looks, one of SIDES; or a linear itk.Transform of 3D in double
        precision; or a 4 x 4 matrix. View space has u to the right of the picture, v down, and w away from the viewer.
    azimuth, elevation: degrees that the viewer then moves towards the right and towards the top of the picture; only if
        view is a side.

    Raises ValueError for another name, an unsuitable matrix and angles that are not finite; TypeError for other types.

    >>> import numpy as np
    >>> image = itk.image_from_array(np.zeros((3, 4, 5), np.int16))
    >>> turned = make_transform(image, "anterior", azimuth=90.0)
    >>> turned.GetMatrix() == make_transform(image, "left").GetMatrix()
    True
    """
    choices = (
        f"view must be one of {', '.join(SIDES)}, an itk.Transform or a 4 x 4 matrix, but it is {show_value(view)}"
    )
    if isinstance(view, str):
        if view not in SIDES:
            raise ValueError(choices)
        angles = azimuth, elevation
        if not all(is_number(each) and math.isfinite(each) for each in angles):
            raise ValueError(
                f"azimuth and elevation must be finite numbers, but they are {azimuth!r} and {elevation!r}"
            )
        side = getattr(itk.ShearWarpMIPViewEnums, f"Direction_{view.capitalize()}")
        return itk.ShearWarpMIPView.MakeTransform(image, side, float(azimuth), float(elevation))
    if azimuth != 0.0 or elevation != 0.0:
        raise ValueError("azimuth and elevation are for a view that is a name")
    # as itk.transformread() gives one
    if isinstance(view, list | tuple) and len(view) == 1:
        (view,) = view
    if isinstance(view, itk.Transform[itk.D, 3, 3]):
        return view
    if isinstance(view, itk.Object) or (isinstance(view, list | tuple) and view and isinstance(view[0], itk.Object)):
        raise TypeError(
            "view must be one itk.Transform of 3 dimensions in double precision; several go to turn(transforms=)"
        )
    try:
        matrix = np.asarray(view, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(choices) from None
    if matrix.ndim == 0:
        raise TypeError(choices)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or (matrix[3] != [0, 0, 0, 1]).any():
        raise ValueError(
            f"a matrix as view must be 4 x 4 and finite, its last row 0, 0, 0, 1, but it is {show_value(matrix.tolist())}"
        )
    return make_affine(matrix)


def make_affine(matrix: NDArray[np.float64]) -> Any:
    transform = itk.AffineTransform[itk.D, 3].New()
    transform.SetMatrix(itk.matrix_from_array(matrix[:3, :3]))
    transform.SetTranslation(matrix[:3, 3].tolist())
    return transform


def list_views(transforms: Any) -> list[Any]:
    """The views of turn(transforms=)."""
    is_list = isinstance(transforms, Sequence | np.ndarray) and not isinstance(transforms, str)
    if not (is_list and len(transforms)):
        raise ValueError(f"transforms must be a list of views, but it is {show_value(transforms)}")
    return [*transforms]

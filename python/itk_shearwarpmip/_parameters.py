"""The parameters of mip() and turn(), as the filters take them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

import itk
import numpy as np
from numpy.typing import NDArray

from itk_shearwarpmip._inputs import describe, is_number, make_flag, make_numbers, show_value

Mode = Literal["maximum", "minimum", "absolute_maximum", "mean"]
MODES = {
    "maximum": "Mode_Maximum", "minimum": "Mode_Minimum", "absolute_maximum": "Mode_AbsoluteMaximum",
    "mean": "Mode_Mean",
}  # fmt: skip
Interpolation = Literal["linear", "nearest"]
_INTERPOLATIONS = {"linear": "Interpolation_Linear", "nearest": "Interpolation_Nearest"}


@dataclass(frozen=True)
class Parameters:
    """The parameters of the filters, with the names of mip()'s keywords."""

    mode: Mode = "maximum"
    slab: Sequence[float] | None = None
    crop: Sequence[Sequence[float]] | None = None
    mask: Any = None
    mask_label: int | None = None
    depth: bool = False
    attenuation: float = 0.0
    local_maximum: float | None = None
    background: float | Literal["auto"] = "auto"
    exact: bool = False
    oversampling: int = 1
    output_spacing: float | Sequence[float] | None = None
    size: Sequence[int] | None = None
    output_origin: Sequence[float] | None = None
    threads: int | None = None
    places: bool = False
    interpolation: Interpolation = "linear"


def find_lowest(voxels: NDArray[Any]) -> Any:
    """The least of these voxels, if it is negative, or 0."""
    return 0 if voxels.dtype.kind == "u" else min(np.fmin.reduce(voxels, axis=None).item(), 0) or 0


def set_parameters(made: Any, parameters: Parameters, background: Any) -> None:
    """Sets all parameters of a filter, except its views and its mask."""
    is_whole = isinstance(made.GetDefaultPixelValue(), int)
    set_background(made, background)
    made.SetMode(getattr(itk.ShearWarpMIPImageFilterEnums, MODES[check_mode(parameters.mode)]))
    interpolation = find_interpolation(parameters.interpolation)
    made.SetInterpolation(getattr(itk.ShearWarpMIPImageFilterEnums, _INTERPOLATIONS[interpolation]))
    slab = (-np.inf, np.inf) if parameters.slab is None else parameters.slab
    near, far = make_numbers("slab", slab, 2, is_finite=False, parts="(near, far)")
    made.SetSlabNear(near)
    made.SetSlabFar(far)
    lower, upper = [-np.inf] * 3, [np.inf] * 3
    if parameters.crop is not None:
        try:
            lower, upper = (make_numbers("crop", corner, 3, is_finite=False) for corner in parameters.crop)
        except (TypeError, ValueError):
            raise ValueError(f"crop must be two corners, each x, y, z, but it is {parameters.crop!r}") from None
    made.SetCropLower(lower)
    made.SetCropUpper(upper)
    if parameters.mask_label is not None and parameters.mask is None:
        raise ValueError("mask_label is for a mask")
    made.SetLocalMaximum(parameters.local_maximum is not None)
    threshold = 0 if parameters.local_maximum is None else parameters.local_maximum
    _set_pixel(made, "LocalMaximumThreshold", "local_maximum", threshold, is_whole)
    set_value(made, "DepthAttenuation", "attenuation", parameters.attenuation)
    made.SetComputeDepth(any([make_flag("depth", parameters.depth), make_flag("places", parameters.places)]))
    made.SetExact(make_flag("exact", parameters.exact))
    set_grid(made, parameters)


def check_mode(mode: Any) -> Mode:
    if not isinstance(mode, str) or mode not in MODES:
        raise ValueError(f"mode must be one of {', '.join(MODES)}, but it is {mode!r}")
    return cast(Mode, mode)


def find_interpolation(given: Any) -> Interpolation:
    if not isinstance(given, str) or given not in _INTERPOLATIONS:
        raise ValueError(f"interpolation must be one of {', '.join(_INTERPOLATIONS)}, but it is {given!r}")
    return cast(Interpolation, given)


def set_background(made: Any, background: Any) -> None:
    _set_pixel(made, "DefaultPixelValue", "background", background, isinstance(made.GetDefaultPixelValue(), int))


def set_grid(made: Any, parameters: Parameters) -> None:
    """Sets the parameters that the filters of chunks have too."""
    set_value(made, "Oversampling", "oversampling", parameters.oversampling)
    made.FitOutputGrid()
    spacing = parameters.output_spacing
    if spacing is not None:
        made.SetOutputSpacing(make_numbers("output_spacing", (spacing,) * 2 if np.ndim(spacing) == 0 else spacing, 2))
    if parameters.size is not None:
        size = make_numbers("size", parameters.size, 2, is_whole=True)
        if min(size) < 1 or max(size) >= 1 << 31:
            raise ValueError(f"size must be positive and fit in memory, but it is {size}")
        made.SetSize(size)
    if parameters.output_origin is not None:
        made.SetOutputOrigin(make_numbers("output_origin", parameters.output_origin, 2))


def set_value(made: Any, name: str, keyword: str, value: Any) -> None:
    """Sets a number, converted to the filter's type."""
    kind = type(getattr(made, f"Get{name}")())
    try:
        if not is_number(value) or (kind(value) != value and value == value):
            raise ValueError
        getattr(made, f"Set{name}")(kind(value))
    except (OverflowError, TypeError, ValueError):
        raise ValueError(
            f"{keyword} cannot be {show_value(value)}: give a {'whole ' if kind is int else ''}number"
        ) from None


def _set_pixel(made: Any, name: str, keyword: str, value: Any, is_whole: bool) -> None:
    try:
        if not is_number(value) or (is_whole and not float(value).is_integer()):
            raise ValueError
        getattr(made, f"Set{name}")(int(value) if is_whole else float(value))
    except (OverflowError, TypeError, ValueError):
        of = "whole, and a value of the voxels' type" if is_whole else "a number"
        raise ValueError(f"{keyword} must be {of}, but it is {show_value(value)}") from None


def update(made: Any, depth: str = "depth", information: bool = False) -> None:
    """Updates a filter, or only its output information. An exception of the filter becomes an error for the caller, in
    which the depths are what was given for them."""
    try:
        made.UpdateOutputInformation() if information else made.UpdateLargestPossibleRegion()
    except RuntimeError as error:
        if re.match(r"\S*itkShearWarp\w+\.\w+:\d+:", str(error)):
            raise ValueError(_reword(describe(error).replace("ComputeDepth", depth))) from None
        raise


_WORDS = {
    "DefaultPixelValue": "background", "DepthAttenuation": "attenuation", "NumberOfFrames": "frames",
    "LocalMaximumThreshold": "local_maximum", "SlabNear": "slab's near", "SlabFar": "slab's far",
    "CropLower": "crop's lower", "CropUpper": "crop's upper", "MaskImage": "mask", "Transform": "view",
}  # fmt: skip


def _reword(text: str) -> str:
    """Replaces the filter's names by the names of keywords."""

    def name(match: re.Match[str]) -> str:
        word = match[0]
        return _WORDS.get(word) or re.sub(r"(?<=.)([A-Z])", r"_\1", word).lower()

    text = text.replace("AbsoluteMaximum", "absolute_maximum")
    text = re.sub(r"\b(Maximum|Minimum|Mean|Nearest)\b", lambda match: match[0].lower(), text)
    names = (
        "OutputSpacing|OutputOrigin|Size|Oversampling|RotationAxis|Center|StartAngle|AngularRange|Exact|LocalMaximum|"
        "Mode|Interpolation"
    )
    return re.sub(rf"\b({'|'.join(_WORDS)}|{names})\b", name, text)

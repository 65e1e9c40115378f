"""What is known of an itk.Image beside voxels and geometry: entries of its meta data dictionary.

HasOrientation is "0" if nobody stated how the image lies in the patient; by default it lies in LPS. IsInverted is "1" if
low values are to be shown white. IsSuv is "1" if values are SUV by body weight. Unit is the unit of lengths, by default
mm. SourceFiles are the paths of the files that the image was read from, with spaces between them and percent-encoded. Of
a projection, Background is the value of pixels beside the volume, and FrameTransforms are each frame's matrix from view
space to physical space, row by row.

ITK writes entries to NRRD and MetaImage and reads them again. Its filters, its pickles and itk.image_duplicator() leave
them out. This module keeps them in pickles and copies of images that it knows.
"""

import copyreg
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote_to_bytes

import itk
import numpy as np
from numpy.typing import NDArray


def has_direction(image: Any) -> bool:
    """Whether the direction defines the patient's sides."""
    return bool(get(image, "HasOrientation") != "0")


def is_inverted(image: Any) -> bool:
    """Whether low values are to be shown white."""
    return bool(get(image, "IsInverted") == "1")


def get_unit(image: Any) -> str | None:
    """The unit of spacing and origin; None is mm."""
    return get(image, "Unit") or None


def get_source_files(image: Any) -> list[Path]:
    """The files that the image was read from, if they are known."""
    return unpack_files(get(image, "SourceFiles") or "")


def get_view(image: Any) -> NDArray[np.float64] | None:
    """The 4 x 4 matrix of a picture's view, from view space to physical space, if the image is one picture."""
    numbers = get(image, "FrameTransforms")
    numbers = [float(each) for each in numbers.split()] if isinstance(numbers, str) else list(numbers or ())
    return np.reshape(numbers, (4, 4)) if len(numbers) == 16 else None


def get(image: Any, key: str) -> Any:
    """An entry, or None."""
    entries = image.GetMetaDataDictionary()
    return entries[key] if entries.HasKey(key) else None


def put(image: Any, key: str, value: str | float | Sequence[float] | None) -> None:
    """Sets an entry, or removes it if it is empty."""
    entries = image.GetMetaDataDictionary()
    if value is None or value == "":
        entries.Erase(key)
    elif isinstance(value, str):
        # ITK takes UTF-8
        entries[key] = value.encode("utf-8", "replace").decode()
    else:
        # ITK would make numbers of single precision
        kind = itk.D if isinstance(value, int | float) else itk.vector[itk.D]
        entry = itk.MetaDataObject[kind].New()
        entry.SetMetaDataObjectValue(float(value) if isinstance(value, int | float) else [float(n) for n in value])
        entries.Set(key, entry)
    keep(image)


def keep(image: Any) -> None:
    """Has pickles and copies of images of this type keep their entries."""
    copyreg.pickle(type(image), _reduce)


def put_place(image: Any, has_direction: bool, unit: str | None) -> None:
    put(image, "HasOrientation", None if has_direction else "0")
    put(image, "Unit", unit)


def put_source_files(image: Any, paths: Sequence[Any]) -> None:
    put(image, "SourceFiles", pack_files(paths))


def pack_files(paths: Sequence[Any]) -> str:
    """One word each, safe for names of any bytes."""
    return " ".join(quote(os.fsencode(path)) for path in paths)


def unpack_files(text: str) -> list[Path]:
    """The names that pack_files() made a text of."""
    return [Path(os.fsdecode(unquote_to_bytes(word))) for word in text.split()]


def _reduce(image: Any) -> tuple[Any, ...]:
    entries = {key: image[key] for key in image.GetMetaDataDictionary().GetKeys()}
    kept = {key: value for key, value in entries.items() if np.ndim(value) <= 1 and value is not None}
    return _rebuild, (itk.dict_from_image(image), kept)


def _rebuild(state: dict[str, Any], entries: dict[str, Any]) -> Any:
    image = itk.image_from_dict(state)
    for key, value in entries.items():
        put(image, key, value)
    return image

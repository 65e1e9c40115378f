"""Maximum intensity projection (MIP) of 3D images from any direction.

mip() gives a picture and turn() a series that turns, of whatever holds a volume: a file, an image or an array in memory by
the filters itk.ShearWarpMIPImageFilter and itk.ShearWarpMIPCineImageFilter; a volume in chunks by Dask, where its chunks are.
"""

from typing import TYPE_CHECKING, Any

from itk_shearwarpmip._front import Turn, mip, turn
from itk_shearwarpmip._inputs import open_image
from itk_shearwarpmip._save import save_png

if TYPE_CHECKING:
    from itk_shearwarpmip._scene import Point as Point
    from itk_shearwarpmip._viewer import Viewer as Viewer
    from itk_shearwarpmip._viewer import show as show
    from itk_shearwarpmip._volume import Volume as Volume
    from itk_shearwarpmip._volume import open_volume as open_volume

__all__ = ["Turn", "mip", "open_image", "save_png", "turn"]

_WITH_MORE_PACKAGES = ("Point", "Viewer", "Volume", "open_volume", "show")


def __getattr__(name: str) -> Any:
    """What needs Dask or the viewer's packages, when it is asked for."""
    if name not in _WITH_MORE_PACKAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in ("Point", "Viewer", "show"):
        from itk_shearwarpmip import _viewer

        return getattr(_viewer, name)
    try:
        import dask.array  # noqa: F401
    except ImportError as error:
        raise ImportError("itk_shearwarpmip needs Dask: pip install itk-shearwarpmip[distributed]") from error
    from itk_shearwarpmip import _volume

    return getattr(_volume, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_WITH_MORE_PACKAGES})

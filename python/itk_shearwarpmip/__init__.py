"""Maximum intensity projection (MIP) of 3D images from any direction.

mip() makes a picture, and turn() makes a turning series. The volume is a file, an image or an array in memory, and the
filters itk.ShearWarpMIPImageFilter and itk.ShearWarpMIPCineImageFilter project it. It can also be a volume in chunks:
Dask then projects each chunk where the chunk is.
"""

import warnings
from typing import TYPE_CHECKING, Any

from itk_shearwarpmip._front import Turn, mip, turn
from itk_shearwarpmip._inputs import open_image
from itk_shearwarpmip._places import sample
from itk_shearwarpmip._write import save_png, write

if TYPE_CHECKING:
    from itk_shearwarpmip._scene import Point as Point
    from itk_shearwarpmip._viewer import Viewer as Viewer
    from itk_shearwarpmip._viewer import show as show
    from itk_shearwarpmip._volume import Volume as Volume
    from itk_shearwarpmip._volume import open_volume as open_volume

__all__ = ["Turn", "mip", "open_image", "sample", "save_png", "turn", "write"]

# ITK's modules warn when they are loaded; under python -W error this would end the process
warnings.filterwarnings("ignore", "builtin type .* has no __module__ attribute", DeprecationWarning)

_WITH_MORE_PACKAGES = ("Point", "Viewer", "Volume", "open_volume", "show")


def __getattr__(name: str) -> Any:
    """Imports the names that need Dask or the viewer's packages, when they are used."""
    if name not in _WITH_MORE_PACKAGES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name in ("Point", "Viewer", "show"):
        from itk_shearwarpmip import _viewer

        return getattr(_viewer, name)
    try:
        import dask.array  # noqa: F401
    except ImportError as error:
        raise ImportError("itk_shearwarpmip needs Dask: install the wheel with its extra [distributed]") from error
    from itk_shearwarpmip import _volume

    return getattr(_volume, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_WITH_MORE_PACKAGES})

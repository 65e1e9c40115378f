"""Maximum intensity projection (MIP) of volumes that are larger than one memory: chunk by chunk, with Dask.

The filters for volumes in memory are in the package itk: itk.ShearWarpMIPImageFilter, itk.ShearWarpMIPCineImageFilter.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from itk_shearwarpmip._projection import mip, mip_cine
    from itk_shearwarpmip._volume import Volume, open_volume

__all__ = ["Volume", "mip", "mip_cine", "open_volume"]


def __getattr__(name: str) -> Any:
    """What needs Dask, when it is asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        import dask.array  # noqa: F401
    except ImportError as error:
        raise ImportError("itk_shearwarpmip needs Dask: pip install itk-shearwarpmip[distributed]") from error
    from itk_shearwarpmip import _projection

    return getattr(_projection, name)

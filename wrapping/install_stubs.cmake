# Installs the type stubs that ITK generated in ITK_STUB_DIR. They lack some imports, and take base classes from a
# file that ITK's own wheels do not have.

foreach(
  class
  ShearWarpFactorization
  ShearWarpMIPBaseImageFilter
  ShearWarpMIPCineImageFilter
  ShearWarpMIPImageFilter
  ShearWarpMIPImageFilterEnums
  ShearWarpMIPPartsImageFilter
  ShearWarpMIPView
  ShearWarpMIPViewEnums
)
  foreach(kind Proxy Template)
    file(READ "${ITK_STUB_DIR}/${class}${kind}.pyi" stub)
    string(REPLACE "import Union, Any" "import Any, Sequence, Union, overload" stub "${stub}")
    string(REGEX REPLACE "from \\._proxies import (ShearWarp[A-Za-z]*)" "from .\\1 import \\1" stub "${stub}")
    string(REGEX REPLACE "from \\._proxies import [A-Za-z]*" "from typing import Any" stub "${stub}")
    string(REPLACE "\nitk." "\n" stub "${stub}")
    file(WRITE "${CMAKE_INSTALL_PREFIX}/itk/${class}${kind}.pyi" "${stub}")
  endforeach()
endforeach()

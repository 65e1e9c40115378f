#!/usr/bin/env python3
"""Checks conda/recipe.yaml: rattler-build, with which conda-forge builds, reads and renders it for all its platforms.

check-recipe.py
"""

import sys
from pathlib import Path

from rattler_build import PlatformConfig, RattlerBuildError, RenderConfig, Stage0Recipe, VariantConfig

RECIPE = Path(__file__).parent.parent / "conda/recipe.yaml"
PLATFORMS = ("linux-64", "linux-aarch64", "osx-64", "osx-arm64")


def find_faults() -> list[str]:
    faults = []
    for platform in PLATFORMS:
        try:
            Stage0Recipe.from_yaml(RECIPE.read_text()).render(
                VariantConfig({"c_stdlib": ["sysroot"]}), RenderConfig(PlatformConfig(target_platform=platform))
            )
        except RattlerBuildError as error:
            faults.append(str(error))
    return [f"conda/recipe.yaml: {fault}" for fault in dict.fromkeys(faults)]


if __name__ == "__main__":
    sys.exit("\n".join(find_faults()) or None)

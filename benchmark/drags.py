"""What benchmarks that drag in a headless Chromium share."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from selenium.webdriver.common.actions.action_builder import ActionBuilder

MOVE_MILLISECONDS = 16


def drag(driver: Any, element: Any, generator: np.random.Generator) -> None:
    """Drags over an element by 20 movements, from a random place in a random direction."""
    actions = ActionBuilder(driver, duration=MOVE_MILLISECONDS)
    mouse = actions.pointer_action
    x, y = generator.integers(-150, 150, 2)
    mouse.move_to(element, int(x), int(y))
    mouse.pointer_down()
    right, down = generator.uniform(-12, 12), generator.uniform(-6, 6)
    for n in range(1, 21):
        mouse.move_to(element, round(x + n * right), round(y + n * down))
    mouse.pointer_up()
    actions.perform()


def run(
    parser: argparse.ArgumentParser,
    measure: Callable[[argparse.Namespace], dict[str, Any]],
    smoke: str,
    **of_smoke: Any,
) -> None:
    """Adds the options of drags, measures, and prints the results. `smoke` says what --smoke does, and of_smoke are the
    options that it sets."""
    parser.add_argument("--drags", type=int, default=100)
    parser.add_argument("--window", type=int, nargs=2, default=(1000, 720), help="of the browser, in pixels")
    parser.add_argument("--output", type=Path, help="JSON file")
    parser.add_argument("--smoke", action="store_true", help=smoke)
    options = parser.parse_args()
    if options.smoke:
        vars(options).update(of_smoke, drags=3)
    results = json.dumps(measure(options), indent=2)
    print(results)
    if options.output:
        options.output.write_text(results + "\n")

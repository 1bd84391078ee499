"""How long work tells where it is."""

from __future__ import annotations

import sys
from collections.abc import Callable

__all__ = ["Progress", "callback"]

Progress = Callable[[str], object] | bool | None
"""A function that is called with what begins (`calibrating: iteration 3, cost 1.2e+05`), `True` for lines on stderr, or nothing."""


def callback(progress: Progress) -> Callable[[str], object] | None:
    """The function to be called, if any."""
    if progress is True:
        return lambda step: print(step, file=sys.stderr)
    return progress or None

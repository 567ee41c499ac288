"""Python's collector of cyclic garbage, at rest while a program is read or corrected.

A program of some hundred thousand targets makes millions of small objects that all live until the end. The
collector goes through them again and again and finds nothing: a third to a half of all time. What is not
cyclic is freed as ever.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_at_rest() -> Iterator[None]:
    """Also a decorator."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()

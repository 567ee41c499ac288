"""Axes as a sentence names them."""

from collections.abc import Iterable


def axes_in_words(axes: Iterable[int]) -> str:
    """Axes counted from 0: axis 2; axes 2 and 4; axes 1, 2 and 6."""
    numbers = [str(axis + 1) for axis in axes]
    if len(numbers) == 1:
        return f"axis {numbers[0]}"
    return f"axes {', '.join(numbers[:-1])} and {numbers[-1]}"

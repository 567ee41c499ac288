"""A mistake that the user may have made, and how much better the data fit without it."""

from dataclasses import dataclass

import numpy as np

from exactarm.data.dataset import Dataset

# A mistake in a column moves targets by centimetres, torques by their own size: undone, a fit to usual data
# falls ten times and more. Three times leaves room for arms that are a centimetre wrong, and no set of poses
# falls so far by chance.
FALL = 3.0
AS_GOOD = 0.7  # of the best one's fall
_WITHOUT_A_REST = 1e6


@dataclass(frozen=True)
class Suspicion:
    """`words`: what would have been meant; `fall`: how many times smaller the error would be, without it a
    sentence that says it all."""

    words: str
    fall: float = np.inf

    @property
    def sentence(self) -> bool:
        return bool(np.isinf(self.fall))

    @property
    def text(self) -> str:
        """As a warning says it."""
        if self.sentence:
            return self.words
        times = (f"{float(f'{self.fall:.2g}'):,.10g} times better" if self.fall < _WITHOUT_A_REST
                 else "without a rest")
        return f"with {self.words} the data would fit the robot {times}: check files, columns and units"


def in_order(found: list[Suspicion]) -> list[Suspicion]:
    """Best first; of those that explain (nearly) as much the one that was tried first, for those are the
    simplest ones."""
    if not found:
        return []
    best = next(each for each in found if each.fall >= AS_GOOD * max(other.fall for other in found))
    return [best, *sorted((each for each in found if each is not best), key=lambda each: -each.fall)]


def run_words(data: Dataset, rows: np.ndarray) -> str:
    """The run of `rows`, with its first and its last row."""
    first, last = data.place_of(int(rows[0])), data.place_of(int(rows[-1]))
    return f"run {data.run[rows[0]]} ({first} to {last})"

"""What the diagnosis needs of one kind of data, and nothing that depends on the kind.

A problem holds robot and identification data and can fit any layout of effects to them through the chain.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.diagnose.fitted import Fitted
from exactarm.diagnose.in_space import InSpace
from exactarm.diagnose.signal import Direction, Quantity, Signal, Structure
from exactarm.diagnose.unknown import AMPLITUDE, Function, Pattern, Wave, unknown_functions
from exactarm.effects import library
from exactarm.effects.base import Effect
from exactarm.effects.harmonic_family import orders_by_side, searched_orders
from exactarm.noise.estimate import estimate_noise
from exactarm.noise.model import NoiseModel
from exactarm.robot.robot import Robot


class Problem(ABC):
    """One kind of data of one robot. `data` are the identification rows, `held_out` the validation rows."""

    unit: str = ""
    error_along: str = ""  # in words, where the error is one component of what was measured
    kind: str = ""
    repeat_source = "repeated visits of the same pose"
    by_posterior = False  # whether causes are found by the posterior over sets of them
    drafts = False  # whether effects are drafted for what none explains: formulas that turn an axis
    unknown_rivals = False  # whether effects found step by step have unknown functions for rivals
    # signals of an axis that effects of many forms follow: no unknown function of them is a rival of one
    followed_by_effects: frozenset[str] = frozenset()
    unknown_size = AMPLITUDE  # plausible size of such a function, in the unit of what is measured
    most_waves_in_time = 0  # that may stand in the place of effects found step by step (wave_in_time.py)
    groups_independent = False  # whether the residuals of different groups of rows are
    numbers_of_error = 1  # of the measurement that make up one judged error: 3 of a position
    least_share = 0.02  # of the cross-validated square sum that an effect must take away
    # share of the square sum that it must take away in stretches it has not learnt from
    least_elsewhere = 0.0
    far_elsewhere = False  # whether these lie where the others know little: judged by what they can know
    share_left = 0.10  # of the square sum that a signal still has to explain to count as structure

    def __init__(self, robot: Robot, data: Dataset, held_out: Dataset, threads: int = 1, seed: int = 0):
        self.robot, self.data, self.held_out = robot, data, held_out
        self.threads, self.seed = threads, seed

    def in_space(self, first: Fitted, last: Fitted) -> InSpace | None:
        """Error vectors at the measured positions with both fits; None where no position at rest is
        measured."""
        return None

    @abstractmethod
    def declared(self) -> Layout:
        """The declared model, ready to be re-identified; parameters that the data cannot tell are held."""

    def declared_under(self, declared: Layout, sigma: np.ndarray) -> Layout:
        """The declared model with what else can be told where the noise of a row is sigma (m,): beside a
        strong cause, or gross rows, less can be told than without."""
        return declared

    @abstractmethod
    def fit(self, layout: Layout, weight: np.ndarray | None = None,
            sigma: np.ndarray | None = None) -> Fitted:
        """Estimates the free parameters of `layout` on the identification rows (weight (N,) 0 or 1). Leaves
        no trace: the same problem, layout and weights give the same bits, whatever was fitted before.

        sigma (m,): first guess of the standard deviations of the components, from an earlier fit.
        """

    def knowing(self, fitted: Fitted) -> Problem:
        """The same problem, whose next fits and folds begin with what `fitted` knows of the noise."""
        return self

    @property
    def rough(self) -> Problem:
        """The same problem, whose fits end where no printed digit of an error changes any more."""
        return self

    @abstractmethod
    def errors(self, fitted: Fitted, data: Dataset) -> np.ndarray:
        """(K,) the errors of any rows whose RMS is reported for this kind of data."""

    @abstractmethod
    def groups(self) -> np.ndarray:
        """(N,) int: identification rows that must not be parted in a cross-validation."""

    @property
    def poses(self) -> dict[str, np.ndarray]:
        """(N,) int, of both sets of rows: the pose that each row stands at, where rows are poses."""
        return {}

    def order(self) -> np.ndarray | None:
        """(N,) places of the identification rows in the order in which they were measured, in typical
        distances between neighbours, sessions far apart; None where neighbours are dealt with otherwise."""
        return None

    def noise_of(self, left: np.ndarray, lost: float | np.ndarray, declared: np.ndarray) -> NoiseModel:
        """The noise of the rows (N, m), from what `lost` parameters, in all or of each component, leave;
        declared (N, m, b): a basis of the columns of those of the fit."""
        return estimate_noise(left, lost, self.groups(), self.order(), self.data.position, self.rounding(),
                              declared)

    def rounding(self) -> np.ndarray | None:
        """(N, m, n): what the rounding of each axis does to the rows; None where nothing is rounded, or that
        is dealt with otherwise."""
        return None

    def pieces(self) -> np.ndarray:
        """(N,) from 0: parts of the identification rows that bagged probabilities draw whole (bagging.py)."""
        return np.unique(self.groups(), return_inverse=True)[1]

    def groups_for(self, response: np.ndarray, lost: np.ndarray) -> np.ndarray:
        """The groups by which an effect is judged whose response has the square (N,) in each row; lost (N,):
        share of what is told of it that goes with the row's group."""
        return self.groups()

    @abstractmethod
    def signals(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        """Signals (N,) that a residual might follow: angles, torques, directions, time, covariates."""

    def surfaces(self, fitted: Fitted) -> dict[Signal, np.ndarray]:
        """Columns (N, b), each set tested as one, where several signals might act only together."""
        return {}

    def space(self, fitted: Fitted) -> tuple[Signal, np.ndarray] | None:
        """What it is, and points (N, d): a space over which the residual along the device's axes might vary
        smoothly."""
        return None

    def apart(self, rows: np.ndarray) -> np.ndarray | float:
        """(R, R) bool, or 1 for all: pairs of rows that no noise makes alike, so that place alone does."""
        return 1.0

    @abstractmethod
    def directions(self, fitted: Fitted) -> dict[Direction, np.ndarray]:
        """Patterns (N, m) along which something could move: a unit turn of each joint, each
        component."""

    def movements(self, fitted: Fitted) -> dict[Direction, Pattern]:
        """What unknown functions may move: `directions`, or what a turn does to a rate."""
        return self.directions(fitted)

    def tilts(self, fitted: Fitted) -> dict[Direction, list[np.ndarray]]:
        """Patterns (N, m), two each, along which what stands behind an axis could bend across it."""
        return {}

    def unknown_functions(self, fitted: Fitted) -> list[Function]:
        """What may be missing that no effect describes."""
        return list(unknown_functions(self.signals(fitted), self.directions(fitted), self.tilts(fitted),
                                      self.unknown_waves(fitted)))

    def unknown_waves(self, fitted: Fitted, instead: Iterable[Effect] = ()) -> list[Wave]:
        """Waves that may turn an axis, where no effect of the library does; `instead` of effects that are not
        in the fit."""
        found: list[Wave] = []
        for sign, orders in (("same", searched_orders), ("other", orders_by_side)):
            for i in np.flatnonzero(fitted.view.moving) if sign not in self._known_waves else ():
                side = Signal(Quantity.APPROACH, int(i) + 1) if sign == "other" else None
                found += [Wave(int(i) + 1, order, side) for order in orders(self.robot, fitted.view, i)]
        return found

    @property
    def _known_waves(self) -> set[str]:
        return {cls.turns_by_waves for cls in library().values() if self.shows(cls)}

    @abstractmethod
    def error_of_unit_noise(self, fitted: Fitted) -> float:
        """The RMS error that residuals of one sigma give, in the unit of the errors."""

    @abstractmethod
    def repeat_noise(self, fitted: Fitted) -> float | None:
        """Standard deviation of a residual component, in units of sigma, from repeated visits; None
        without."""

    def rounding_share(self, fitted: Fitted) -> float:
        """Of the square sum: what the rounding of an encoder's angles may leave as waves. Nothing is named
        that takes away no more."""
        return 0.0

    def without_hum(self, fitted: Fitted) -> Problem | None:
        """The same problem without hum of the mains that stands out of what a fit leaves, if any does."""
        return None

    def waves(self, fitted: Fitted, floor: float | None) -> tuple[Structure, ...]:
        """Waves in time that were likelier than effects, or that stand out of a measured noise floor, in the
        unit of the errors, or what changes too slowly to be noise; empty where there are none, or where
        nothing is known of them."""
        return ()

    def shakes(self, fitted: Fitted) -> tuple[Structure, ...]:
        """Of what no cause explains, what is one wave in time that nothing predicted has; empty where nothing
        is known of it."""
        return ()

    def share_of_measured(self, fitted: Fitted) -> float:
        """RMS of what is left over that of what was measured, where that starts at nothing (torques); else
        0."""
        return 0.0

    @abstractmethod
    def updated_robot(self, fitted: Fitted) -> Robot:
        """The robot with the re-identified parameters and the found effects."""

    def next_experiments(self, fitted: Fitted, places: tuple) -> tuple[str, tuple]:
        """What parts the doubtful causes of `places` best: in words, and as experiments where this kind can
        plan them."""
        first = places[0]
        return self.separating_experiment(fitted, first.effect, first.rivals[0][0]), ()

    def separating_experiment(self, fitted: Fitted, one: Effect, other: Effect) -> str:
        """In words, with numbers: the speeds or loads that part two effects best."""
        raise NotImplementedError

    def held_out_picture(self, fitted: Fitted) -> tuple[np.ndarray, np.ndarray] | None:
        """Residual (K, m) and its Jacobian (K, m, P) on held-out rows, where the measurement is of a target;
        else None."""
        return None

    def left_out(self) -> tuple[str, ...]:
        """In words: rows, runs or axes of the data that count for nothing, and why."""
        return ()

    def search_rows(self) -> np.ndarray | None:
        """(N,) bool: the identification rows that are enough to search with, where there are many; None =
        all.

        What is found is fitted to all of them afterwards.
        """
        return None

    def settled(self, fitted: Fitted) -> Fitted:
        """The last fit as it is to be judged and written, where the search has weighed the rows otherwise."""
        return fitted

    @property
    def least_doubt(self) -> float:
        """Of the square sum, that something else must take away to be at work; nothing is named for it."""
        return self.least_share

    def judged_share(self, fitted: Fitted, effect: Effect) -> float:
        """How much an effect at its values changes, beside the square sum as it is judged, where the search
        weighs it otherwise."""
        return 1.0

    def numbers_to_explain(self, response: np.ndarray) -> np.ndarray:
        """(N, m) bool: numbers of whose square sum an effect with the square response (N, m) has to take its
        share."""
        return np.ones(response.shape, bool)

    def units(self, folds: np.ndarray) -> np.ndarray:
        """(N,) int from 0: rows whose held-out errors scatter independently of each other's; the folds, to be
        safe."""
        return folds

    def stretches(self) -> np.ndarray | None:
        """(N,) int: large parts of the data, each in a place of its own; what an effect learns on all but one
        of them has to hold there. None = `groups` are enough."""
        return None

    def at_one_place(self, effect: Effect) -> bool:
        """Whether one stretch alone can tell of an effect, so that it cannot be learnt on the others."""
        return False

    def holds(self, without: np.ndarray, left: np.ndarray) -> bool:
        """Whether an effect holds in stretches that it has not learnt from: their square sums, or deviances
        (K,), without it and with it."""
        return bool(left.sum() < (1.0 - self.least_elsewhere) * without.sum())

    def also_judged(self, fitted: Fitted, data: Dataset) -> dict[str, float]:
        """Further numbers of any rows that stand beside the error, by their names with units."""
        return {}

    def doubts(self, fitted: Fitted) -> tuple[str, ...]:
        """In words: what is left asks for and tables cannot express, and known lengths that the rows deny."""
        return ()

    @property
    def misdeclared(self) -> tuple[str, ...]:
        """In words: what the robot file seems to have wrong, so that what is found may stand for it."""
        return ()

    def elsewhere(self, fitted: Fitted) -> Fitted:
        """The state by which a stretch that is left out is judged: without what is fitted anew there in any
        case."""
        return fitted

    def shows(self, effect: type[Effect]) -> bool:
        """Whether this kind of data can show effects of a class."""
        return self.kind in effect.kinds

    def spread(self, fitted: Fitted) -> float:
        """Mean square of the errors of the validation rows that the uncertainty of the parameters alone
        explains."""
        return 0.0

    def spread_by_row(self, fitted: Fitted) -> np.ndarray:
        """(N',) the same of every validation row, 0 where nothing is known of it."""
        return np.zeros(len(self.held_out))

    @property
    def judged(self) -> Dataset:
        """The validation rows; all others where there are none."""
        return self.held_out if len(self.held_out) else self.data

    def axes(self, before: Fitted, after: Fitted) -> list | None:
        """RMS per axis of the judged rows, where the kind of data has one number per axis; else None."""
        rms = [self.rms_by_axis(fitted, self.judged) for fitted in (before, after)]
        return [{"joint": axis + 1, "before": rms[0][axis], "after": rms[1][axis]}
                for axis in sorted(rms[0].keys() & rms[1].keys())] or None

    def rms_by_axis(self, fitted: Fitted, data: Dataset) -> dict[int, float]:
        """RMS of any rows by axis (from 0)."""
        return {}

    def memory_along(self, fitted: Fitted, columns: np.ndarray, direction: np.ndarray) -> float:
        """How many times more of the residual along a direction (N, m) falls on columns (N, k) by chance than
        of so many numbers as it counts for."""
        return 1.0

    def correlation_factor(self, fitted: Fitted) -> float:
        """Independent numbers per number of data; below 1 where neighbouring samples are correlated."""
        return 1.0

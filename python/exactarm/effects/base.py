"""The effect: one physical cause acting at one station of the measurement chain.

    theta --MOTOR, GEAR--> phi --LOAD--> torque --SPRING--> q --GEOMETRY--> target --DEVICE--> measured
                                                     torque --DRIVE--> motor torque

An effect is immutable. It knows its name, its axis, its parameters, which kinds of data can show it,
whether a planner can compensate it, one sentence for a report, and how it changes the signal at its
station with the derivatives of that change. The chain, the identification, the simulation, the diagnosis,
the planner, the robot file and the report use nothing else.

To add one: a new file in this folder with a subclass of `Effect` in it. The library finds it by itself.
Stations and their signals (N rows, n axes):

    MOTOR     motor angle theta (N, n) rad          GEAR      output angle phi (N, n) rad
    LOAD      joint torque (N, n) Nm                SPRING    joint angle q (N, n) rad
    FLANGE    at rest: what the flange carries (N, 4): kg, and its first moment in DH frame n, kg m
    GEOMETRY  displacement of the target (N, 6): m, rad (rotation increment), measuring frame
    DEVICE    measured vector (N, m) in its units; of a target (N, 6): where it is, rotation increment
    DRIVE     drive torque (N, n) Nm, output side

Parameters that live in the robot's tables (geometry, frames, gear ratio, masses) enter by `bake`; the change
of such an effect is zero in value and carries only the derivative.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from exactarm.effects.axis_units import of_a_slide, slides
from exactarm.effects.change import Change, DoesNotFit, OwnCurve, Parameter
from exactarm.effects.parameter_id import ParameterId
from exactarm.station import Station

if TYPE_CHECKING:
    from exactarm.data.dataset import Dataset
    from exactarm.robot.robot import Controller, Placement, Robot
    from exactarm.view import View

RECORD_KEY = "data_sha256"  # of a robot file


@dataclass(frozen=True)
class Effect(ABC):
    """Base of all effects. `joint` counts from 1; None for an effect of no single axis."""

    joint: int | None
    values: tuple[float, ...]
    # SHA-256 of the data files that it tells of; empty: any data
    record: tuple[str, ...] = field(default=(), kw_only=True)

    name: ClassVar[str] = ""
    station: ClassVar[Station]
    kinds: ClassVar[tuple[str, ...]] = ()
    compensable: ClassVar[bool] = False
    by_design: ClassVar[bool] = False  # where a robot file declares it, the maker's controller knows it
    at_rest: ClassVar[bool] = True  # moves an arm that stands still, too
    smooth: ClassVar[bool] = True  # a smooth function of the motion: may enter a planner's dynamics
    per_joint: ClassVar[bool] = True
    declared: ClassVar[bool] = False  # part of the declared model: re-identified, never a finding
    of_record: ClassVar[bool] = False  # tells of one record (a pushed device), not of arm or device as such
    of_one_session: ClassVar[bool] = False  # the rows of one alone tell of it
    by_load: ClassVar[bool] = False  # its size or side is decided by the load of a joint
    per_load: ClassVar[bool] = False  # all its values are sizes per Nm of that load
    gives_way: ClassVar[bool] = False  # a spring: what is carried shows through it
    drawn_to_declared: ClassVar[bool] = False  # a prior around declared values, as wide as they are plausible
    repeatable: ClassVar[bool] = False  # several of them may act on one axis (harmonics of different orders)
    log_odds: ClassVar[float] = 0.0  # before any data, beside another cause that would look the same
    of_waves: ClassVar[bool] = False  # a wave over an angle to be searched, or a law of those declared
    # turns its axis by waves over its angle: "same" or "other" sign from the other side, "faster" the larger
    turns_by_waves: ClassVar[str] = ""
    reverses: ClassVar[bool] = False  # dry friction in the tables: jumps where the motor turns back
    carried: ClassVar[bool] = False  # what the flange carries
    inertia_of: ClassVar[str] = ""  # "links" or "rotor": masses in the tables
    family: ClassVar[str] = ""  # effects of one family on one axis may be forms of one cause (`includes`)
    told_by: ClassVar[str] = ""  # the parameter that is its size; else the largest
    in_axis_units: ClassVar[bool] = False  # its rad and Nm are of its axis: m and N if that slides
    parameter_table: ClassVar[tuple[Parameter, ...]]  # of effects that always have the same
    sentence: ClassVar[str] = ""  # format string: {joint} and the parameters' names
    plain: ClassVar[str] = ""  # a noun phrase that a technician uses, without the axis; empty: the name
    source: ClassVar[str] = ""
    open_parameters: ClassVar[str] = "as many as the robot's tables have"  # where no form has any
    # what some effects say by a property of the same name
    other_axes: ClassVar[tuple[int, ...]] = ()  # from 1, whose signals it reads by number, beside its own
    any_curve: ClassVar[bool] = False  # it can take the shape of any smooth function of its axis's angle
    frames_of: ClassVar[int | None] = None  # the session of which it is base and tool frame
    zero_of: ClassVar[int | None] = None  # the run of which it is the zero of a sensor
    nothing_at_all: ClassVar[bool] = False  # no values of its parameters change anything
    axis_in_sensor: ClassVar[np.ndarray | None] = None  # (3,) where its session's gyroscope shows its axis
    angles_measured: ClassVar[tuple[float, float] | None] = None  # rad, between which it was estimated

    # -- description ------------------------------------------------------------------------------
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters in the order of `values`."""
        return self.parameter_table

    def value_of(self, name: str) -> float:
        return self.values[[parameter.name for parameter in self.parameters()].index(name)]

    def with_values(self, values: Iterable[float]) -> Effect:
        return replace(self, values=tuple(float(value) for value in values))

    @property
    def index(self) -> int:
        """The axis, from 0."""
        return self.joint - 1

    @property
    def driven_by(self) -> int | None:
        """The axis, from 1, whose signals it follows: its own unless it says another."""
        return self.joint

    def of_axes(self, axes: int) -> Effect:
        """Itself, on an arm of so many axes; raises DoesNotFit where it follows one that the arm has not."""
        for axis in self.other_axes:
            if not 1 <= axis <= axes:
                raise DoesNotFit(f"{self.name} follows axis {axis}; expected an axis from 1 to {axes}")
        return self

    def per_guessed_load(self, view: View) -> np.ndarray:
        """(k,) power of a load which generic masses make that each value is a size per; 0: of none."""
        guessed = view.robot.generic_masses if self.joint is None else view.guessed_load(self.index)
        return np.full(len(self.values), self.per_load and guessed)

    @property
    def label(self) -> str:
        return self.name if self.joint is None else f"{self.name}_{self.joint}"

    @property
    def title(self) -> str:
        """As a technician says it: `backlash of axis 2`."""
        words = self.name.replace("_", " ")
        return words if self.joint is None else f"{words} of axis {self.joint}"

    @property
    def in_plain_words(self) -> str:
        """As a technician says it, without the axis: `play in the gear`."""
        return self.plain or self.name.replace("_", " ")

    def in_plain_words_on(self, robot: Robot) -> str:
        """The same of an axis of this robot, which may slide."""
        return self.in_plain_words

    def orders(self) -> tuple[tuple[float, float], ...]:
        """(cycles per output turn, amplitude in rad) of an angle error that repeats; else empty."""
        return ()

    def includes(self, other: Effect) -> bool:
        """Whether `other` is a form of the same cause with no term that this one lacks: the two are one
        cause, never two."""
        if not self.family or self.family != other.family or self.joint != other.joint:
            return False
        own = {round(order, 6) for order, _ in self.orders()}
        return all(round(order, 6) in own for order, _ in other.orders())

    def sums(self, other: Effect) -> bool:
        """Whether it does what several effects like `other` do together, one for each part of the arm."""
        return False

    def parameter_label(self, parameter: Parameter) -> str:
        """Unique name of one of its parameters within a robot: `backlash_2.width_rad`."""
        return f"{self.label}.{parameter.name}"

    def parameter_id(self, parameter: Parameter) -> ParameterId:
        """The same with what it stands for."""
        return ParameterId(self.parameter_label(parameter), axis=self.joint)

    def bake(self, robot: Robot) -> Robot:
        """The robot with what of the effect's values lives in its tables (geometry, frames, masses)."""
        return robot

    def from_tables(self, robot: Robot) -> Effect:
        """The inverse of `bake`: the effect with the robot's values; one not declared stays as it is."""
        return type(self).of(robot, self.index) if self.declared else self

    def with_all_columns(self, robot: Robot) -> Effect:
        """The effect with every parameter that a frame could have, at the values of the robot's tables."""
        return self

    def carries_from(self, joint: int) -> np.ndarray:
        """(k,) bool: parameters that move the frame of `joint` and all beyond it as one rigid body."""
        return np.zeros(len(self.values), bool)

    def carries(self, data: Dataset) -> tuple[np.ndarray, np.ndarray] | None:
        """Rows (N,) bool and inertial parameters (10,), flange frame, of what is carried in them alone."""
        return None

    @property
    def only_in_tables(self) -> bool:
        """Whether it acts through the robot's tables alone: its change is zero in value."""
        return type(self).bake is not Effect.bake

    def describe(self) -> str:
        """One sentence for a report, with the values in it, as of a revolute axis."""
        numbers = {p.name: v for p, v in zip(self.parameters(), self.values)}
        return self.sentence.format(joint=self.joint, **numbers)

    def describe_on(self, robot: Robot) -> str:
        """The sentence with the units of this robot's axes."""
        return self.in_units_of(robot, self.describe())

    def in_units_of(self, robot: Robot, words: str) -> str:
        """A parameter's name or a sentence with the units that they have on this robot."""
        return of_a_slide(words) if self.in_axis_units and slides(robot, self.joint) else words

    def derived(self, covariance: np.ndarray) -> tuple[tuple[str, float, float], ...]:
        """Numbers that follow from the parameters and say more: (name with unit, value, standard deviation).

        covariance (k, k) of all parameters; only what the estimate supports is given.
        """
        return ()

    def curves(self, position: np.ndarray, covariance: np.ndarray) -> tuple[OwnCurve, ...]:
        """What the effect does at output positions (N,) of its axis, if it does several things; covariance as
        in `derived`."""
        return ()

    @property
    def has_curves(self) -> bool:
        """Whether it does several things by its axis's position."""
        return type(self).curves is not Effect.curves

    def quickness(self, view) -> tuple[float, ...]:
        """Factors, one as likely as the other, by which its parameters may be larger in these data than they
        are plausible by themselves."""
        return (1.0,)

    @property
    def where_unknown(self) -> str:
        """Its label, with how the arm is taken to be where nothing is known of what it follows."""
        return self.label

    def caveat(self, covariance: np.ndarray) -> str:
        """What the estimate cannot tell, in a few words; empty where there is nothing to say."""
        return ""

    def possible(self, robot: Robot, deviation: np.ndarray) -> bool:
        """Whether arm and drives can be so, together with what the robot's tables declare: no negative
        inertia, no spring that gives way against its load. What one parameter alone can break is a bound of
        that parameter. deviation (k,): the values' standard deviations."""
        return True

    # -- as a candidate ---------------------------------------------------------------------------
    @classmethod
    def candidates(cls, robot: Robot, view: View) -> Iterable[Effect]:
        """The effects of this class that could be missing from `robot` on this data, at zero size; none of a
        declared one."""
        if not cls.declared:
            raise NotImplementedError
        return ()

    def richer(self) -> Iterable[Effect]:
        """Forms of the same cause with more terms, at zero size where it stands: tried once it is found."""
        return ()

    def laws(self) -> Iterable[Effect]:
        """A curve under every law that its amplitudes may follow, at zero size; the terms of one that has
        fewer are the first of one that has more."""
        return ()

    def companions(self) -> Iterable[Effect]:
        """Effects that often act where this one does, at zero size: tried beside it once it is found."""
        return ()

    # -- in the chain -----------------------------------------------------------------------------
    def station_in(self, view: View) -> Station:
        """Where it acts in this kind of data."""
        return self.station

    def change(self, view: View) -> Change:
        """What the effect adds to the signal at its station."""
        raise NotImplementedError

    def by_own_entry(self, view: View, slope: np.ndarray | float) -> np.ndarray:
        """(N, 1, n) what changes by `slope` (N,) with the axis's own entry of a signal."""
        own = np.arange(view.axes) == self.index
        return np.broadcast_to(slope, view.rows)[:, None, None] * own

    def place(self, session: int, base: Placement, tool: Placement) -> tuple[Placement, Placement]:
        """Base and tool frames of a session; only the effects that are frames change them."""
        return base, tool

    def in_frames_of(self, controller: Controller) -> tuple[np.ndarray, np.ndarray]:
        """The values (k,) as counted from the controller's base and flange, where they count from DH frame 0
        and n, and their derivative (k, k) by the values as they are."""
        return np.asarray(self.values), np.eye(len(self.values))

    def keep(self, view: View) -> np.ndarray | None:
        """Rows (N,) bool that are to be used; None = all. Only effects of the record (outliers) differ."""
        return None

    def undecided(self, fitted: Dataset, other: Dataset) -> np.ndarray | None:
        """Rows (N,) bool of `other` of which those fitted do not say whether it acts; None: of none."""
        return None

    @classmethod
    def excludes_rows(cls) -> bool:
        """Whether it says that rows are wrong, instead of changing a signal."""
        return cls.keep is not Effect.keep

    def measured(self, phi: np.ndarray) -> np.ndarray | None:
        """Rows (N,) bool of output angles phi (N, n), rad, where it was estimated; None = everywhere."""
        return None

    def renewed(self, view: View, again: bool = False) -> Effect:
        """With what it takes from the residual (a threshold) anew; again: of a fit without rows left out."""
        return self

    def leaving_out(self, view: View, rows: np.ndarray) -> Effect:
        """The effect where noise says which rows (N,) bool are wrong by themselves; others stay."""
        return self

    def could_change(self, view: View) -> tuple[np.ndarray, np.ndarray] | None:
        """Lowest and highest (N,) that its change could be where nothing says which; None: it is known."""
        return None

    def drawn_wider(self, scale: float) -> Effect:
        """The effect with priors `scale` times as wide, where the data choose their width; others stay."""
        return self

    def redrawn(self, covariance: np.ndarray) -> Effect:
        """The same with priors as wide as its free terms, with their covariance (k, k), have come out."""
        return self

    def with_all_terms(self) -> Effect:
        """The effect with what its simplest form leaves out, under priors: its intervals then hold whichever
        form is the true one; others stay."""
        return self

    def moved(self, view: View) -> Effect:
        """The effect at a likelier place in the rows, seen from a fit that has it; others stay."""
        return self

    def searched_between(self, view: View) -> dict[str, tuple[float, float]]:
        """Of a parameter that was searched and not estimated: its name, and between which values it lies with
        95 %, seen from a fit that has the effect."""
        return {}

    def deviation(self, phi: np.ndarray) -> np.ndarray | None:
        """(N,) rad: standard deviation of a curve of its axis at output angles phi (N, n); None: no curve."""
        return None

    def after_fit(self, phi: np.ndarray, covariance: np.ndarray) -> Effect:
        """The effect as it goes into a robot file: with what a fit on output angles phi (N, n), rad, has left
        open; covariance (k, k) of all parameters, zero for those that were held."""
        return self

    # -- what it tells of -------------------------------------------------------------------------
    def bound_to(self, data: Dataset) -> Effect:
        """The effect for these data files alone, if it is of a record; data without files bind nothing."""
        return replace(self, record=data.fingerprint) if self.of_record else self

    def acts_on(self, data: Dataset) -> bool:
        """False where it tells of other data files than those that `data` was read from."""
        return not self.record or self.record == data.fingerprint

    # -- in the robot file ------------------------------------------------------------------------
    def to_table(self) -> dict[str, float | int | str | list[str]]:
        """Flat mapping for a robot file: name, joint, parameters with units in their names."""
        table: dict[str, float | int | str | list[str]] = {"effect": self.name}
        if self.joint is not None:
            table["joint"] = self.joint
        table |= {p.name: v for p, v in zip(self.parameters(), self.values)}
        return table | ({RECORD_KEY: list(self.record)} if self.record else {})

    @classmethod
    def from_table(cls, table: Mapping[str, float | int | str]) -> Effect:
        """The inverse of `to_table`, but for the record. Raises KeyError naming a missing parameter."""
        raw = cls(joint=table.get("joint"), values=())
        return raw.with_values(table[parameter.name] for parameter in raw.parameters())

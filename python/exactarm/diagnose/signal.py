"""What a residual may follow, along what something could move, and what is left: values with the words of a
report."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from exactarm.effects.axis_units import slides
from exactarm.robot.robot import Robot


class Quantity(StrEnum):
    """What a signal is of; every other quantity is a covariate by its name."""

    ANGLE, TRAVEL, LOAD, APPROACH = "angle", "travel", "load", "approach"
    DIRECTION, SPEED, ACCELERATION, MOTOR_ANGLE = "direction", "speed", "acceleration", "motor angle"
    TWO_ANGLES, POSITION, PLACE = "angles of two axes together", "position", "position in the workspace"
    TIME, ORDER = "time", "order of measurement"


@dataclass(frozen=True)
class Signal:
    """A quantity of an axis (from 1), or of none; part: of a position its component, of an angle where it is
    counted."""

    quantity: str
    axis: int | None = None
    part: str = ""

    def __str__(self) -> str:
        of_axis = "" if self.axis is None else f"of axis {self.axis}"
        return " ".join(filter(None, (self.quantity, of_axis, self.part)))

    @property
    def places_axis(self) -> bool:
        """Where an axis stands."""
        return self.quantity in (Quantity.ANGLE, Quantity.TRAVEL)

    @property
    def of_posture(self) -> bool:
        """What comes again with the arm's pose, whenever it is measured."""
        return self.places_axis or self.quantity in (
            Quantity.LOAD, Quantity.TWO_ANGLES, Quantity.POSITION, Quantity.PLACE)

    @property
    def of_time(self) -> bool:
        return self.quantity in (Quantity.TIME, Quantity.ORDER)


def place_of_axis(robot: Robot, joint: int) -> Signal:
    """Of an axis (from 1): its angle, or its travel where it slides."""
    return Signal(Quantity.TRAVEL if slides(robot, joint) else Quantity.ANGLE, joint)


@dataclass(frozen=True)
class Direction:
    """Along which something could move: a turn of an axis (from 1), what is measured of one, an axis of the
    tracker or of a sensor."""

    words: str
    axis: int | None = None
    turns: bool = False
    of_tracker: bool = False
    slides: bool = False

    def unit_beside(self, unit: str) -> str:
        """Of a movement along it; `unit`: of what the problem measures."""
        return ("m" if self.slides else "rad") if self.turns else unit

    def __str__(self) -> str:
        return self.words


TRACKER = Direction("the device", of_tracker=True)


def turn_of(joint: int, sliding: bool = False) -> Direction:
    return Direction(f"a {'travel' if sliding else 'turn'} of axis {joint}", joint, turns=True,
                     slides=sliding)


def movement_of(robot: Robot, joint: int) -> Direction:
    """Of an axis (from 1): its turn, or its travel where it slides."""
    return turn_of(joint, slides(robot, joint))


def tilt_of(joint: int) -> Direction:
    """Of all that stands behind a joint (from 1), across its axis."""
    return Direction(f"a tilt behind axis {joint}", joint)


def measured_of(joint: int) -> Direction:
    return Direction(f"axis {joint}", joint)


def axis_of(thing: str, name: str) -> Direction:
    """the device's x axis"""
    return Direction(f"the {thing}'s {name} axis", of_tracker=thing == "device")


@dataclass(frozen=True)
class Structure:
    """Something that no effect explains, in words; the signals that it follows; wanders: it is a device that
    drifts or jumps; hertz: it is a wave in time."""

    words: str
    signals: tuple[Signal, ...] = ()
    wanders: bool = False
    hertz: float | None = None

    def __str__(self) -> str:
        return self.words

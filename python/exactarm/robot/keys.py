"""The keys of a robot file: name with unit -> field of the robot tables, with what a value must be.

A revolute axis and a prismatic one have the same fields in other units. Lengths and angles may also be
given in mm and degrees (`d_mm`, `alpha_deg`) by hand; exactarm itself writes m and rad.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

MOST_AXES = 64  # ten arms in a row; matrices of all pairs of axes stay small
FORMAT = 1  # number of the file format; raised when an old reader would misunderstand a new file

# Units that a hand-written file may use instead: ending -> (ending that is meant, factor).
OTHER_UNITS = {
    "_deg": ("_rad", math.pi / 180.0),
    "_deg_s": ("_rad_s", math.pi / 180.0),
    "_deg_s2": ("_rad_s2", math.pi / 180.0),
    "_mm": ("_m", 1e-3),
}

Rule = tuple[Callable[[float], bool], str]
ANY: Rule = (lambda value: True, "a number")
POSITIVE: Rule = (lambda value: value > 0.0, "a number above 0")
NOT_NEGATIVE: Rule = (lambda value: value >= 0.0, "a number of 0 or above")
NOT_ZERO: Rule = (lambda value: value != 0.0, "a number other than 0")
# Angles of a frame mean the same one turn further, limits of an axis end after a few turns (seven of a wrist,
# a dozen of a positioner), no joint turns a hundred times faster than a person: what is larger are degrees.
FRAME_ANGLE: Rule = (lambda value: abs(value) <= 4.0 * math.pi,
                     "a number of at most 12.6 rad (or degrees, by a key with _deg)")
ANGLE_LIMIT: Rule = (lambda value: abs(value) <= 26.0 * math.pi,
                     "a number of at most 81 rad (or degrees, by a key with _deg; without a limit no key)")
RATE_LIMIT: Rule = (lambda value: 0.0 < value <= 100.0,
                    "a number above 0, at most 100 rad/s (or degrees, by a key with _deg_s)")
# From the Moon to Jupiter, or none: what else is written there is in g, ft/s², cm/s² or mm/s².
GRAVITY: Rule = (lambda size: size == 0.0 or 1.5 <= size <= 25.0, "about 9.81, or three zeros")
SIGN: Rule = (lambda value: value in (-1.0, 1.0), "1 or -1")


@dataclass(frozen=True)
class Key:
    """One number of a joint: field of `Joint`, key for a revolute and for a prismatic axis, rule (of a
    prismatic axis another one, if given), note in the file."""

    field: str
    revolute: str
    prismatic: str
    rule: Rule = ANY
    note: str = ""
    sliding_rule: Rule | None = None

    def rule_of(self, joint_type: str) -> Rule:
        return self.sliding_rule if joint_type == "prismatic" and self.sliding_rule else self.rule

    def name(self, joint_type: str) -> str:
        return self.prismatic if joint_type == "prismatic" else self.revolute


def _same(field: str, name: str, rule: Rule = ANY, note: str = "") -> Key:
    return Key(field, name, name, rule, note)


JOINT_KEYS = (_same("sign", "sign", SIGN, "DH angle = sign * q + zero"),
              _same("zero", "zero_rad", FRAME_ANGLE), _same("d", "d_m"), _same("a", "a_m"),
              _same("alpha", "alpha_rad", FRAME_ANGLE),
              _same("beta", "beta_rad", FRAME_ANGLE,
                    note="Hayati: beta is a parameter of this frame, d is not"),
              Key("q_offset", "q_offset_rad", "q_offset_m", note="q = output angle of the gear + offset"),
              Key("controller_offset", "controller_offset_rad", "controller_offset_m",
                  note="what the controller takes it for"),
              Key("ratio", "ratio", "ratio_rad_m", NOT_ZERO, "motor angle / output angle"),
              Key("controller_ratio", "controller_ratio", "controller_ratio_rad_m", NOT_ZERO,
                  "what the controller takes it for"),
              Key("spring_linear", "spring_linear_Nm_rad", "spring_linear_N_m", POSITIVE),
              Key("spring_cubic", "spring_cubic_Nm_rad3", "spring_cubic_N_m3"),
              _same("rotor_inertia", "rotor_inertia_kg_m2", NOT_NEGATIVE, "motor side"),
              Key("coulomb", "coulomb_Nm", "coulomb_N", NOT_NEGATIVE, "output side"),
              Key("viscous", "viscous_Nm_s_rad", "viscous_N_s_m", NOT_NEGATIVE, "output side"),
              Key("q_min", "q_min_rad", "q_min_m", ANGLE_LIMIT, sliding_rule=ANY),
              Key("q_max", "q_max_rad", "q_max_m", ANGLE_LIMIT, sliding_rule=ANY),
              Key("q_dot_max", "q_dot_max_rad_s", "q_dot_max_m_s", RATE_LIMIT, sliding_rule=POSITIVE),
              Key("q_ddot_max", "q_ddot_max_rad_s2", "q_ddot_max_m_s2", POSITIVE),
              Key("torque_max", "torque_max_Nm", "torque_max_N", POSITIVE, "output side"),
              _same("torque_constant", "torque_constant_Nm_A", NOT_ZERO, "motor side"))
GEAR_TABLES = {"cw": "the motor angle falls", "ccw": "the motor angle rises"}
GEAR_KEYS = {"order": "order_per_output_rev", "a": "a", "b": "b"}
FRAME_FIELDS = ("sign", "zero", "d", "a", "alpha", "beta")  # of Joint: its geometry
CONTROLLER_KEYS = ("chain", "absolute_accuracy", "coupling", "pulses_per_rad", "joint_names", "base",
                   "flange", "frames")

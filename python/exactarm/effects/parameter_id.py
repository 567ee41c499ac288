"""What a parameter is: its name in files, which is the text of it, and what the effect says of it."""

from __future__ import annotations

from enum import IntEnum


class Group(IntEnum):
    """Kinds of parameters, in the order in which they are kept when they collide."""

    FRAME = 0
    GEOMETRY = 1
    OFFSET = 2
    RATIO = 3
    EFFECT = 4


class ParameterId(str):
    """`session_1.base_x_m`, `d_2_m`, `joint_compliance_2.linear_rad_Nm`; symbol: d, a, ..., base, tool,
    contact, empty for an effect's own; axis counts from 1, None for a parameter of no single axis."""

    group: Group
    symbol: str
    axis: int | None
    session: int | None

    def __new__(cls, name: str, group: Group = Group.EFFECT, symbol: str = "", axis: int | None = None,
                session: int | None = None) -> ParameterId:
        new = super().__new__(cls, name)
        new.group, new.symbol, new.axis, new.session = group, symbol, axis, session
        return new

    @property
    def unit(self) -> str:
        """m or rad of a length or an angle; empty for all else."""
        unit = self.rpartition("_")[2]
        plain = unit in ("m", "rad") and "_per_" not in self and not self.endswith("Nm_rad")
        return unit if plain else ""

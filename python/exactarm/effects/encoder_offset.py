"""Encoder offset: the zero of an encoder behind the gear against the motor's, one for each run and axis."""

from dataclasses import dataclass

from exactarm.data.kinds import GEAR_RUN
from exactarm.effects.base import Change, Effect, Parameter, Station


@dataclass(frozen=True)
class EncoderOffset(Effect):
    """Offset of axis `joint` in one run; `column`: where the axis stands in the reading."""

    run: int = 1
    column: int = 0

    name = "encoder_offset"
    station = Station.DEVICE
    kinds = (GEAR_RUN.name,)
    declared = True
    sentence = "the encoders of axis {joint} differ by {offset_rad:.4g} rad in one run"
    parameter_table = (Parameter("offset_rad", 1.0),)

    @property
    def zero_of(self) -> int:
        return self.run

    def parameter_label(self, parameter: Parameter) -> str:
        return f"run_{self.run}.{self.label}.{parameter.name}"

    def change(self, view) -> Change:
        here = (view.data.run == self.run).astype(float)[:, None]
        return Change((self.column,), self.values[0] * here, here[:, :, None])

"""Link compliance: an axis bends across itself under the moment that its bearing carries.

All beyond joint i turns by

    rad_per_Nm (M - z (z . M))

M: the moment of gravity at the joint, in a motion less what moves the links (`carried_moment.py`;
`weight_alone` as of the base); z: its axis. It is the part of the joint stiffness matrix across the axis that
a torsion spring about it does not have (Abele, Weigold and Rothenbuecher 2007; Klimchik et al. 2013).
"""

from collections.abc import Iterable
from dataclasses import dataclass

from exactarm.effects.base import Change, Effect, Parameter
from exactarm.effects.carried_moment import Bending


@dataclass(frozen=True)
class LinkCompliance(Bending):
    name = "link_compliance"
    plain = "a link or bearing that bends under load"
    sentence = "bearing and link of axis {joint} bend across the axis by {rad_per_Nm:.3g} rad per Nm"
    source = "Abele, Weigold and Rothenbuecher 2007; Klimchik et al. 2013"
    parameter_table = (Parameter("rad_per_Nm", 2e-6, 0.0),)

    def change(self, view) -> Change:
        return self.bent(view, self.index)

    @classmethod
    def candidates(cls, robot, view) -> Iterable[Effect]:
        """Of every axis but the first, whose bending is that of the base. Not under generic masses: what
        loads a bearing across its axis hangs on how they are distributed, and nothing here makes up for
        that."""
        if not view.has_masses or robot.generic_masses:
            return ()
        return (form for i in range(1, robot.axes) if robot.joints[i].type == "revolute"
                for form in cls(i + 1, (0.0,)).forms_in(view))

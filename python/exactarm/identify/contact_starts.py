"""Where contacts start from: at what the target touched, by the robot and the tool as they are known."""

import numpy as np

from exactarm.chain import Layout
from exactarm.data.dataset import Dataset
from exactarm.identify.closure_fit import ClosureFit, Pulls, fit_closures
from exactarm.measurement.closures import contact_keys, predict_closures
from exactarm.measurement.contact import Contact
from exactarm.measurement.contacts import CONTACT_CLASSES, Touched
from exactarm.robot.robot import Robot

# below, a contact is wherever it was touched
_LEAST_TOUCHES = {"socket": 1, "plane": 3, "sphere": 4, "bar": 4, "tilt": 6, "accel": 4, "camera": 18,
                  "partner": 12}
_SOUGHT_ANEW = 5
_LIKELIER = 1.0  # of the log likelihood: what rounding and an unfinished step do not make


def with_contacts(robot: Robot, layout: Layout, data: Dataset, threads: int = 1) -> Layout:
    """The layout with every contact of `data` that it lacks, where the target is; contacts come behind frames
    and before the rest.

    A contact with too few touches is left out, and with it its rows. Only the contacts are refined, nothing
    else moves.
    """
    known = {(e.contact, e.session, e.number) for e in layout.effects if isinstance(e, Contact)}
    view = predict_closures(robot, layout.held, data, tangents=False, threads=threads).view
    found = []
    for name, session, number in contact_keys(data):
        if (name, session, number) in known:
            continue
        contact = CONTACT_CLASSES[name](None, (), session, number)
        rows = np.flatnonzero(contact.rows(data))
        if len(rows) >= _LEAST_TOUCHES[name]:
            found.append(contact.started(view, rows))
    return Layout.of(tuple(found)).joined(layout)


def sought_anew(robot: Robot, fit: ClosureFit, data: Dataset, pulls: Pulls, threads: int) -> ClosureFit:
    """The fit with every touched contact sought anew around its tool, as long as that makes it likelier: with
    a wrong tool a face may lie across its touches, and does not turn upright by itself."""
    effects = fit.layout.effects
    others = [k for k, effect in enumerate(effects) if not isinstance(effect, Touched)]
    if len(others) == len(effects):
        return fit
    for _ in range(_SOUGHT_ANEW):
        layout = with_contacts(robot, fit.layout.only(others), data, threads)
        anew = fit_closures(robot, layout, data, pulls, threads=threads)
        if anew.log_likelihood < fit.log_likelihood + _LIKELIER:
            break
        fit = anew
    return fit


def counted_anew(layout: Layout) -> Layout:
    """The layout with every touched contact counted from where it is: a face that has turned far from where
    it started hardly follows its tilts any more, and they would be taken for unseen."""
    return Layout(tuple(effect.counted_anew() if isinstance(effect, Touched) else effect
                        for effect in layout.effects), layout.free)

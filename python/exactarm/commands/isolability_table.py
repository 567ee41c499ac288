"""Which causes a planned set of poses could tell, as a table, as columns and in result.json."""

import numpy as np

from exactarm.diagnose.decisions import CLEAR
from exactarm.diagnose.isolability import Isolability
from exactarm.report import Table

_MOST_ROWS = 20


def isolability_table(causes: Isolability, noise_mm: float) -> Table:
    """The causes that show and would be taken for others, most visible first; what does not show is said in
    the note."""
    shown = np.flatnonzero((causes.seen >= CLEAR) & (causes.least < CLEAR))
    shown = shown[np.argsort(-causes.seen[shown], kind="stable")][:_MOST_ROWS]
    rows = tuple((causes.titles[i], f"{causes.seen[i]:.1f}", causes.titles[causes.nearest[i]],
                  f"{causes.least[i]:.1f}") for i in shown)
    told = int(np.sum((causes.seen >= CLEAR) & (causes.least >= CLEAR)))
    hidden = int(np.sum(causes.seen < CLEAR))
    note = (f"In standard deviations, for causes of plausible size and a noise of {noise_mm:g} mm a "
            f"coordinate. {told} of {len(causes.seen)} causes would be told from all others; {hidden} would "
            f"not show (below {CLEAR:g}). All pairs: isolability.csv.")
    return Table("Causes that these poses cannot tell apart", ("cause", "seen", "most like it", "apart"),
                 rows or (("none of those that show", "", "", ""),), note)


def isolability_columns(causes: Isolability) -> dict[str, np.ndarray]:
    """One row a cause, one column for every other: standard deviations between them, empty where they are
    forms of one."""
    apart = np.where(np.isfinite(causes.apart), np.round(causes.apart, 2), np.nan)
    columns: dict[str, np.ndarray] = {"cause": np.array(causes.titles), "seen": np.round(causes.seen, 2)}
    return columns | {title: apart[:, k] for k, title in enumerate(causes.titles)}


def isolability_json(causes: Isolability) -> list[dict]:
    return [
        {"effect": effect.name, "joint": effect.joint, "seen": float(seen),
         "most_like": causes.titles[nearest], "apart": float(least)}
        for effect, seen, nearest, least in zip(causes.effects, causes.seen, causes.nearest, causes.least)]

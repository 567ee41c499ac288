"""What usually turns at an order: the likely source of an angle error that repeats so many times per output
revolution.

A guess for a reader, from the gear ratio alone, not a finding: the orders of motor and output are certain,
names of parts are what gearboxes of robots have there (wave generator of a strain-wave gear, input shaft of a
cycloidal one). Where no ratio is declared, an order that is one or two times a common ratio of strain-wave
gears says so.
"""

_OUTPUT_ORDERS = 10.0  # below it a part on the output side, with few waves a turn, is likely
_NEAR = 0.02  # of a motor revolution
_STRAIN_WAVE = (30, 50, 80, 100, 120, 160)  # ratios that makers of strain-wave gears list
_TURNS = {1: "once", 2: "twice"}


def likely_source(order: float, ratio: float | None) -> str:
    """In a few words; `ratio` None where no gear is declared."""
    if ratio is not None and abs(ratio) > 1.0:
        turns = order / abs(ratio)
        if round(turns) >= 1 and abs(turns - round(turns)) < _NEAR * round(turns):
            return {1: "motor: its encoder or input shaft",
                    2: "motor, twice a turn: wave generator or input shaft"}.get(
                round(turns), f"motor, {round(turns)} times a turn: teeth or poles")
    if abs(order - 1.0) < 0.1:
        return "output: run-out of bearing or encoder disc"
    if abs(order - 2.0) < 0.1:
        return "output: ovality, tilt of the encoder disc"
    if order < _OUTPUT_ORDERS:
        return "output side: bearing or encoder disc"
    turns = [(gear, n) for n in _TURNS for gear in _STRAIN_WAVE if abs(order / gear - n) < _NEAR * n]
    if ratio is None and turns:
        of_ratio = " or ".join(f"{_TURNS[n]} at {gear}:1" for gear, n in turns)
        return f"strain-wave gear? {of_ratio} (a motor turn)"
    return "gear: teeth or rolling elements"

"""The least-squares search against all 27 non-linear problems of NIST's Statistical Reference Datasets.

Files as NIST publishes them (https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml, public domain): two
starting points, values and standard deviations certified to 11 digits. Derivatives by a complex step, so that
they are exact.
"""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy import optimize

from exactarm.numerics.regression import Evaluation, least_squares

FOLDER = Path(__file__).parent / "nist_strd"
LEAST_DIGITS, LEAST_DIGITS_DEVIATION = 6.0, 5.0
FROM_TOO_FAR = ("MGH10", 1)
# The square sum of Lanczos1 is 1.4e-25: data of 14 digits hold its deviations to three.
FEWER_DIGITS_DEVIATION = {"Lanczos1": 2.0}


def exponentials(b, x):
    return b[0] * np.exp(-b[1] * x) + b[2] * np.exp(-b[3] * x) + b[4] * np.exp(-b[5] * x)


def chwirut(b, x):
    return np.exp(-b[0] * x) / (b[1] + b[2] * x)


def gauss(b, x):
    return b[0] * np.exp(-b[1] * x) + b[2] * np.exp(-(((x - b[3]) / b[4]) ** 2)) + b[
        5
    ] * np.exp(-(((x - b[6]) / b[7]) ** 2))


def cubic_ratio(b, x):
    return (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) / (1.0 + x * (b[4] + x * (b[5] + x * b[6])))


def enso(b, x):
    def wave(cos, sin, period):
        angle = 2.0 * np.pi * x / period
        return cos * np.cos(angle) + sin * np.sin(angle)

    return b[0] + wave(b[1], b[2], 12.0) + wave(b[4], b[5], b[3]) + wave(b[7], b[8], b[6])


MODELS = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1.0 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1.0 - np.exp(-b[1] * x)),
    "Chwirut1": chwirut,
    "Chwirut2": chwirut,
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "ENSO": enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
    "Gauss1": gauss,
    "Gauss2": gauss,
    "Gauss3": gauss,
    "Hahn1": cubic_ratio,
    "Kirby2": lambda b, x: (b[0] + x * (b[1] + x * b[2])) / (1.0 + x * (b[3] + x * b[4])),
    "Lanczos1": exponentials,
    "Lanczos2": exponentials,
    "Lanczos3": exponentials,
    "MGH09": lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "MGH10": lambda b, x: b[0] * np.exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * np.exp(-x * b[3]) + b[2] * np.exp(-x * b[4]),
    "Misra1a": lambda b, x: b[0] * (1.0 - np.exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1.0 - (1.0 + 0.5 * b[1] * x) ** -2),
    "Misra1c": lambda b, x: b[0] * (1.0 - (1.0 + 2.0 * b[1] * x) ** -0.5),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1.0 + b[1] * x),
    "Nelson": lambda b, x: b[0] - b[1] * x[0] * np.exp(-b[2] * x[1]),
    "Rat42": lambda b, x: b[0] / (1.0 + np.exp(b[1] - b[2] * x)),
    "Rat43": lambda b, x: b[0] / (1.0 + np.exp(b[1] - b[2] * x)) ** (1.0 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - np.arctan(b[2] / (x - b[3])) / np.pi,
    "Thurber": cubic_ratio,
}


def read(name):
    """starts (2, P), certified (P, 2) values and deviations, square sum, y (N,), x (N,) or (2, N)."""
    text = (FOLDER / f"{name}.dat").read_text()
    numbers = [[float(word) for word in line.split("=")[1].split()]
               for line in re.findall(r"^ *b\d+ =.*$", text, re.M)]
    table = np.array([row for row in numbers if len(row) == 4])
    square = float(re.search(r"Residual Sum of Squares: *(\S+)", text)[1])
    data = np.array([line.split() for line in text.splitlines()[60:] if line.strip()], float).T
    y, x = data[0], data[1:] if len(data) > 2 else data[1]
    return table[:, :2].T, table[:, 2:], square, np.log(y) if name == "Nelson" else y, x


def problem(name, y, x):
    """The evaluation of one data set; where the formula has no value, the search is told so."""
    model, step = MODELS[name], 1e-150

    def evaluate(b, with_jacobian):
        with np.errstate(all="ignore"):
            residual = y - model(b, x)
            if not with_jacobian:
                return Evaluation(residual, None)
            moved = b + 1j * step * np.eye(b.size)
            return Evaluation(residual, np.stack([model(each, x).imag / step for each in moved], axis=1))

    return evaluate


def digits(found, certified):
    return float(np.min(-np.log10(np.maximum(np.abs(found / certified - 1.0), 1e-15))))


@pytest.mark.parametrize(("name", "start"),
                         [case for case in product(MODELS, (1, 2)) if case != FROM_TOO_FAR])
def test_certified_digits_are_reached(name, start):
    starts, certified, square, y, x = read(name)
    fit = least_squares(problem(name, y, x), starts[start - 1], tolerance=1e-20)
    assert fit.converged, fit.reason
    assert digits(fit.x, certified[:, 0]) >= LEAST_DIGITS
    deviations = np.sqrt(np.diag(fit.covariance))
    assert digits(deviations, certified[:, 1]) >= FEWER_DIGITS_DEVIATION.get(name, LEAST_DIGITS_DEVIATION)
    if name != "Lanczos1":
        assert digits(2.0 * fit.cost, square) >= LEAST_DIGITS


def test_a_search_that_has_not_arrived_says_so():
    """Start 1 of MGH10 predicts 1e87 where 1e4 was measured: the way down is longer than the limit, and this
    is said."""
    name, start = FROM_TOO_FAR
    starts, certified, square, y, x = read(name)
    fit = least_squares(problem(name, y, x), starts[start - 1])
    assert not fit.converged and "limit of 200 iterations" in fit.reason
    assert fit.offset > 0.1 and 2.0 * fit.cost > 1e3 * square


@pytest.mark.parametrize("name", ["Thurber", "Hahn1", "MGH09", "Rat43", "ENSO"])
def test_square_sum_is_that_of_scipy_or_lower(name):
    starts, _, _, y, x = read(name)
    evaluate = problem(name, y, x)
    for start in starts:
        fit = least_squares(evaluate, start)
        peer = optimize.least_squares(
            lambda b: evaluate(b, False).residual, fit.x, lambda b: -evaluate(b, True).jacobian,
            x_scale="jac",
            xtol=1e-15, ftol=1e-15, gtol=1e-15,
        )
        assert fit.converged and fit.cost <= peer.cost * (1.0 + 1e-9)

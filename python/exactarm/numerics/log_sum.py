"""Logarithm of a sum of numbers that are given by their logarithms."""

import numpy as np


def log_sum(logs: np.ndarray) -> np.ndarray:
    """log(sum(exp(logs))) over the first axis of (s, ...), finite numbers; without the greatest the sum would
    leave the range of doubles."""
    greatest = logs.max(axis=0)
    return greatest + np.log(np.exp(logs - greatest).sum(axis=0))

"""What a row is worth among others of its pose: its readings share the error that the model leaves there.

    residual e_i of pose v = t_v + z_i,     r = var t / (var t + var z),     worth = 1 / (1 + (n_v - 1) r)

n_v readings of a pose are worth n_v / (1 + (n_v - 1) r) independent ones (Kish 1965): all of them where only
the device scatters, one where the arm misses the pose alike each time. Counted as independent, ten readings
of each pose would make every interval three times too narrow, and the drawing weigh a tenth.
"""

import numpy as np

# readings beyond the first of their pose, below which nothing is said of what they share: these tell the
# device's variance, in three components, to a fourth
_LEAST_READINGS = 10


def worth_of_rows(residual: np.ndarray, poses: np.ndarray, spent: float = 0.0) -> np.ndarray:
    """(N,) independent readings that each row is worth, from residuals (N, m) of one scale, the numbers (N,)
    of the poses from 0, and how many parameters were fitted to them (analysis of variance, by moments)."""
    rows, m = residual.shape
    counts = np.bincount(poses)
    if rows - len(counts) < _LEAST_READINGS:
        return np.ones(rows)
    sums = np.stack([np.bincount(poses, weights=column) for column in residual.T], axis=1)
    means = sums / counts[:, None]
    within = float(np.sum((residual - means[poses]) ** 2)) / ((rows - len(counts)) * m)
    # a fit takes its share of what the poses have in common, next to nothing of what readings differ by
    between = float(np.sum(sums * means)) / max(len(counts) * m - spent, 1.0)
    shared = max((between - within) * len(counts) / rows, 0.0)
    if shared == 0.0:
        return np.ones(rows)
    return 1.0 / (1.0 + (counts[poses] - 1.0) * shared / (shared + within))

"""Numbers without a robot: least squares, rotations, harmonics, sampled signals, formulas."""

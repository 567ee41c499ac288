"""Noise: one model of what no cause explains, and its estimate from residuals."""

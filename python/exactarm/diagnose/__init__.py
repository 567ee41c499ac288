"""Diagnosis: find the residual, trace it to an effect that the model lacks, add it, judge it on other
data."""

"""Trials of everything that exactarm reads: `python tests/robustness/run.py --count 10000`."""

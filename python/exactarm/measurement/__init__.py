"""Measurement: the kinds of data as objects. Each says how columns become signals, where its chain begins,
which device ends it, which rows belong together, and what its error is."""

"""First aid: the usual mistakes of a user, tried on data that a model does not explain.

first_aid      all of it: one line for the likeliest mistake of every sort
*_mistakes     one file a kind of data
odd_*          mistakes in a part of the rows or runs
"""

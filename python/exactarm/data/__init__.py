"""Measured data: columns of a table become rows of a data set, of a kind that follows from them.

kinds      one file a kind of data       examples, paths, robots   the shipped files
"""

"""Plots: plain arrays and labels in, a matplotlib figure out. Nothing here is imported before a figure is
drawn."""

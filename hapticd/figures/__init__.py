"""Figures of runs, from one place: columns in, a matplotlib figure out; live, recorded and simulated alike.

Needs matplotlib (extra `study`), which is why the rooms above import this one when a figure is asked for.
"""

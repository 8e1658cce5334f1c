"""Walls under hands that move: what every law costs in force, drag and pull, and what of it is felt."""

"""Templates of a law and a driver of your own; copy this folder, rename it, and run `pytest` beside it."""

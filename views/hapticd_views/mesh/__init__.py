"""A mesh into a distance field: what is wrong with it, its distances on a grid, and how far these are off."""

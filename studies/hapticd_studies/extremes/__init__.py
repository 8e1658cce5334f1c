"""Numerical stability at the edges: the model's own arithmetic, held against exact answers over many decades."""

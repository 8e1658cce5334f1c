"""Rigid shapes anywhere: how far away a surface is, and a proxy that stays on it. Pure arithmetic on floats."""

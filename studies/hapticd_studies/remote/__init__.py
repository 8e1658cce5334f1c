"""Scenes from other programs: what stiffness a late and uneven client gets, law by law."""

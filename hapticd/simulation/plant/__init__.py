"""The mechanics of a simulated device: one period, exactly.

    m x'' + b x' + k x = F + F_hand - f_c sign(x')          m, b, k: device and hand together

The functions are arithmetic on scalar fields, + - * / and comparisons only, so that the same source runs
interpreted and compiled with equal results to the last bit. Switches in capitals are terms of the model;
`specialise` removes the branches of those that a device does not have.
"""

from hapticd.simulation.plant.arithmetic import sine
from hapticd.simulation.plant.coefficients import delay_line, epochs, recorded_points, start_state, terms
from hapticd.simulation.plant.hold import flow
from hapticd.simulation.plant.state import Buffers, PlantParams, PlantState
from hapticd.simulation.plant.step import move, sense
from hapticd.simulation.plant.stepped import METHODS

__all__ = [
    "METHODS",
    "Buffers",
    "PlantParams",
    "PlantState",
    "delay_line",
    "epochs",
    "flow",
    "move",
    "recorded_points",
    "sense",
    "sine",
    "start_state",
    "terms",
]

"""The mass matrices of a device with several axes, made ready for the step: none where each axis goes by itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.space import linkage
from hapticd.simulation.space.axes import axis_options
from hapticd.simulation.space.matrix import is_mass, transition

Matrix = tuple[tuple[float, ...], ...]
Three = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Masses:
    """What `coupled.swing` needs.

    Attributes:
        table: `matrix.transition` of every place, one after the other.
        step_m: distance of the places [m].
        places: how many there are along each axis.
        springs_n_per_m: the hand's spring along each axis [N/m].
    """

    table: tuple[float, ...]
    step_m: float
    places: tuple[int, int, int]
    springs_n_per_m: tuple[float, ...]


def masses(options: SimulationOptions, period_s: float) -> Masses | None:
    """The matrices that a device needs; None where its axes have nothing to do with each other.

    Args:
        options: the device.
        period_s: time between samples [s].

    Raises:
        ValueError: a matrix is none of a mass, or not for this device.
    """
    given = options.space.mass_matrix_kg
    delta = options.space.linkage == "delta"
    if given is None and not delta:
        return None
    if options.axes != 3 or (given is not None and delta):
        raise ValueError("space: a mass matrix or a linkage needs axes = 3, and is one of the two")
    along = axis_options(options)
    damping = [one.viscous_n_s_per_m + one.hand.damping_n_s_per_m for one in along]
    springs = [one.hand.stiffness_n_per_m for one in along]
    hand_kg = [one.hand.mass_kg for one in along]
    if given is not None and (len(given) != 3 or not is_mass(given)):
        raise ValueError("space.mass_matrix_kg: must be three rows of three, symmetric and positive definite")
    return _made(given or options.mass_kg, tuple(hand_kg), tuple(damping), tuple(springs), period_s)


@lru_cache(maxsize=8)
def _made(mass: float | Matrix, hand_kg: Three, damping: Three, springs: Three, period_s: float) -> Masses:
    """The matrices of a device, once for all places that it starts from and all that its hand does there.

    Args:
        mass: the whole matrix; or of a linkage, in the middle and on the mean [kg].
        hand_kg: of the hand, along each axis.
        damping: of device and hand, along each axis [N s/m].
        springs: of the hand, along each axis [N/m].
        period_s: time between samples [s].
    """
    if isinstance(mass, float):
        tables = [
            transition(linkage.mass_matrix(mass, hand_kg, *at), damping, springs, period_s) for at in linkage.places()
        ]
        places = (linkage.PLACES[0], linkage.PLACES[1], linkage.PLACES[2])
    else:
        whole = [[mass[i][j] + (hand_kg[i] if i == j else 0.0) for j in range(3)] for i in range(3)]
        tables = [transition(whole, damping, springs, period_s)]
        places = (1, 1, 1)
    return Masses(tuple(value for table in tables for value in table), linkage.STEP_M, places, springs)

"""The records that a batch of loops is made of: what one loop is given, remembers and reports."""

from __future__ import annotations

from typing import Any, NamedTuple

TRACE_COLUMNS = ("x_m", "v_m_per_s", "x_measured_m", "force_n", "energy_j", "damping_n_s_per_m")


class LoopBuffers(NamedTuple):
    """Histories of the loop: lists when interpreted, arrays when compiled."""

    position_m: Any
    time_s: Any


class LoopDevice(NamedTuple):
    """The simulated device of one loop."""

    state: Any  # fields of `PlantState`
    epochs: Any  # its coefficients, fields of `PlantParams` by epoch
    buffers: Any  # its `Buffers`


class LoopControl(NamedTuple):
    """The loop itself."""

    state: Any  # fields of `LoopState`
    params: Any  # fields of `LoopParams`
    segments: Any  # fields of `Segment`, one after the other
    history: LoopBuffers


class LoopLaw(NamedTuple):
    """The law of the wall."""

    state: Any
    params: Any
    tick: Any  # fields of `LawTick`, what it is shown


class LoopState:
    """What the loop remembers, and what it reports at the end."""

    force_n: float
    last_m: float
    velocity_m_per_s: float
    size: int
    newest: int
    filled: int
    applied_spring_n: float
    low_m: float
    high_m: float
    low_measured_m: float
    high_measured_m: float
    sum_x_m: float
    sum_force_n: float
    peak_force_n: float
    damping_n_s_per_m: float
    felt_mass_kg: float
    outside_tick: int
    ticks: int
    finite: bool


class WallState:
    """The wall now: the fields of `hapticd.tick.scene.Wall` that its forces take."""

    stiffness_n_per_m: float
    damping_n_s_per_m: float
    spring_n: float


class LoopParams:
    """What one loop is given."""

    dt_s: float
    limit_n: float
    samples: int
    target_m: float
    band_m: float
    first_segment: int
    end_segment: int
    trace_from: int
    trace_every: int


class Segment:
    """Ticks over which nothing is changed from outside."""

    start: int
    stop: int
    epoch: int
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    last_window: bool

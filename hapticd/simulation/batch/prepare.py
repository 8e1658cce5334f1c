"""A point made ready: all that its loop is given and starts from, as scalar fields."""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any

from hapticd.config.timing import first_tick
from hapticd.law import LawSnapshot, LawTick, fresh_state, plain_object, scalar_params, state_fields
from hapticd.simulation.batch.fields import fields_of, hints, plain
from hapticd.simulation.batch.point import Point
from hapticd.simulation.batch.state import LoopState, WallState
from hapticd.simulation.compiler.compile import param_kinds
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.plant import delay_line, epochs, recorded_points, sense, start_state, terms


class Prepared:
    """One point as scalar fields, its first sample taken and its law started."""

    def __init__(
        self,
        law: ModuleType,
        point: Point,
        duration_s: float,
        window_s: float,
        trace_every: int,
        trace_last_s: float = math.inf,
    ) -> None:
        device, period_s = point.device, point.period_s
        if device.axes != 1:
            raise ValueError(f"device.axes = {device.axes}: a batch steps devices with one axis")
        changes = epochs(device, period_s)
        self.ticks = max(1, round(duration_s / period_s))
        self.window = min(self.ticks, max(1, round(window_s / period_s)))
        self.epochs = [fields for _, fields in changes]
        self.line = delay_line(device, period_s)
        self.recorded = recorded_points(device)
        plant = plain(start_state(device))
        specialise(sense, terms(device))(plant, plain(self.epochs[0]))
        self.plant = fields_of(plant)
        start_m = float(plant.measured_m)
        self.history = [start_m] + [0.0] * point.velocity_samples
        self.law_param_kinds = param_kinds(law)
        self.law_params = {
            name: kind(value)
            for (name, kind), value in zip(
                self.law_param_kinds.items(), scalar_params(point.params).values(), strict=True
            )
        }
        law_state = fresh_state(law)
        law.start(law_state, plain_object("Params", self.law_params), LawSnapshot(x_m=start_m))
        self.law_state = {name: kind(getattr(law_state, name)) for name, kind in state_fields(law).items()}
        tick = LawTick(device.resolution_m)
        tick.x_m = start_m
        tick.dt_s = period_s
        self.tick = fields_of(tick)
        self.wall = dict.fromkeys(hints(WallState), 0.0)
        self.segments = self._segments(point, [first for first, _ in changes])
        self.params: dict[str, Any] = {
            "dt_s": period_s,
            "limit_n": float(point.max_force_n),
            "samples": point.velocity_samples,
            "target_m": point.target_m,
            "band_m": point.band_m,
            "first_segment": 0,
            "end_segment": 0,
            "trace_from": self.ticks - round(min(duration_s, trace_last_s) / period_s),
            "trace_every": max(1, trace_every),
        }
        self.loop: dict[str, Any] = {name: kind(0) for name, kind in hints(LoopState).items()} | {
            "last_m": start_m,
            "size": len(self.history),
            "filled": 1,
            "low_m": math.inf,
            "high_m": -math.inf,
            "low_measured_m": math.inf,
            "high_measured_m": -math.inf,
            "outside_tick": -1,
            "finite": True,
        }

    def _segments(self, point: Point, epoch_starts: list[int]) -> list[dict[str, Any]]:
        stiffness, damping = point.wall.stiffness_n_per_m, point.wall.damping_n_s_per_m
        wall = {0: (stiffness, damping)}
        for change in point.wall.changes:
            stiffness = stiffness if change.stiffness_n_per_m is None else change.stiffness_n_per_m
            damping = damping if change.damping_n_s_per_m is None else change.damping_n_s_per_m
            wall[first_tick(change.at_s, point.period_s)] = (stiffness, damping)
        starts = sorted({*wall, *epoch_starts, self.ticks - self.window})
        found = []
        for start, stop in zip(starts, [*starts[1:], self.ticks], strict=True):
            if start >= self.ticks:
                break
            k, b = wall[max(at for at in wall if at <= start)]
            found.append(
                {
                    "start": start,
                    "stop": min(stop, self.ticks),
                    "epoch": sum(first <= start for first in epoch_starts) - 1,
                    "stiffness_n_per_m": float(k),
                    "damping_n_s_per_m": float(b),
                    "last_window": start >= self.ticks - self.window,
                }
            )
        return found

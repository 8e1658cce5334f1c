"""Presses for the batch engine: a configuration as one of its points, and what became of each point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hapticd.config.loading import LoadedConfig
from hapticd.errors import ConfigError
from hapticd.offline.outcome import Criterion, Outcome, balance, pressing_n
from hapticd.simulation.batch import BatchResult, Point
from hapticd.simulation.options import SimulationOptions


def point_of(loaded: LoadedConfig) -> Point:
    """The press that a configuration describes.

    Raises:
        ConfigError: it is none, or none that the engine can repeat.
    """
    name, config, device = loaded.path, loaded.config, loaded.options
    if not isinstance(device, SimulationOptions):
        raise ConfigError(f'{name}: device.driver = "{config.device.driver}": only a simulated device, try "loopback"')
    if len(config.scene.walls) != 1:
        raise ConfigError(f"{name}: scene.walls: has {len(config.scene.walls)} walls; a map needs one")
    if config.scene.objects:
        raise ConfigError(f"{name}: scene.objects: a map knows walls only")
    if config.velocity.estimator != "difference":
        raise ConfigError(f'{name}: velocity.estimator = "{config.velocity.estimator}": a map needs "difference"')
    if not pressing_n(device) > 0.0:
        raise ConfigError(
            f"{name}: device.options.hand.force: must come to rest at a press (newton < 0; constant, step or ramp): "
            "a map asks where the device settles"
        )
    if device.initial_position_m < 0.0:
        raise ConfigError(
            f"{name}: device.options.initial_position_m = {device.initial_position_m:g}: must be 0 or more: inside the "
            "wall the daemon ramps the force up, which the engine of a map leaves out"
        )
    limit_n = device.largest_force_n
    if config.safety.profile != "simulation":
        limits = (config.safety.max_force_n, config.safety.max_axis_force_n, limit_n)
        limit_n = min(limit for limit in limits if limit is not None)
    wall = config.scene.walls[0]
    return Point(device, wall, loaded.params, config.loop.period_s, limit_n, config.velocity.samples)


def aimed(point: Point, criterion: Criterion) -> Point:
    """The point with the place where it should settle, and how close to it is settled."""
    at = balance(point.device, [point.wall])
    return replace(point, target_m=at.x_m, band_m=criterion.place_limit_m(point.device, at))


def judge(criterion: Criterion, points: Sequence[Point], result: BatchResult) -> np.ndarray[Any, Any]:
    """The `Outcome` of each point.

    Args:
        criterion: what settled means.
        points: the loops; each must have a balance.
        result: what became of them, with the criterion's window.
    """
    ended = zip(points, result.finite, result.peak_to_peak_m, -result.mean_depth_m, strict=True)
    return np.array(
        [
            criterion.outcome(point.device, balance(point.device, [point.wall]), span_m, mean_m)
            if finite
            else Outcome.DIVERGED
            for point, finite, span_m, mean_m in ended
        ],
        dtype=int,
    )


def misplaced_m(points: Sequence[Point], result: BatchResult) -> np.ndarray[Any, Any]:
    """How much deeper than the balance each mean position is [m]."""
    depth_m: np.ndarray[Any, Any] = result.mean_depth_m + np.array([balance_m(point) for point in points])
    return depth_m


def balance_m(point: Point) -> float:
    """Where hand force and springs balance at the end, < 0 in the wall [m]; NaN where they do not."""
    return balance(point.device, [point.wall]).x_m

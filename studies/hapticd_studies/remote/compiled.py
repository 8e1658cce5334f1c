"""Runs of one client under many laws as machine code: what `runs.run` finds, to the last bit, 100 times as fast."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numba import njit

from hapticd import plugins
from hapticd.config.ports import port_limits
from hapticd.law import LawSnapshot, fresh_state, plain_object, rests_outside, scalar_params, state_fields
from hapticd.offline.rehearsal import simulation_options
from hapticd.simulation.batch.fields import records
from hapticd.simulation.compiler.compile import (
    OPTIONS,
    TICK_KINDS,
    compiled,
    compiled_step,
    kinds,
    on_stack,
    param_kinds,
)
from hapticd.simulation.compiler.specialise import specialise
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.plant import Buffers, move, sense, terms
from hapticd.simulation.plant.hand import hand_force
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.remote.clients import Tool
from hapticd_studies.remote.kernel import PORT, SEEN, Found, HeldDevice, PortLaw, Turns, published_damping
from hapticd_studies.remote.kernel import run as kernel
from hapticd_studies.remote.network import turns
from hapticd_studies.remote.runs import DURATION_S, Case, ended


class CompiledCase:
    """A client that is run under one law after another.

    Args:
        case: the client, its network, the hand; the client must not be one that is tuned by hand.
    """

    def __init__(self, case: Case) -> None:
        loaded = case.config(LawSpec("none", "none", {}))
        self._case = case
        self._options = simulation_options(loaded)
        self._period_s = period_s = loaded.config.loop.period_s
        self._ticks = round(case.duration_s / period_s)
        device = SimulatedDevice(self._options, period_s)
        hand_n = []
        for _ in range(self._ticks):
            hand_n.append(float(hand_force(device.state, device.params, device.buffers)))
            device.state.tick += 1
        self._hand_n = np.array(hand_n)
        self._turns = self._listen()
        limits = port_limits(loaded.config.scene)[0]
        self._port: dict[str, Any] = {
            "spring": case.kind == "tool",
            "stiffness_n_per_m": case.stiffness_n_per_m,
            "damping_n_s_per_m": limits.damping_n_s_per_m,
            "most_n": limits.max_force_n,
            "most_m_per_s": limits.max_speed_m_per_s,
            "hold_s": limits.hold_s,
            "ramp_s": loaded.config.safety.ramp_s,
            "come_in_s": case.come_in_s,
            "period_s": period_s,
            "first_s": -1.0 / case.network.rate_hz,
            "tool_kg": case.tool_kg,
            "table_n_per_m": case.table_n_per_m,
            "table_n_s_per_m": Tool(case.tool_kg, case.table_n_per_m, case.stiffness_n_per_m).table_n_s_per_m,
            "judged_from": _first(0.5 * DURATION_S, period_s),
            "judged_to": _first(DURATION_S, period_s),
        }

    def run(self, law: LawSpec) -> list[float]:
        """What became of it under a law, in the order of `runs.COLUMNS`.

        Raises:
            PluginError: the law cannot be compiled.
        """
        true_m, seen = self.path(law)
        over = max(float(seen["motion"]), 1e-12)
        return [
            *ended(self._case, self._options, self._period_s, true_m, None, bool(seen["diverged"])),
            float(seen["peak_n"]),
            float(seen["step_n"]),
            float(seen["drag_j"]) / over,
            max(0.0, float(seen["given_j"])) / over,
        ]

    def path(self, law: LawSpec) -> tuple[Any, Any]:
        """The true position by tick [m], and fields of `SEEN`.

        Raises:
            PluginError: the law cannot be compiled.
        """
        module = _law(law.name)
        device = SimulatedDevice(self._options, self._period_s)
        state = fresh_state(module)
        given = scalar_params(module.Params.model_validate(dict(law.values)))
        module.start(state, plain_object("Params", given), LawSnapshot())
        law_fields = {name: kind(getattr(state, name)) for name, kind in state_fields(module).items()}
        params = {name: kind(given[name]) for name, kind in param_kinds(module).items()}
        tick = dict.fromkeys(TICK_KINDS, 0.0) | {"in_contact": False, "resolution_m": self._options.resolution_m}
        port = self._port | {"rests": rests_outside(module)}
        plant, plant_params = _fields(device.state), _fields(device.params)
        seen = records([dict.fromkeys(SEEN, 0.0)], SEEN)
        true_m = np.zeros(self._ticks)
        _machine_code(module, tuple(sorted(_switches(self._options).items())))(
            HeldDevice(
                records([plant], kinds(plant)),
                records([plant_params], kinds(plant_params)),
                np.array(device.buffers.line, float),
                self._hand_n,
            ),
            PortLaw(
                records([law_fields], state_fields(module)),
                records([params], param_kinds(module)),
                records([tick], TICK_KINDS),
            ),
            records([port], PORT),
            self._turns,
            Found(np.zeros((max(1, len(self._turns.at_s)), 2)), np.zeros((self._ticks, 4)), seen, true_m),
        )
        return true_m, seen[0]

    def _listen(self) -> Turns:
        """When each turn is, what it knows, and whose message is in force from which tick on."""
        at_s: list[float] = []
        sees: list[int] = []
        until: list[int] = []
        takes = np.full(self._ticks, -1)
        inbox: list[tuple[float, int]] = []
        coming = turns(self._case.network, self._case.duration_s, self._case.seed)
        turn = next(coming, None)
        newest = -1
        for count in range(self._ticks):
            now_s = (count + 1) * self._period_s
            while turn is not None and turn.at_s < now_s:
                if turn.heard_s is not None:
                    inbox.append((turn.heard_s, len(at_s)))
                at_s.append(turn.at_s)
                sees.append(min(count, int(turn.sees_s / self._period_s)))
                turn = next(coming, None)
            until.append(len(at_s))
            heard = [number for heard_s, number in inbox if heard_s < now_s]
            inbox = [one for one in inbox if one[0] >= now_s]
            if heard and max(heard) > newest:
                newest = takes[count] = max(heard)
        return Turns(np.array(at_s, float), np.array(sees, np.int64), np.array(until, np.int64), takes)


@lru_cache
def _law(name: str) -> ModuleType:
    return plugins.law(name)  # looks through all that is installed


def _first(at_s: float, period_s: float) -> int:
    """The first tick whose end is not before a time."""
    count = round(at_s / period_s) - 3
    while (count + 1) * period_s < at_s:
        count += 1
    return count


def _switches(options: Any) -> dict[str, bool]:
    """Terms of the device; its hand's force is given by tick."""
    found = terms(options)
    return {name: on and not name.startswith("HAND_") and name != "TIMED" for name, on in found.items()}


def _fields(plain_: Any) -> dict[str, Any]:
    return {name: getattr(plain_, name) for name in type(plain_).__slots__ if hasattr(plain_, name)}


@lru_cache(maxsize=32)
def _machine_code(law: ModuleType, switches: tuple[tuple[str, bool], ...]) -> Any:
    damps = "damping_n_s_per_m" in state_fields(law)
    calls: dict[str, Any] = {
        "law_step": law.step,
        "move_device": specialise(move, dict(switches)),
        "sense_device": specialise(sense, dict(switches)),
    }
    if damps:
        calls["damping_of"] = published_damping
    run = compiled(specialise(kernel, {}, calls), {law.step: compiled_step(law)})

    @njit(**OPTIONS)  # type: ignore[untyped-decorator]  # numba publishes no types
    def one(device: Any, law: Any, port: Any, turns: Any, found: Any) -> None:
        line = device.buffers
        run(
            HeldDevice(on_stack(device.state[0]), on_stack(device.params[0]), Buffers(line, line, line), device.hand_n),
            PortLaw(on_stack(law.state[0]), on_stack(law.params[0]), on_stack(law.tick[0])),
            on_stack(port[0]),
            turns,
            Found(found.said, found.known, found.seen[0], found.true_m),
        )

    return one

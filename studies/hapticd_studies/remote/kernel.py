"""One client on the simulated omega7 from its first tick to its last, as machine code.

The order of a tick is the daemon's: move, sample, velocity, port, law, limit, write, and then what the client says. The
device and the law are the daemon's own functions; a coupling, a force and their follower are written down once more,
for one axis and an armed guard. tests/studies/test_remote_compiled.py finds any number that goes apart.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, sqrt
from typing import Any, NamedTuple

from hapticd.simulation.options import FARTHEST_M
from hapticd.simulation.plant import move, sense
from hapticd.tick.remote.follower import HASTE_PER_S
from hapticd.tick.remote.one_port import OUTSIDE_S, STRICTLY
from hapticd.tick.remote.streamed_force import BLEND_S
from hapticd.tick.space.channel import LEAST_M
from hapticd_studies.remote.clients import STEP_S

move_device: Callable[..., None] = move
sense_device: Callable[..., None] = sense

PORT = {
    "spring": bool,
    "rests": bool,
    "stiffness_n_per_m": float,
    "damping_n_s_per_m": float,
    "most_n": float,
    "most_m_per_s": float,
    "hold_s": float,
    "ramp_s": float,
    "come_in_s": float,
    "period_s": float,
    "first_s": float,
    "tool_kg": float,
    "table_n_per_m": float,
    "table_n_s_per_m": float,
    "judged_from": int,
    "judged_to": int,
}
"""What a run is given of port and client; `first_s` is when the client's step before the first one would have been."""

SEEN = {
    "peak_n": float,
    "step_n": float,
    "drag_j": float,
    "given_j": float,
    "motion": float,
    "diverged": bool,
}
"""What a run leaves behind, beside the positions."""


class HeldDevice(NamedTuple):
    """The device and the hand on it."""

    state: Any  # of the device
    params: Any  # its coefficients
    buffers: Any  # its delay line
    hand_n: Any  # force of the hand, by tick [N]


class PortLaw(NamedTuple):
    """The law of the port."""

    state: Any
    params: Any
    tick: Any  # what it is shown


class Turns(NamedTuple):
    """The turns of the client, and when the loop hears of them."""

    at_s: Any  # of each turn when it is [s]
    sees: Any  # which tick it knows
    until: Any  # by tick how many turns have been at its end
    takes: Any  # by tick the turn whose message comes into force at its end; -1: none


class Found(NamedTuple):
    """Room for what becomes of a run."""

    said: Any  # by turn what the client says, position and velocity or the force
    known: Any  # by tick position, impulse, and of the tick before damping and force
    seen: Any  # fields of `SEEN`
    true_m: Any  # the true position, by tick [m]


def law_step(state: Any, params: Any, tick: Any) -> float:
    """Stands for the law; `specialise` puts the real one here."""
    raise NotImplementedError


def damping_of(_state: Any) -> float:
    """The damping that a law publishes; `specialise` puts one that reads it here where it does."""
    return 0.0


def published_damping(state: Any) -> float:
    """The same, read."""
    damping: float = state.damping_n_s_per_m
    return damping


def run(device: HeldDevice, law: PortLaw, port: Any, turns: Turns, found: Found) -> None:
    """One run.

    Args:
        device: where it starts.
        law: where it starts.
        port: fields of `PORT`.
        turns: of the client.
        found: what becomes of it is put here.
    """
    plant, plant_params, buffers, hand_n = device
    law_state, law_params, tick = law
    at_s, sees, until, takes = turns
    said, known, seen, true_m = found
    period_s = port.period_s
    decay = exp(-HASTE_PER_S * period_s)
    keep = decay * decay
    lost = (1.0 - decay) * (1.0 - decay)
    gain_m_per_s = HASTE_PER_S * port.most_m_per_s * period_s
    ramp = period_s / port.ramp_s if period_s < port.ramp_s else 1.0
    come = period_s / port.come_in_s if period_s < port.come_in_s else 1.0
    ramp_n = port.most_n * period_s / BLEND_S
    force_n = own_n = damping = 0.0
    asleep, held, in_contact = True, False, False
    weight = age_s = outside_s = impulse_n_s = left_s = 0.0
    come_share = 1.0
    at_m = speed_m_per_s = goal_m = goal_m_per_s = ahead_s = 0.0
    goal_n = now_n = 0.0
    body_m = body_m_per_s = before_n_s = mean_n = 0.0
    last_saw = -1
    before_s = port.first_s
    x_m = last_m = plant.measured_m
    last_true_m = 0.0
    turn = 0
    for count in range(len(hand_n)):
        # device
        plant_params.hand_n = hand_n[count]
        move_device(plant, plant_params, buffers, force_n)
        sense_device(plant, plant_params)
        x_m = plant.measured_m
        if not -FARTHEST_M < x_m < FARTHEST_M:
            seen.diverged = True
            return
        velocity_m_per_s = (x_m - last_m) / period_s
        way_m = x_m - last_m
        last_m = x_m

        # port
        before_n = force_n
        force_n = 0.0
        if not asleep:
            tick.dt_s = period_s
            if not held and weight == 0.0:
                outside_s = outside_s + period_s if not in_contact else 0.0
                in_contact = False
                contact_n = 0.0
                tick.x_m, tick.moved_m, tick.velocity_m_per_s = LEAST_M, 0.0, 0.0
                tick.spring_n = tick.contact_n = 0.0
            else:
                begins = not in_contact
                in_contact = True
                if begins:
                    way_m = 0.0
                    now_n = 0.0
                    come_share, left_s = come, port.come_in_s
                    at_m = x_m
                    share = 1.0
                    if abs(velocity_m_per_s) > port.most_m_per_s:
                        share = port.most_m_per_s / abs(velocity_m_per_s)
                    speed_m_per_s = share * velocity_m_per_s
                if port.spring:
                    if not begins:
                        on_s = min(period_s, port.hold_s - ahead_s)
                        ahead_s += on_s
                        said_m_per_s = on_s / period_s * goal_m_per_s
                        off_m = at_m - goal_m
                        goal_m += said_m_per_s * period_s
                        wanted = said_m_per_s + keep * (speed_m_per_s - said_m_per_s) - lost * off_m / period_s
                        change = wanted - speed_m_per_s
                        if change * change > gain_m_per_s * gain_m_per_s:
                            wanted = speed_m_per_s + gain_m_per_s / sqrt(change * change) * change
                        share = 1.0
                        if abs(wanted) > port.most_m_per_s:
                            share = port.most_m_per_s / abs(wanted)
                        speed_m_per_s = share * wanted
                        at_m += speed_m_per_s * period_s
                    stretch_m = x_m - at_m
                    speed = velocity_m_per_s - speed_m_per_s
                    length_m, pace = abs(stretch_m), abs(speed)
                    k, b = come_share * port.stiffness_n_per_m, 0.0
                    if length_m > LEAST_M:
                        k = come_share * min(port.stiffness_n_per_m * length_m, port.most_n) / length_m
                    if pace > 0.0:
                        b = come_share * min(port.damping_n_s_per_m * pace, port.most_n) / pace
                    if -LEAST_M < stretch_m < LEAST_M:
                        stretch_m = -LEAST_M
                    tick.x_m = stretch_m
                    tick.spring_n = -k * stretch_m
                    contact_n = -k * stretch_m - b * speed
                else:
                    more_n = goal_n - now_n
                    length_n = abs(more_n)
                    now_n += (ramp_n / length_n if length_n > ramp_n else 1.0) * more_n
                    contact_n = now_n
                    tick.x_m, tick.spring_n = -LEAST_M, 0.0
                tick.moved_m, tick.velocity_m_per_s = way_m, velocity_m_per_s
                tick.contact_n = contact_n
            tick.in_contact = in_contact
            impulse_n_s += own_n * period_s
            age_s += period_s
            if held and age_s > port.hold_s:
                held = False
            if held:
                weight = min(1.0, weight + ramp)
            elif weight > 0.0:
                weight = weight - ramp if weight > ramp else 0.0
            come_share = min(1.0, come_share + (min(come, ramp) if left_s > 0.0 else ramp))
            left_s -= period_s

            # law, limit
            asked_n = law_step(law_state, law_params, tick)
            damping = damping_of(law_state)
            if not in_contact:
                asked_n = 0.0
            scale = weight
            if asked_n * asked_n > port.most_n * port.most_n:
                scale *= STRICTLY * port.most_n / sqrt(asked_n * asked_n)
            force_n = asked_n * scale
            tick.applied_n = force_n
            tick.applied_contact_n = own_n = scale * contact_n
            if weight == 0.0 and not held and not in_contact and (port.rests or outside_s > OUTSIDE_S):
                asleep = True
                outside_s = own_n = 0.0
                tick.applied_n = tick.applied_contact_n = 0.0

        # what it comes to
        seen.peak_n = max(seen.peak_n, abs(force_n))
        seen.step_n = max(seen.step_n, abs(force_n - before_n))
        true_m[count] = plant.x_m
        known[count, 0], known[count, 1] = x_m, impulse_n_s
        if port.judged_from <= count < port.judged_to:
            moved_m = plant.x_m - last_true_m
            seen.drag_j += known[count, 2] * moved_m * moved_m / period_s
            seen.given_j += known[count, 3] * moved_m
            seen.motion += moved_m * moved_m / period_s
        last_true_m = plant.x_m
        if count + 1 < len(hand_n):
            known[count + 1, 2], known[count + 1, 3] = damping, own_n

        # client
        while turn < until[count]:
            passed_s = at_s[turn] - before_s
            before_s = at_s[turn]
            device_m, device_n_s = known[sees[turn], 0], known[sees[turn], 1]
            if port.spring:
                span_s = (sees[turn] - last_saw) * period_s
                last_saw = sees[turn]
                if span_s > 0.0:
                    mean_n = (device_n_s - before_n_s) / span_s
                    before_n_s = device_n_s
                steps = max(1, round(passed_s / STEP_S))
                step_s = passed_s / steps
                for _ in range(steps):
                    push_n = -mean_n
                    if body_m < 0.0:
                        push_n -= port.table_n_per_m * body_m + port.table_n_s_per_m * body_m_per_s
                    body_m_per_s += push_n / port.tool_kg * step_s
                    body_m += body_m_per_s * step_s
                said[turn, 0], said[turn, 1] = body_m, body_m_per_s
            else:
                said[turn, 0] = port.stiffness_n_per_m * max(0.0, -device_m)
            turn += 1
        if takes[count] >= 0:
            age_s = 0.0
            held = True
            asleep = False
            if port.spring:
                goal_m = said[takes[count], 0]
                goal_m_per_s = said[takes[count], 1]
                if abs(goal_m_per_s) > port.most_m_per_s:
                    goal_m_per_s *= port.most_m_per_s / abs(goal_m_per_s)
                ahead_s = 0.0
            else:
                goal_n = min(said[takes[count], 0], port.most_n)

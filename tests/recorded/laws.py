"""Every law in every one of its modes, where a hand presses a light device into a stiff wall."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from functools import partial
from typing import Literal, get_args, get_origin

from pydantic import ValidationError

from hapticd import plugins
from hapticd.config.loading import parse
from hapticd.device import Sample
from hapticd.tick.assemble import make_tick
from tests.recorded.hand import Hand
from tests.recorded.journal import Journal
from tests.tick.rig import device

TICKS = 600
STOPPED, GOES_ON = 380, 440
"""In between it is disarmed; then the law begins anew."""
PERIOD_S = 1e-3
MASS_KG, VISCOUS_N_S_PER_M, HAND_N_PER_M = 0.08, 0.5, 300.0
SCENE = "[[scene.walls]]\nstiffness_n_per_m = 3000.0\n[velocity]\nsamples = 2\n"
TOGETHER = {
    "energy-cycle": [
        'work = "total"\npairing = "new-force"\nrule = "signed"\ncap = "fixed"\ncap_damping_n_s_per_m = 1.0\n',
        'work = "total"\npairing = "power"\nrule = "signed"\ncap = "fixed"\n',
        "small_travel_counts = 9000.0\nsmall_leaks = 0.5\n",
        "min_travel_counts = 2000.0\n",
        "window_future = 1\n",
    ],
}
"""Modes that show only beside others."""


def press(law: str, keys: str) -> Journal:
    """A hand that goes to and fro across the wall, by a spring: what the device feels, and what is booked."""
    journal = Journal()
    loaded = parse(f'{SCENE}[controller]\nlaw = "{law}"\n[controller.params]\n{keys}', "recorded")
    tick = make_tick(loaded, device(has_clock=True, resolution_m=1e-6))
    sample = Sample(1)
    hand = Hand(3, 1, 0.008, (-0.001,))
    at_m, speed_m_per_s = 0.01, 0.0
    sample.position_m[0] = at_m
    tick.start(sample)
    tick.arm()
    for journal.tick in range(TICKS):
        if journal.tick == STOPPED:
            tick.release()
        if journal.tick == GOES_ON:
            tick.arm()
        sample.position_m[0] = round(at_m * 1e6) * 1e-6
        sample.time_ns += 1_000_000 + 20_000 * (journal.tick % 3)
        (force_n,) = tick.advance(sample, PERIOD_S)
        (aim_m,) = hand.go()
        pull_n = HAND_N_PER_M * (aim_m - at_m) - VISCOUS_N_S_PER_M * speed_m_per_s
        speed_m_per_s += PERIOD_S * (force_n + pull_n) / MASS_KG
        at_m += PERIOD_S * speed_m_per_s
        contact, ledger = tick.contacts[0], tick.contacts[0].ledger
        journal.note("force_n", force_n)
        journal.note("damping", contact.damping_n_s_per_m)
        journal.note("felt mass", contact.felt_mass_kg)
        journal.note("cycle", [ledger.cycle, ledger.cycle_damping_n_s_per_m, ledger.cycle_energy_j])
        journal.note("books", [ledger.energy_j, ledger.stored_j, ledger.dissipated_j, ledger.generated_j])
    journal.say(f"at {1e3 * at_m:.6f} mm")
    return journal


def modes(law: str) -> list[str]:
    """The defaults, each choice that they are not, and each number halved, or three more of a count."""
    found = ["", *TOGETHER.get(law, [])]
    for name, field in plugins.law(law).Params.model_fields.items():
        if get_origin(field.annotation) is Literal:
            found += [f'{name} = "{each}"\n' for each in get_args(field.annotation) if each != field.default]
        elif field.annotation is bool:
            found.append(f"{name} = {str(not field.default).lower()}\n")
        else:
            other = field.default + 3 if isinstance(field.default, int) else 0.5 * field.default
            with contextlib.suppress(ValidationError):
                plugins.law(law).Params.model_validate({name: other})
                found.append(f"{name} = {other!r}\n")
    return found


def named(mode: str) -> str:
    """Some keys as a part of a name."""
    return re.sub(r'[ ="\n]+', " ", mode).strip()


PRESSES: dict[str, Callable[[], Journal]] = {
    f"{law} {named(mode)}".strip(): partial(press, law, mode)
    for law in sorted(plugins.names(plugins.CONTROLLERS))
    for mode in modes(law)
}

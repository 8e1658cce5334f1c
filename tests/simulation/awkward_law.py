"""A law that does what no other does: it pushes outside the wall, and at last asks for and publishes anything."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from hapticd.law import LawParams


class Params(LawParams):
    """What it asks for and publishes, and from when on."""

    share: float = Field(1.0, description="of the contact's force")
    push_n: float = Field(0.0, description="added to it, outside as well [N]")
    at: int = Field(1000000, description="sample from which on it is the three below")
    then_n: float = Field(0.0, description="force [N]")
    then_damping_n_s_per_m: float = Field(0.0, description="published [N s/m]")
    then_mass_kg: float = Field(0.0, description="published [kg]")


class State:
    """What it publishes, and how often it was asked."""

    samples: int
    damping_n_s_per_m: float
    felt_mass_kg: float


def start(state: Any, params: Any, snapshot: Any) -> None:
    """Ask for nothing yet."""
    state.samples = 0


def step(state: Any, params: Any, tick: Any) -> float:
    """A share of the contact's force, and a push."""
    state.samples += 1
    if state.samples >= params.at:
        state.damping_n_s_per_m = params.then_damping_n_s_per_m
        state.felt_mass_kg = params.then_mass_kg
        then_n: float = params.then_n
        return then_n
    state.damping_n_s_per_m = 0.25 * state.samples
    state.felt_mass_kg = 0.5 * state.samples
    force_n: float = params.share * tick.contact_n + params.push_n
    return force_n

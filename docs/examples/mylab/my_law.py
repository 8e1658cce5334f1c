"""More damping on the way out than on the way in."""

from hapticd.law import Field, LawParams, LawSnapshot, LawTick


class Params(LawParams):
    """The keys of [controller.params]."""

    damping_n_s_per_m: float = Field(5.0, ge=0.0, le=100.0, description="on the way in [N s/m]")
    outward: float = Field(2.0, ge=0.0, le=10.0, description="times as much on the way out")


class State:
    """What the law remembers of one wall: float, int and bool only."""

    damping_n_s_per_m: float  # a field of this name is published in hapticd/damping


def start(state: State, params: Params, snapshot: LawSnapshot) -> None:
    """Take over from another law."""
    state.damping_n_s_per_m = params.damping_n_s_per_m


def step(state: State, params: Params, tick: LawTick) -> float:
    """The wall's own force less damping.  -> force on the device, positive pushes out [N]."""
    state.damping_n_s_per_m = params.damping_n_s_per_m
    if tick.velocity_m_per_s > 0.0:
        state.damping_n_s_per_m = params.damping_n_s_per_m * params.outward
    return tick.contact_n - state.damping_n_s_per_m * tick.velocity_m_per_s

"""The devices by the type that the SDK reports, each with limits of its own.

Where the figures are from: forces and damping are the control limits of CHAI3D (`CDeltaDevices.cpp`), which it gives
for omega.3/6/7, delta.3, sigma.7 and the Novint Falcon, which the SDK drives as well; workspaces and resolutions are
data-sheet figures as they are quoted, and so are lambda.7 and the number of buttons: UNVERIFIED. Where two figures are
known for a force the smaller one stands (sigma.7: 12 N of CHAI3D, not 20 N). No figure has been tried on hardware. The
moving masses are not published: the omega7 model's 0.25 kg stands for all, which is on the light and so on the safe
side of the heavier arms.
"""

from __future__ import annotations

from dataclasses import dataclass

NOMINAL_RATE_HZ = 4000.0
"""What the maker names as the fastest loop over USB; UNVERIFIED, as is what a host reaches."""

_MOVING_KG = 0.25


@dataclass(frozen=True, slots=True)
class Model:
    """A kind of device.

    Attributes:
        name: what it is called.
        max_force_n: largest force at the hand [N].
        workspace_m: extent along x, y and z, centred [m].
        resolution_m: smallest step that the position shows [m].
        wrist: whether it senses orientation.
        gripper: whether it has one.
        buttons: buttons of its own.
        damping_n_s_per_m: most digital damping that it bears [N s/m].
        to_calibrate: whether it takes no force until the SDK has calibrated it.
    """

    name: str
    max_force_n: float
    workspace_m: tuple[float, float, float]
    resolution_m: float
    wrist: bool = False
    gripper: bool = False
    buttons: int = 0
    damping_n_s_per_m: float = 30.0
    to_calibrate: bool = True

    @property
    def spans_m(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest position of each axis [m]."""
        return tuple((-0.5 * size, 0.5 * size) for size in self.workspace_m)

    def safe_damping_n_s_per_m(self, period_s: float) -> float:
        """Digital damping for the fallback: CHAI3D's limit, or less where a slow loop would not hold that.

        A damper on the difference of two samples, acting one sample late, is stable below 0.83 m / T with m the mass.

        Args:
            period_s: time between ticks [s].
        """
        return min(self.damping_n_s_per_m, 0.2 * _MOVING_KG / period_s)


_OMEGA_M = (0.11, 0.16, 0.16)
_OMEGA3 = Model("omega.3", 12.0, _OMEGA_M, 1e-5, buttons=1)
_OMEGA6 = Model("omega.6", 12.0, _OMEGA_M, 1e-5, wrist=True, buttons=1)
_OMEGA7 = Model("omega.7", 12.0, _OMEGA_M, 1e-5, wrist=True, gripper=True)
_DELTA3 = Model("delta.3", 20.0, (0.26, 0.40, 0.40), 2e-5, buttons=1)
_SIGMA7 = Model("sigma.7", 12.0, (0.13, 0.19, 0.19), 1.5e-6, wrist=True, gripper=True)
_LAMBDA7 = Model("lambda.7", 12.0, (0.17, 0.24, 0.24), 1.5e-6, wrist=True, gripper=True)
_FALCON = Model("Novint Falcon", 8.0, (0.1, 0.1, 0.1), 6e-5, buttons=4, damping_n_s_per_m=20.0, to_calibrate=False)

MODELS: dict[int, Model] = {
    33: _OMEGA3,
    34: _OMEGA6,
    36: _OMEGA6,
    35: _OMEGA7,
    37: _OMEGA7,
    60: _FALCON,
    63: _DELTA3,
    104: _SIGMA7,
    105: _SIGMA7,
    108: _LAMBDA7,
    109: _LAMBDA7,
}
"""Model by the number of `dhdGetSystemType`; left- and right-handed devices have numbers of their own."""

_UNKNOWN_M = (0.5, 0.5, 0.5)
"""Workspace of a device of which nothing is known: a position outside of it is none."""


def unknown(name: str, max_force_n: float, wrist: bool, gripper: bool) -> Model:
    """A device that is not in the table, of which there are many: special ones, and those that are newer than this.

    Args:
        name: what the SDK calls it.
        max_force_n: what the configuration says that it bears [N].
        wrist: whether the SDK says that it senses orientation.
        gripper: whether the SDK says that it has one.
    """
    return Model(name, max_force_n, _UNKNOWN_M, 1e-5, wrist, gripper)

"""The two parameters that span a map: what can be varied, over which range, and how a value is put into a scenario."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Any

from hapticd.config.problems import nearest
from hapticd.errors import ConfigError
from hapticd.simulation.options import ConstantForce
from hapticd_studies.zwidth.scenario import PressScenario


@dataclass(frozen=True, slots=True)
class Quantity:
    """A parameter that a map may be drawn over.

    Attributes:
        name: on the command line.
        key: in the configuration.
        unit: of its values.
        label: of an axis.
        shown_unit, shown_scale: where an axis has a better unit: shown value = value * shown_scale.
        low, high: allowed values; `low` itself only where `positive` is false.
        positive: whether it must be more than `low`.
        whole: whether only whole numbers make sense.
    """

    name: str
    key: str
    unit: str
    label: str
    shown_unit: str = ""
    shown_scale: float = 1.0
    low: float = 0.0
    high: float = 1e6
    positive: bool = False
    whole: bool = False

    @property
    def axis_label(self) -> str:
        """Name and unit as they stand at an axis."""
        return f"{self.label} [{self.shown_unit or self.unit}]"

    @property
    def column(self) -> str:
        """Name in a table."""
        table, _, field = self.key.rpartition(".")
        return {"force": "hand_force_n"}.get(field, f"hand_{field}" if table.endswith(".hand") else field)

    def put(self, scenario: PressScenario, value: float) -> PressScenario:
        """The scenario with another value."""
        return _put(scenario, self.key, value)

    def check(self, value: float, given: str) -> None:
        """Refuse a value that the model does not allow.

        Raises:
            ConfigError: names what was given.
        """
        if not math.isfinite(value) or value > self.high or value < self.low or (self.positive and value == self.low):
            least = f"more than {self.low:g} and at most" if self.positive else f"from {self.low:g} to"
            raise ConfigError(f"{given}: {self.name} must be {least} {self.high:g} {self.unit}")
        if self.whole and value != round(value):
            raise ConfigError(f"{given}: {self.name} must be a whole number")


@dataclass(frozen=True, slots=True)
class MapAxis:
    """One axis of a map.

    Attributes:
        quantity: what varies.
        values: in ascending order.
        logarithmic: whether they are evenly spaced in the logarithm.
    """

    quantity: Quantity
    values: tuple[float, ...]
    logarithmic: bool

    def between(self, low: float, high: float) -> float:
        """The middle of two values, as the axis is spaced."""
        return math.sqrt(low * high) if self.logarithmic else 0.5 * (low + high)

    def declared(self) -> dict[str, Any]:
        """The axis for a file of results."""
        return {
            "name": self.quantity.name,
            "key": self.quantity.key,
            "unit": self.quantity.unit,
            "logarithmic": self.logarithmic,
            "values": self.values,
        }


def parse_axis(text: str, cells: int, option: str) -> MapAxis:
    """Read `stiffness=1e3..40e3` or `mass=0.03..3:log`.

    Args:
        text: what was given.
        cells: how many values.
        option: `--x`, for errors.

    Raises:
        ConfigError: it cannot be used.
    """
    found = re.fullmatch(r"([a-z-]+)=([^.:]+(?:\.\d[^.:]*)?|\.\d[^.:]*)\.\.([^:]+?)(:log)?", text.strip())
    try:
        if found is None:
            raise ValueError
        low, high = float(found[2]), float(found[3])
    except ValueError:
        raise ConfigError(
            f"{option} {text}: must be NAME=LOW..HIGH or NAME=LOW..HIGH:log, as stiffness=1e3..40e3"
        ) from None
    quantity = named(found[1], option)
    for value in (low, high):
        quantity.check(value, f"{option} {text}")
    logarithmic = found[4] is not None
    if not low < high:
        raise ConfigError(f"{option} {text}: LOW must be less than HIGH")
    if logarithmic and low <= 0.0:
        raise ConfigError(f"{option} {text}: a logarithmic range must begin above 0")
    return MapAxis(quantity, spaced(low, high, cells, logarithmic, quantity.whole), logarithmic)


def axis_of(declared: dict[str, Any]) -> MapAxis:
    """The axis that `declared` described."""
    return MapAxis(named(declared["name"], "axis"), tuple(declared["values"]), declared["logarithmic"])


def named(name: str, option: str) -> Quantity:
    """The quantity of a name.

    Raises:
        ConfigError: there is none.
    """
    if name not in QUANTITIES:
        raise ConfigError(f"{option} {name}: no such parameter; {nearest(name, list(QUANTITIES))}")
    return QUANTITIES[name]


def spaced(low: float, high: float, count: int, logarithmic: bool, whole: bool) -> tuple[float, ...]:
    """Values from one end to the other, ends included; of whole numbers each only once."""
    steps = max(1, count - 1)
    if logarithmic:
        values = [low * (high / low) ** (at / steps) for at in range(count)]
    else:
        values = [low + (high - low) * at / steps for at in range(count)]
    values[-1] = high
    return tuple(sorted({float(round(value)) for value in values})) if whole else tuple(values)


def _put(scenario: PressScenario, key: str, value: float) -> PressScenario:
    table, _, field = key.rpartition(".")
    device = scenario.device
    if key == "loop.rate_hz":
        return replace(scenario, period_s=round(1e9 / value) * 1e-9)  # as the daemon rounds it
    if table == "scene.walls[0]":
        return replace(scenario, wall=scenario.wall.model_copy(update={field: value}))
    if field == "force":
        hand = device.hand.model_copy(update={"force": ConstantForce(newton=-value)})
        return replace(scenario, device=device.model_copy(update={"hand": hand}))
    if table.endswith(".hand"):
        hand = device.hand.model_copy(update={field: value})
        return replace(scenario, device=device.model_copy(update={"hand": hand}))
    exact = int(value) if field == "force_delay_samples" else value
    limit_n = value if field == "max_force_n" else scenario.max_force_n
    return replace(scenario, device=device.model_copy(update={field: exact}), max_force_n=limit_n)


_WALL = "scene.walls[0]"
_DEVICE = "device.options"
_HAND = "device.options.hand"
_ALL = (
    Quantity("stiffness", f"{_WALL}.stiffness_n_per_m", "N/m", "Wall stiffness", "kN/m", 1e-3, 0.0, 1e9, True),
    Quantity("damping", f"{_WALL}.damping_n_s_per_m", "N s/m", "Wall damping", low=-1e6),
    Quantity("rate", "loop.rate_hz", "Hz", "Loop rate", "kHz", 1e-3, 10.0),
    Quantity("mass", f"{_DEVICE}.mass_kg", "kg", "Device mass", positive=True),
    Quantity("viscous", f"{_DEVICE}.viscous_n_s_per_m", "N s/m", "Device viscous friction", low=-1e6),
    Quantity("friction", f"{_DEVICE}.coulomb_n", "N", "Device Coulomb friction"),
    Quantity("quantisation", f"{_DEVICE}.resolution_m", "m", "Position step", "µm", 1e6, 0.0, 1.0),
    Quantity("noise", f"{_DEVICE}.noise_m", "m", "Sensor noise, standard deviation", "µm", 1e6, 0.0, 1.0),
    Quantity("delay", f"{_DEVICE}.force_delay_samples", "samples", "Force delay", high=64.0, whole=True),
    Quantity("force-limit", f"{_DEVICE}.max_force_n", "N", "Largest force", positive=True),
    Quantity("drop", f"{_DEVICE}.initial_position_m", "m", "Dropped from", "mm", 1e3, 0.0, 1e3),
    Quantity("hand-force", f"{_HAND}.force", "N", "Hand force", positive=True),
    Quantity("hand-mass", f"{_HAND}.mass_kg", "kg", "Hand mass"),
    Quantity("hand-damping", f"{_HAND}.damping_n_s_per_m", "N s/m", "Hand damping"),
    Quantity("hand-stiffness", f"{_HAND}.stiffness_n_per_m", "N/m", "Hand stiffness", high=1e9),
)

QUANTITIES: dict[str, Quantity] = {quantity.name: quantity for quantity in _ALL}
"""What a map may be drawn over, by name."""

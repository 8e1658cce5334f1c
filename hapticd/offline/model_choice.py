"""`accuracy`: the cheapest device model that errs by no more than a configuration allows.

Every candidate is rehearsed in the configuration's own loop, against the full model stepped exactly, and the cheapest
that stays within the errors is taken. Costs are counted instructions and not times, so that the same file always gets
the same model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Any, Literal, cast

from hapticd.config.loading import LoadedConfig
from hapticd.offline.operations import count_operations
from hapticd.offline.rehearsal import rehearse
from hapticd.simulation.device import SimulatedDevice
from hapticd.simulation.options import Accuracy, Change, SimulationOptions
from hapticd.simulation.plant import METHODS, terms

COUNTED_TICKS = 25
"""How many ticks, spread over the run, the cost of a candidate is counted in."""

Integrator = Literal["exact", "explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4"]


@dataclass(frozen=True, slots=True)
class Fit:
    """The model that was chosen.

    Attributes:
        options: the device's options with that model; `accuracy` stays in them.
        omitted: keys of the terms that it leaves out.
        position_error_m, energy_error_j: what it errs by [m], [J].
        over_s: from the first tick [s].
        operations, full_operations: instructions of the interpreter a period, of it and of the full model.
        rehearsed: models that were run to find it, the full one included.
        hash: of the configuration that it was chosen for.
    """

    options: SimulationOptions
    omitted: tuple[str, ...]
    position_error_m: float
    energy_error_j: float
    over_s: float
    operations: float
    full_operations: float
    rehearsed: int
    hash: str

    @property
    def reason(self) -> str:
        """Why this model, in a line."""
        what = f"{self.options.integrator} step" + (f" without {', '.join(self.omitted)}" if self.omitted else "")
        if not self.omitted and self.options.integrator == "exact":
            tried = self.rehearsed - 1
            kept = f"none of {tried} cheaper ones keeps the errors asked for" if tried else "nothing else costs less"
            return f"{what} of every term: {kept}"
        return (
            f"{what}: errs by {self.position_error_m:.2g} m and {self.energy_error_j:.2g} J over {self.over_s:g} s, "
            f"{self.operations:.0f} instead of {self.full_operations:.0f} operations a period"
        )


def fit(loaded: LoadedConfig) -> Fit | None:
    """The model that a configuration gets; None when it asks for no accuracy.

    The terms that may be left out are those that take instructions and that alone stay within the errors; what the
    device declares to controllers, its force limit and resolution, always stays.
    """
    options = loaded.options
    if not isinstance(options, SimulationOptions) or options.accuracy is None:
        return None
    return _Fitting(loaded, options, options.accuracy).best()


def fitted(loaded: LoadedConfig) -> LoadedConfig:
    """The configuration with the model that it asks for."""
    found = fit(loaded)
    return loaded if found is None else replace(loaded, options=found.options)


def operations(options: SimulationOptions, period_s: float, force_n: Sequence[float]) -> float:
    """Instructions that one period of a device takes, as a mean over some periods under these commands."""
    device = SimulatedDevice(options, period_s)
    every = max(1, len(force_n) // COUNTED_TICKS)
    counts = []
    for at, command_n in enumerate(force_n):
        if at % every:
            device.advance(command_n)
        else:
            counts.append(count_operations(partial(device.advance, command_n)))
        if not -1e6 < device.x_m < 1e6:
            break
    return sum(counts) / max(1, len(counts))


class _Fitting:
    """The search for one configuration."""

    def __init__(self, loaded: LoadedConfig, options: SimulationOptions, accuracy: Accuracy) -> None:
        self._loaded = loaded
        self._options = options
        self._accuracy = accuracy
        self._period_s = loaded.config.loop.period_s
        self._exact = rehearse(loaded, accuracy.over_s, options)
        self._force_n = self._exact.columns["force_n"]
        self._full_operations = operations(options, self._period_s, self._force_n)
        self._tried: dict[tuple[str, tuple[str, ...]], tuple[float, float]] = {("exact", ()): (0.0, 0.0)}

    def best(self) -> Fit:
        """The cheapest model that keeps the errors; the full one always does."""
        kept = [one for one in omissions(self._options) if not one.declared and self._takes_instructions(one)]
        kept = [one for one in kept if self._keeps("exact", (one,))]
        for cost, method, left_out in self._candidates(kept):
            if self._keeps(method, left_out):
                return self._fit(cost, method, left_out)
        raise AssertionError("the full model has no error")

    def _candidates(self, leavable: Sequence[Omission]) -> list[tuple[float, Integrator, tuple[Omission, ...]]]:
        """The full model and all that cost less, cheapest first."""
        found: list[tuple[float, Integrator, tuple[Omission, ...]]] = [(self._full_operations, "exact", ())]
        for method in cast("tuple[Integrator, ...]", METHODS):
            if method != "exact" and all(
                self._cost(method, terms_out) >= self._cost("exact", terms_out) for terms_out in ((), leavable)
            ):
                continue
            for count in range(len(leavable) + 1):
                for left_out in combinations(leavable, count):
                    cost = self._cost(method, left_out)
                    if cost < self._full_operations:
                        found.append((cost, method, left_out))
        return sorted(found, key=lambda one: (one[0], METHODS.index(one[1]), len(one[2])))

    def _cost(self, method: Integrator, left_out: Sequence[Omission]) -> float:
        return operations(self._model(method, left_out), self._period_s, self._force_n)

    def _takes_instructions(self, term: Omission) -> bool:
        """Whether the step is another one without it; mass and damping only change its coefficients."""
        return terms(term.apply(self._options)) != terms(self._options)

    def _model(self, method: Integrator, left_out: Sequence[Omission]) -> SimulationOptions:
        return without(self._options, left_out).model_copy(update={"integrator": method})

    def _errors(self, method: Integrator, left_out: Sequence[Omission]) -> tuple[float, float]:
        key = (method, tuple(one.key for one in left_out))
        if key not in self._tried:
            found = rehearse(self._loaded, self._accuracy.over_s, self._model(method, left_out))
            self._tried[key] = found.position_error_m(self._exact), found.energy_error_j(self._exact)
        return self._tried[key]

    def _keeps(self, method: Integrator, left_out: Sequence[Omission]) -> bool:
        position_m, energy_j = self._errors(method, left_out)
        accuracy = self._accuracy
        return (accuracy.position_m is None or position_m <= accuracy.position_m) and (
            accuracy.energy_j is None or energy_j <= accuracy.energy_j
        )

    def _fit(self, cost: float, method: Integrator, left_out: Sequence[Omission]) -> Fit:
        position_m, energy_j = self._errors(method, left_out)
        return Fit(
            options=self._model(method, left_out),
            omitted=tuple(one.key for one in left_out),
            position_error_m=position_m,
            energy_error_j=energy_j,
            over_s=self._exact.ticks * self._period_s,
            operations=cost,
            full_operations=self._full_operations,
            rehearsed=len(self._tried),
            hash=self._loaded.hash,
        )


@dataclass(frozen=True, slots=True)
class Omission:
    """A term of the model that need not be there.

    Attributes:
        name: of the term, for people.
        key: in [device.options]; the value 0 takes the term out.
        usual: a value that it often has.
        declared: whether the device declares it (its force limit, its resolution), so that controllers rely on it.
    """

    name: str
    key: str
    usual: float
    declared: bool = False

    @property
    def change_key(self) -> str:
        """The same quantity in an entry of `changes`."""
        return self.key.replace("hand.", "hand_")

    def present(self, options: SimulationOptions) -> bool:
        """Whether a device has the term, at the start or from some change on."""
        return bool(_value(options, self.key)) or any(
            change.values().get(self.change_key) for change in options.changes
        )

    def apply(self, options: SimulationOptions) -> SimulationOptions:
        """The device without the term, for all time."""
        changes = _changes_without(options.changes, self.change_key)
        return self._put(options, 0.0).model_copy(update={"changes": changes})

    def add(self, options: SimulationOptions) -> SimulationOptions:
        """The device with the term, at its usual value from the start."""
        return self._put(options, self.usual)

    def _put(self, options: SimulationOptions, value: float) -> SimulationOptions:
        if not self.key.startswith("hand."):
            return options.model_copy(update={self.key: type(_value(options, self.key))(value)})
        hand = options.hand.model_copy(update={self.key.removeprefix("hand."): value})
        return options.model_copy(update={"hand": hand})


OMISSIONS = (
    Omission("viscous friction", "viscous_n_s_per_m", 4.0),
    Omission("Coulomb friction", "coulomb_n", 0.1),
    Omission("sensor steps", "resolution_m", 1e-5, declared=True),
    Omission("sensor noise", "noise_m", 1e-6),
    Omission("force limit", "max_force_n", 12.0, declared=True),
    Omission("actuator lag", "bandwidth_hz", 500.0),
    Omission("force delay", "force_delay_samples", 1.0),
    Omission("hand mass", "hand.mass_kg", 0.2),
    Omission("hand damping", "hand.damping_n_s_per_m", 5.0),
    Omission("hand spring", "hand.stiffness_n_per_m", 100.0),
)
"""Every term that a device may have."""


def omissions(options: SimulationOptions) -> list[Omission]:
    """The terms that a device has and that can be taken out."""
    return [one for one in OMISSIONS if one.present(options)]


def without(options: SimulationOptions, terms: Sequence[Omission]) -> SimulationOptions:
    """A device without some terms."""
    for term in terms:
        options = term.apply(options)
    return options


def _value(options: SimulationOptions, key: str) -> Any:
    holder: Any = options
    for name in key.split("."):
        holder = getattr(holder, name)
    return holder


def _changes_without(changes: Sequence[Change], key: str) -> tuple[Change, ...]:
    if not any(key in change.values() for change in changes):
        return tuple(changes)
    kept = [change.model_copy(update={key: None}) for change in changes]
    return tuple(change for change in kept if change.values())

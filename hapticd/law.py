"""What a stabilising law is: one scalar law per contact.

A law is a module with

    Params                          a `LawParams` model: the keys of [controller.params]
    State                           a class whose annotations name scalar fields (float, int, bool)
    start(state, params, snapshot)  activation from the measured state
    step(state, params, tick)       -> force on the device along the wall's normal [N], contact force included

`start` and `step` are arithmetic on floats: + - * /, comparisons, min, max, abs, sqrt. The same source runs
interpreted in the loop and compiled in studies, with equal results to the last bit. `state` and `params` arrive as
plain objects with the declared fields; a `Literal[...]` parameter arrives as the index of the chosen value, since
compiled code knows no strings.

A state that has the fields `damping_n_s_per_m` or `felt_mass_kg` has them published.

A law that learns names what it has learnt, and the next law on that wall, itself when the device is armed again, finds
it in its snapshot: `LEARNED = ("damping_n_s_per_m",)`. What a law does not name is gone with it.

A law that outside the wall keeps no time and learns nothing says so: `RESTS_OUTSIDE = True`. Then it is not asked while
nothing is touched, from the second sample outside on, when it has seen the last force end; what is not touched costs
nothing. A law that counts the time between two touches does not say so, and is asked at every sample.

Signs: x < 0 is inside the wall; a positive force pushes the device out.
"""

from __future__ import annotations

import functools
import inspect
import typing
from types import ModuleType
from typing import Any, Literal

from pydantic import Field

from hapticd.errors import PluginError
from hapticd.settings import Table

__all__ = [
    "Field",
    "LawParams",
    "LawSnapshot",
    "LawTick",
    "Scalar",
    "check_law",
    "fresh_state",
    "learned_fields",
    "plain_object",
    "rests_outside",
    "scalar_params",
    "state_fields",
]

Scalar = float | int | bool


class LawParams(Table):
    """Base of every law's parameters: strict, frozen, finite, no unknown keys."""


def _shown(slotted: Any) -> str:
    """The fields of a slotted object, as the call that makes an equal one."""
    kind = type(slotted)
    return f"{kind.__name__}({', '.join(f'{name}={getattr(slotted, name)!r}' for name in kind.__slots__)})"


class LawTick:
    """What a law sees of one contact at one tick.

    The loop makes one a contact and fills it anew at each tick; a test of a law makes its own:
    `LawTick(x_m=-1e-3, in_contact=True, contact_n=12.0)`.

    Every number is finite and within bounds that the tick keeps, so that a law need not look: |x| and |moved| below
    1e8 m, |velocity| below 1e6 m/s, dt from 1e-9 to 1 s, forces below 1e18 N.

    Attributes:
        x_m: position relative to the wall [m], < 0 inside.
        moved_m: x(n) - x(n-1) [m].
        velocity_m_per_s: estimated velocity along the wall's normal [m/s].
        dt_s: time since the last sample [s].
        in_contact: whether x_m < 0.
        contact_n: the contact's own force now, spring and wall damping [N].
        spring_n: the spring's part of `contact_n` [N].
        applied_n: force of this contact that was applied from the last sample to this one, F(n-1) [N]; the mean of it,
            by the time it was held, where it went on at ticks in between.
        applied_contact_n: the part of `applied_n` that was the contact's own, without the law's damping [N].
        resolution_m: smallest step of the position that the device can report [m]; 0 when continuous.
    """

    __slots__ = (
        "applied_contact_n",
        "applied_n",
        "contact_n",
        "dt_s",
        "in_contact",
        "moved_m",
        "resolution_m",
        "spring_n",
        "velocity_m_per_s",
        "x_m",
    )

    def __init__(
        self,
        resolution_m: float = 0.0,
        *,
        x_m: float = 0.0,
        moved_m: float = 0.0,
        velocity_m_per_s: float = 0.0,
        dt_s: float = 1e-3,
        in_contact: bool = False,
        contact_n: float = 0.0,
        spring_n: float = 0.0,
        applied_n: float = 0.0,
        applied_contact_n: float = 0.0,
    ) -> None:
        self.x_m = x_m
        self.moved_m = moved_m
        self.velocity_m_per_s = velocity_m_per_s
        self.dt_s = dt_s
        self.in_contact = in_contact
        self.contact_n = contact_n
        self.spring_n = spring_n
        self.applied_n = applied_n
        self.applied_contact_n = applied_contact_n
        self.resolution_m = resolution_m

    __repr__ = _shown


class LawSnapshot:
    """What a law starts from when it takes over.

    Attributes:
        x_m: position relative to the wall [m], < 0 inside.
        velocity_m_per_s: estimated velocity along the wall's normal [m/s].
        applied_n: force applied by this contact in the last tick [N].
        debt_j: energy that this contact has generated and not yet dissipated [J], >= 0; a credit is not carried.
        damping_n_s_per_m: damping that the law before has learnt [N s/m]; 0 when it has none, or none that it names
            in `LEARNED`.
    """

    __slots__ = ("applied_n", "damping_n_s_per_m", "debt_j", "velocity_m_per_s", "x_m")

    def __init__(
        self,
        x_m: float = 0.0,
        velocity_m_per_s: float = 0.0,
        applied_n: float = 0.0,
        debt_j: float = 0.0,
        damping_n_s_per_m: float = 0.0,
    ) -> None:
        self.x_m = x_m
        self.velocity_m_per_s = velocity_m_per_s
        self.applied_n = applied_n
        self.debt_j = debt_j
        self.damping_n_s_per_m = damping_n_s_per_m

    __repr__ = _shown


_HANDED_ON = ("damping_n_s_per_m",)


@functools.cache
def state_fields(law: ModuleType) -> dict[str, type[Scalar]]:
    """Names and types of the scalar fields of a law's state, in declaration order.

    Raises:
        PluginError: a field is not declared as float, int or bool.
    """
    fields: dict[str, type[Scalar]] = {}
    try:
        hints = typing.get_type_hints(law.State)
    except BaseException as error:
        raise PluginError(f"law {law.__name__}: the annotations of State make no sense: {error}") from error
    for name, kind in hints.items():
        if kind not in (float, int, bool):
            raise PluginError(f"law {law.__name__}: State.{name} must be float, int or bool, not {kind}")
        fields[name] = kind
    return fields


def learned_fields(law: ModuleType) -> tuple[str, ...]:
    """What a law has learnt and hands on: names of fields of its state that a snapshot has as well.

    Raises:
        PluginError: `LEARNED` names another field, or is no tuple of names.
    """
    learned = getattr(law, "LEARNED", ())
    if not isinstance(learned, tuple):
        raise PluginError(f"law {law.__name__}: LEARNED must be a tuple of names, not {learned!r}")
    for name in learned:
        if name not in _HANDED_ON:
            raise PluginError(f"law {law.__name__}: LEARNED has {name!r}; handed on is {', '.join(_HANDED_ON)}")
        if name not in state_fields(law):
            raise PluginError(f"law {law.__name__}: LEARNED has {name!r}, which State has not")
    return learned


def rests_outside(law: ModuleType) -> bool:
    """Whether a law need not be asked while nothing is touched.

    Raises:
        PluginError: `RESTS_OUTSIDE` is neither True nor False.
    """
    rests = getattr(law, "RESTS_OUTSIDE", False)
    if not isinstance(rests, bool):
        raise PluginError(f"law {law.__name__}: RESTS_OUTSIDE must be True or False, not {rests!r}")
    return rests


def scalar_params(params: LawParams) -> dict[str, Scalar]:
    """A law's parameters as plain scalars: a `Literal` value becomes its index.

    Raises:
        PluginError: a parameter is neither a number, a bool nor a choice of literals.
    """
    scalars: dict[str, Scalar] = {}
    for name, choices in _choices(type(params)).items():
        value = getattr(params, name)
        if choices:
            scalars[name] = choices.index(value)
        elif isinstance(value, bool | int | float):
            scalars[name] = value
        else:
            raise PluginError(f"parameter {name} = {value!r}: a law takes numbers, bools and choices only")
    return scalars


@functools.cache
def _choices(kind: type[LawParams]) -> dict[str, tuple[Any, ...]]:
    """Every parameter with its literals, none for one that is no choice; `check_law` asks before any loop does."""
    annotations = {name: info.annotation for name, info in kind.model_fields.items()}
    return {
        name: typing.get_args(annotation) if typing.get_origin(annotation) is Literal else ()
        for name, annotation in annotations.items()
    }


@functools.cache
def _plain_class(name: str, fields: tuple[str, ...]) -> type[Any]:
    return type(name, (), {"__slots__": fields, "__repr__": _shown})


def plain_object(name: str, fields: dict[str, Scalar]) -> Any:
    """A slotted object with these fields: what a law reads and writes while it runs interpreted."""
    plain = _plain_class(name, tuple(fields))()
    for field, value in fields.items():
        setattr(plain, field, value)
    return plain


def fresh_state(law: ModuleType) -> Any:
    """A slotted state of a law with every field zero."""
    return plain_object(f"{law.__name__}.State", {field: kind(0) for field, kind in state_fields(law).items()})


def check_law(law: ModuleType) -> None:
    """Say what a module lacks to be a law.

    Raises:
        PluginError: a part of the contract is missing or of the wrong kind.
    """
    for part in ("Params", "State", "start", "step"):
        if not hasattr(law, part):
            raise PluginError(f"law {law.__name__}: has no `{part}` (a law needs Params, State, start, step)")
    if not (isinstance(law.Params, type) and issubclass(law.Params, LawParams)):
        raise PluginError(f"law {law.__name__}: Params must derive from hapticd.law.LawParams")
    for part, arguments in (("start", "state, params, snapshot"), ("step", "state, params, tick")):
        try:
            inspect.signature(getattr(law, part)).bind(*arguments.split())
        except TypeError:
            raise PluginError(f"law {law.__name__}: {part} must take ({arguments})") from None
    _choices(law.Params)
    state_fields(law)
    learned_fields(law)
    rests_outside(law)

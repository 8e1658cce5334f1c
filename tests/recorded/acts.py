"""What may be done to a loop between two of its ticks."""

from __future__ import annotations

from typing import Any

from hapticd.tick.event import EventCode
from tests.recorded.loops import Loop
from tests.tick.rig import law, returns


def freeze(loop: Loop) -> None:
    loop.driver.stale = True


def thaw(loop: Loop) -> None:
    loop.driver.stale = False


def reads_take(read_s: float) -> Any:
    return lambda loop: setattr(loop.driver, "read_s", read_s)


def placed_at(value: float) -> Any:
    def act(loop: Loop) -> None:
        loop.driver.moves = False
        loop.driver.sample.position_m[0] = value

    return act


def moving(loop: Loop) -> None:
    loop.driver.moves = True


def calibrated(yes: bool) -> Any:
    return lambda loop: setattr(loop.driver.sample, "calibrated", yes)


def computes(computes_s: float) -> Any:
    return lambda loop: setattr(loop, "computes_s", computes_s)


def asks(do: str, **request: Any) -> Any:
    return lambda loop: loop.ask(do=do, **request)


def switches(text: str, **other: Any) -> Any:
    return lambda loop: loop.switch(text, **other)


def silent(yes: bool) -> Any:
    return lambda loop: setattr(loop, "beats", not yes)


def befalls(what: str, error: Exception) -> Any:
    return lambda loop: loop.driver.befall.__setitem__(what, error)


def fails(code: EventCode) -> Any:
    return lambda loop: loop.tick.fail(code, "a fault")


def with_broken_law(text: str) -> Any:
    """Switch to a law that goes well for ninety ticks of a contact and then raises."""
    calls = []

    def step(_state: Any, _params: Any, tick: Any) -> Any:
        calls.append(tick)
        if len(calls) > 90:
            raise ZeroDivisionError("of its own")
        return returns(0.9 * tick.contact_n)(None, None, None)

    def act(loop: Loop) -> None:
        loop.loop.requests.know("broken", law(step))
        loop.switch(text, law="broken", params={}, keep_law=False)

    return act


def jumping(loop: Loop) -> None:
    """A device that jumps by a millimetre every tick: fast, and nowhere."""
    loop.driver.off_m = 0.004 if loop.driver.off_m == 0.0 else 0.0

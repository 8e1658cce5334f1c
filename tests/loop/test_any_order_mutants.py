"""Every order of a few events, from a device that is armed; and each of these slips in who owns a state shows in one.

The model is that of `test_any_order`. Nothing is left to chance here: a slip is found, at the same place every time.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Sequence
from typing import Any

import pytest

from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DriverError
from hapticd.loop.memory import DISARM, DISARMED, LATCHED, MAY_ARM
from hapticd.loop.requests import RequestHandler
from hapticd.loop.session import Session
from hapticd.tick.guard import Guard, Mode
from hapticd.tick.motion import Motion
from hapticd.tick.tick import ControlTick
from tests.loop.test_any_order import SCENES, AnyOrder

SHOWING = [
    ["disarm", "tick", "lose", "tick"],
    ["fault of the law", "lose", "tick"],
    ["fault of the device", "tick"],
    ["fault of the law", "arm", "tick"],
    ["fault of the law", "switch"],
    ["arm and disarm", "tick"],
    ["disarm", "stand", "arm and disarm", "tick"],
    ["disarm", "stand", "switch"],
    ["disarm", "tick", "disarm", "tick"],
    ["tare", "tick"],
    ["disarm", "stand", "tare", "arm", "lose", "tick"],
    ["disarm", "stand", "arm"],
    ["disarm", "stand", "disarm while it gets ready"],
]
"""Orders that show a state with two owners; each of the slips below shows in at least one of them."""

Slip = Callable[[pytest.MonkeyPatch], None]
SLIPS: dict[str, Slip] = {}


def slip(text: str) -> Callable[[Slip], Slip]:
    def enter(apply: Slip) -> Slip:
        SLIPS[text] = apply
        return apply

    return enter


@slip("what was disarmed is armed again once the device is back")
def _(patch: pytest.MonkeyPatch) -> None:
    leave = Session.leave

    def forgets(self: Session) -> None:
        leave(self)
        self.shared.words[MAY_ARM] = True

    patch.setattr(Session, "leave", forgets)


@slip("a latch ends with the loop that latched")
def _(patch: pytest.MonkeyPatch) -> None:
    leave = Session.leave

    def forgets(self: Session) -> None:
        leave(self)
        self.shared.words[LATCHED] = False

    patch.setattr(Session, "leave", forgets)


@slip("a fault that ends the loop does not latch")
def _(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Session, "latch", lambda self: None)


@slip("arming clears what is latched")
def _(patch: pytest.MonkeyPatch) -> None:
    arm = Session.arm

    def clears(self: Session) -> bool:
        self.tick.guard.clear()
        return arm(self)

    patch.setattr(Session, "arm", clears)


@slip("disarming is acknowledged and not done")
def _(patch: pytest.MonkeyPatch) -> None:
    def only_says_so(self: Session) -> None:
        self.shared.words[DISARMED] = self.shared.words[DISARM]

    patch.setattr(Session, "disarm", only_says_so)


@slip("an arm from before a disarm is done after it")
def _(patch: pytest.MonkeyPatch) -> None:
    work = RequestHandler.work

    def looks_at_no_disarm(self: RequestHandler) -> None:
        shared = self._session.shared
        request = type(shared).request
        with pytest.MonkeyPatch.context() as inner:
            inner.setattr(type(shared), "request", lambda it: {**request(it), "disarm": it.words[DISARM]})
            work(self)

    patch.setattr(RequestHandler, "work", looks_at_no_disarm)


@slip("a switch clears what is latched")
def _(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ControlTick, "switch", _and_then(ControlTick.switch, lambda tick: tick.guard.clear()))


@slip("a switch arms")
def _(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(ControlTick, "switch", _and_then(ControlTick.switch, lambda tick: tick.guard.arm()))


@slip("who disarms again while the force is let out arms")
def _(patch: pytest.MonkeyPatch) -> None:
    def toggles(self: Guard, ramp_s: float, latch: bool = False) -> None:
        if self.mode is Mode.RELEASING and not latch:
            self.arm()
        else:
            release(self, ramp_s, latch)

    release = Guard.release
    patch.setattr(Guard, "release", toggles)


@slip("a tared device arms by itself when it is back")
def _(patch: pytest.MonkeyPatch) -> None:
    leave = Session.leave

    def looks_at_no_origin(self: Session) -> None:
        origin_m, self.tick.motion.origin_m = self.tick.motion.origin_m, [0.0]
        leave(self)
        self.tick.motion.origin_m = origin_m

    patch.setattr(Session, "leave", looks_at_no_origin)


@slip("a tare is done while forces are let through")
def _(patch: pytest.MonkeyPatch) -> None:
    def tare(self: ControlTick) -> bool:
        motion: Motion = self.motion
        self._move_origin([origin + at for origin, at in zip(motion.origin_m, motion.position_m, strict=True)])
        return True

    patch.setattr(ControlTick, "tare", tare)


@slip("a device that refuses is acknowledged as armed")
def _(patch: pytest.MonkeyPatch) -> None:
    def arm(self: Session) -> bool:
        try:
            self.driver.enable()
        except DriverError:
            return True
        return True

    patch.setattr(Session, "arm", arm)


@slip("a device that gets ready is armed though it was disarmed meanwhile")
def _(patch: pytest.MonkeyPatch) -> None:
    disarm = Session.disarm

    def forgets(self: Session) -> None:
        arming = self.arming
        disarm(self)
        self.arming = arming

    patch.setattr(Session, "disarm", forgets)


def _and_then(switch: Callable[..., Generator[None, None, None]], more: Callable[[ControlTick], Any]) -> Any:
    def both(self: ControlTick, *what: Any, **named: Any) -> Generator[None, None, None]:
        yield from switch(self, *what, **named)
        more(self)

    return both


def _answered(model: AnyOrder) -> None:
    for _ in range(40):
        if model.asked is not None:
            model.one_tick()
    assert model.asked is None, "a request has no answer"


def _ask(name: str, *what: Any) -> Callable[[AnyOrder], None]:
    def ask(model: AnyOrder) -> None:
        getattr(model, name)(*what)
        _answered(model)

    return ask


def _switch(model: AnyOrder) -> None:
    model.switch(1 if model.config is SCENES[0] else 0)
    _answered(model)


def _stand(model: AnyOrder) -> None:
    """Until every ramp is over."""
    model.ticks(30)


def _fail(model: AnyOrder) -> None:
    model.law_fails()
    model.one_tick()


def _disarm_while_it_gets_ready(model: AnyOrder) -> None:
    model.device_prepares(20)
    model.arm()
    model.ticks(3)
    model.disarm()
    model.ticks(30)
    model.device_prepares(0)
    _answered(model)


EVENTS: dict[str, Callable[[AnyOrder], None]] = {
    "disarm": lambda model: model.disarm(),
    "lose": lambda model: model.device_is_lost(("read", DeviceDisconnectedError)),
    "stand": _stand,
    "arm": _ask("arm"),
    "arm and disarm": _ask("arm_and_disarm"),
    "disarm while it gets ready": _disarm_while_it_gets_ready,
    "clear": _ask("clear"),
    "tare": _ask("tare"),
    "switch": _switch,
    "tick": lambda model: model.one_tick(),
    "fault of the device": lambda model: model.device_is_lost(("write", DeviceFaultError)),
    "fault of the law": _fail,
}


def happen(events: Sequence[str], auto_arm: bool) -> None:
    """Let events happen to an armed device, and look at what always holds after each.

    Raises:
        AssertionError: something does not hold.
    """
    model = AnyOrder()
    try:
        model.begin(auto_arm)
        if auto_arm:
            model.ticks(3)
        else:
            model.mend_and_arm()
        for name in events:
            EVENTS[name](model)
            model.armed_only_if_it_may_be()
            model.latched_until_cleared()
            model.no_force_is_left_once_a_ramp_is_over()
    finally:
        model.teardown()


@pytest.mark.parametrize("first", EVENTS)
def test_every_order_of_two_events_is_sound(first: str) -> None:
    for second in EVENTS:
        happen([first, second], auto_arm=True)


@pytest.mark.nightly
@pytest.mark.parametrize("auto_arm", [True, False])
@pytest.mark.parametrize("first", EVENTS)
def test_every_order_of_three_events_is_sound(first: str, auto_arm: bool) -> None:
    for others in itertools.product(EVENTS, repeat=2):
        happen([first, *others], auto_arm)


@pytest.mark.parametrize("text", SLIPS)
def test_every_slip_shows_in_one_of_these_orders(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    SLIPS[text](monkeypatch)
    assert any(shows(events) for events in SHOWING)


def shows(events: Sequence[str]) -> bool:
    """Whether something does not hold in this order of events."""
    try:
        happen(events, auto_arm=True)
    except AssertionError:
        return True
    return False

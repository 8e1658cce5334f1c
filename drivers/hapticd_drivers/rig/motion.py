"""What a rig does when it is calibrated: a check that its motor pushes the right way, and a drive to its home.

Every force is within the bound that is given, and ends when the handle has moved far enough, when it moves too fast or
when it takes too long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from hapticd.errors import DeviceFaultError

NUDGE_M = 0.5e-3
NUDGE_COUNTS = 8
"""The sign of a force is seen once the handle has moved so far; then the force ends [m]."""

NUDGE_RAMP_S = 0.25
NUDGE_HOLD_S = 0.25
"""A nudge rises to its force for so long, and holds it for so long if nothing moves [s]."""

REST_S = 0.1
REST_TIMEOUT_S = 3.0
"""The handle is at rest when it has not moved for so long, which is waited for so long [s]."""

LAG_M = 2e-3
"""A spring pulls the handle along; it pulls with the whole force when the handle lags so far behind [m]."""

STALL_S = 0.3
"""The handle is at an end when it has not got any further for so long [s]."""

BACK_OFF_M = 5e-3
AGREE_M = 0.3e-3
AGREE_COUNTS = 4
"""An end or a switch is found twice, from so far away, and has to be at the same place within this [m]."""

FAST = 8.0
"""A drive ends when the handle moves so many times as fast as it should."""


class Moment(NamedTuple):
    """Where an axis is.

    Attributes:
        time_s: on the device's clock [s].
        position_m: [m].
        counts: the same as the rig counts it.
        switch: the home switch is closed.
    """

    time_s: float
    position_m: float
    counts: int
    switch: bool


class Mover(Protocol):
    """Pushes an axis and sees where it is."""

    def push(self, axis: int, force_n: float) -> Moment:
        """Set the force on one axis, none on the others, and say where it is about a tick later."""


@dataclass(frozen=True, slots=True)
class Drive:
    """How an axis may be moved.

    Attributes:
        mover: moves it.
        axis: its index.
        name: what it is called.
        force_n: largest force [N].
        speed_m_per_s: how fast it is driven [m/s].
        damping_n_s_per_m: damping of the drive [N s/m].
        count_m: size of a count [m].
        span_m: length of the travel [m].
    """

    mover: Mover
    axis: int
    name: str
    force_n: float
    speed_m_per_s: float
    damping_n_s_per_m: float
    count_m: float
    span_m: float

    def push(self, force_n: float) -> Moment:
        """Push, within the bound."""
        return self.mover.push(self.axis, max(-self.force_n, min(self.force_n, force_n)))


def check_sign(drive: Drive) -> None:
    """Nudge the handle both ways and see whether it moves with the force.

    Raises:
        DeviceFaultError: the motor is reversed, does not move the handle, or something else moves it.
    """
    enough_m = max(NUDGE_M, NUDGE_COUNTS * drive.count_m)
    forward_m = _nudge(drive, 1.0, enough_m)
    backward_m = _nudge(drive, -1.0, enough_m)
    with_it = [moved_m >= enough_m for moved_m in (forward_m, -backward_m)]
    against = [moved_m <= -enough_m for moved_m in (forward_m, -backward_m)]
    if any(with_it) and not any(against):
        return
    moved = (
        f"{1e3 * forward_m:+.2f} mm under {drive.force_n:g} N, {1e3 * backward_m:+.2f} mm under -{drive.force_n:g} N"
    )
    if any(against) and not any(with_it):
        raise DeviceFaultError(
            f"axis {drive.name}: the motor pushes the wrong way ({moved}): swap its wires, or change "
            f"device.options.axes[{drive.axis}].motor_reversed"
        )
    if any(against):
        raise DeviceFaultError(f"axis {drive.name}: the handle moves by itself ({moved}): let go of it, and balance it")
    raise DeviceFaultError(
        f"axis {drive.name}: the motor does not move the handle ({moved}): is its supply on, and is "
        "device.options.calibration_force_n more than the friction?"
    )


def find_stop(drive: Drive, towards: float) -> int:
    """Drive gently to an end of the travel, twice; the count there.

    Args:
        drive: how.
        towards: -1 to the lower end, 1 to the upper one.

    Raises:
        DeviceFaultError: there is none, the handle does not move, or it moves too fast.
    """
    _go(drive, -towards, BACK_OFF_M)
    first = _end(drive, towards)
    away = _go(drive, -towards, BACK_OFF_M)
    if abs(away.position_m - first.position_m) < 0.5 * BACK_OFF_M:
        raise DeviceFaultError(
            f"axis {drive.name}: the handle is stuck: device.options.calibration_force_n = {drive.force_n:g} N does "
            "not move it from there"
        )
    end = _end(drive, towards)
    _demand_one_place(
        drive,
        first,
        end,
        "its end was found",
        "something is in the way, or device.options.calibration_force_n is too small for its friction",
    )
    return end.counts


def find_switch(drive: Drive, towards: float) -> int:
    """Drive gently until the home switch closes, twice; the count where it does.

    Args:
        drive: how.
        towards: -1 downwards, 1 upwards.

    Raises:
        DeviceFaultError: it does not open or close, or not at one place, or the handle moves too fast.
    """
    first = _close(drive, towards)
    _go(drive, -towards, BACK_OFF_M)
    again = _close(drive, towards)
    _demand_one_place(drive, first, again, "the home switch closed", "is there noise on its line, or play in it?")
    return again.counts


def here(drive: Drive) -> int:
    """The count where the handle rests.

    Raises:
        DeviceFaultError: it does not come to rest.
    """
    return _settled(drive).counts


def _close(drive: Drive, towards: float) -> Moment:
    """Drive until the home switch closes, from where it is open; where it did."""
    if drive.push(0.0).switch and _go(drive, -towards, math.inf, while_switch=True).switch:
        drive.push(0.0)
        raise DeviceFaultError(
            f"axis {drive.name}: the home switch does not open on the way to the other end of the travel: is it "
            "stuck, or one that is closed at rest?"
        )
    closed = _go(drive, towards, math.inf, while_switch=False)
    _settled(drive)
    if not closed.switch:
        raise DeviceFaultError(f"axis {drive.name}: the home switch does not close on the way to the end of the travel")
    return closed


def _demand_one_place(drive: Drive, first: Moment, again: Moment, what: str, why: str) -> None:
    """Refuse what was found twice, and at two places."""
    apart_m = abs(again.position_m - first.position_m)
    if apart_m > max(AGREE_M, AGREE_COUNTS * drive.count_m):
        raise DeviceFaultError(f"axis {drive.name}: {what} at two places {1e3 * apart_m:.2f} mm apart: {why}")


def _end(drive: Drive, towards: float) -> Moment:
    """Drive to an end and let go; where the handle rests then."""
    pressed = _go(drive, towards, math.inf)
    rests = _settled(drive)
    if abs(rests.position_m - pressed.position_m) > 0.5 * BACK_OFF_M:
        raise DeviceFaultError(
            f"axis {drive.name}: the handle moves {1e3 * (rests.position_m - pressed.position_m):+.1f} mm by itself: "
            "let go of it, and balance it"
        )
    return rests


def _settled(drive: Drive) -> Moment:
    """The handle without force, at rest."""
    still_m = max(0.2 * NUDGE_M, 2.0 * drive.count_m)
    start = since = drive.push(0.0)
    while True:
        now = drive.push(0.0)
        if abs(now.position_m - since.position_m) > still_m:
            since = now
        if now.time_s - since.time_s >= REST_S:
            return now
        if now.time_s - start.time_s > REST_TIMEOUT_S:
            raise DeviceFaultError(f"axis {drive.name}: the handle does not come to rest: let go of it, and balance it")


def _nudge(drive: Drive, towards: float, enough_m: float) -> float:
    """Push gently until the handle has moved; how far it has [m]."""
    start = now = _settled(drive)
    while now.time_s - start.time_s < NUDGE_RAMP_S + NUDGE_HOLD_S:
        now = drive.push(towards * drive.force_n * min(1.0, (now.time_s - start.time_s) / NUDGE_RAMP_S))
        if abs(now.position_m - start.position_m) >= enough_m:
            break
    drive.push(0.0)
    return now.position_m - start.position_m


def _go(drive: Drive, towards: float, distance_m: float, while_switch: bool | None = None) -> Moment:
    """Drive some way, or until the handle is held up; where it has got to.

    Args:
        drive: how.
        towards: -1 or 1.
        distance_m: where to stop [m].
        while_switch: stop as well when the home switch is not so.
    """
    stiffness_n_per_m = drive.force_n / LAG_M
    farthest_m = 1.5 * drive.span_m + LAG_M
    longest_s = 2.0 * farthest_m / drive.speed_m_per_s + 5.0
    start = last = drive.push(0.0)
    goal_m = velocity_m_per_s = gone_m = best_m = 0.0
    best_s = start.time_s
    force_n = 0.0
    while gone_m < distance_m:
        now = drive.push(towards * force_n)
        dt_s = now.time_s - last.time_s
        if dt_s <= 0.0:
            continue
        gone_m = towards * (now.position_m - start.position_m)
        velocity_m_per_s += 0.2 * (towards * (now.position_m - last.position_m) / dt_s - velocity_m_per_s)
        last = now
        goal_m = max(gone_m - LAG_M, min(goal_m + drive.speed_m_per_s * dt_s, distance_m + LAG_M, gone_m + LAG_M))
        force_n = stiffness_n_per_m * (goal_m - gone_m) - drive.damping_n_s_per_m * velocity_m_per_s
        if gone_m > best_m + 2.0 * drive.count_m:
            best_m, best_s = gone_m, now.time_s
        if now.time_s - best_s > STALL_S + LAG_M / drive.speed_m_per_s:
            break
        if while_switch is not None and now.switch is not while_switch:
            break
        problem = ""
        if abs(velocity_m_per_s) > FAST * drive.speed_m_per_s:
            problem = f"the handle moves at {abs(velocity_m_per_s):.2g} m/s, {FAST:g} times as fast as it should"
        elif abs(gone_m) > farthest_m:
            problem = (
                f"the handle has moved {1e3 * gone_m:.0f} mm and found no end; is the travel longer than configured?"
            )
        elif now.time_s - start.time_s > longest_s:
            problem = f"the handle got nowhere within {longest_s:.0f} s"
        if problem:
            drive.push(0.0)
            raise DeviceFaultError(f"axis {drive.name}: {problem}")
    drive.push(0.0)
    return last

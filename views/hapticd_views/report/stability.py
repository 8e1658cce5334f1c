"""Was it stable? The criterion of the studies, applied to what a recording can know.

A recording does not know the hand. So it is not asked whether the device rests where hand and wall balance, but whether
it shakes faster than any hand while it is at the wall. It may ring when it arrives; once it is still it must stay so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hapticd.figures.curves import Array, Curves
from hapticd.offline.felt import WINDOW_S as FELT_WINDOW_S
from hapticd.offline.felt import felt_index
from hapticd.offline.outcome import Criterion

ARRIVAL_S = 0.5
"""What comes first of each touch is the arrival, and is not judged [s]."""

BOUNCE_S = 0.1
"""A shorter break of the contact is a bounce and belongs to the touch; so do as many missing ticks [s]."""

HAND_S = 0.05
"""What this moving mean follows is taken for the hand's own motion [s]."""

FELT_FROM_HZ = 16.0
"""No hand trembles faster."""

_MOST_FILLED = 4.0  # times the ticks that are there; beyond that they have no period
_FINEST_M = 1e-8  # finer than any encoder of a haptic device


@dataclass(frozen=True, slots=True)
class Stability:
    """How the device held still against the wall.

    Attributes:
        held_s: time that was judged: at the wall, after each arrival [s].
        shaking_s: of it, in which the device shook by more than the limit and had been still before, or never came to
            be still in that touch [s].
        ringing_s: longest time from an arrival until the device was still [s].
        worst_m: largest span of the shaking [m].
        worst_s: when that began, since the first tick [s].
        worst_hz: its strongest frequency [Hz].
        limit_m: largest span that is still [m].
        step_m: of the positions; 0 where they have none [m].
        felt: the felt index of the worst second that was still, 1 is just felt; NaN where there was none.
        forceless_s: time inside the wall without force, which is not judged [s].
        faulted: touches that a fault ended.
        faulted_moving: of these, the ones that were not still when it came.
        fault_s: when the first of them ended, since the first tick; NaN where none did [s].
    """

    held_s: float
    shaking_s: float
    ringing_s: float
    worst_m: float
    worst_s: float
    worst_hz: float
    limit_m: float
    step_m: float
    felt: float
    forceless_s: float
    faulted: int
    faulted_moving: int
    fault_s: float

    @property
    def judged(self) -> bool:
        """Whether the wall was held long enough to say anything."""
        return self.held_s > 0.0

    @property
    def unstable(self) -> bool:
        """Whether it shook, or a fault came before it was still."""
        return self.shaking_s > 0.0 or self.faulted_moving > 0

    @property
    def stable(self) -> bool:
        """Whether it was still all the time, as long as anybody wanted."""
        return self.judged and not self.unstable and not self.faulted

    @property
    def words(self) -> str:
        """For people."""
        told = [self._fault_words(), self._touch_words(), self._forceless_words()]
        return " ".join(text for text in told if text)

    def _fault_words(self) -> str:
        if not self.faulted:
            return ""
        first = "a touch" if self.faulted == 1 else f"{self.faulted} touches, the first"
        when = f"A fault ended {first} of the wall at {self.fault_s:.2f} s"
        return f"Stopped: {when[0].lower()}{when[1:]}, before it was still." if self.faulted_moving else f"{when}."

    def _forceless_words(self) -> str:
        if self.forceless_s < BOUNCE_S:
            return ""
        return f"{self.forceless_s:.3g} s inside the wall without force are not judged."

    def _touch_words(self) -> str:
        if not self.judged:
            least_s = ARRIVAL_S + Criterion().window_s
            return f"Not judged: it never stayed at the wall for {least_s:g} s at a stretch."
        limit = f"{self.limit_m * 1e3:.2g} mm, which is the limit"
        if self.shaking_s > 0.0:
            share = 100.0 * self.shaking_s / self.held_s
            return (
                f"Unstable: for {share:.0f} % of {self.held_s:.3g} s at the wall it shook by more than {limit}; worst "
                f"by {self.worst_m * 1e3:.3g} mm at about {self.worst_hz:.0f} Hz, at {self.worst_s:.2f} s."
            )
        told = f"{'Held' if self.faulted else 'Stable'}: {self.held_s:.3g} s at the wall"
        if self.ringing_s > ARRIVAL_S:
            told += f", still within {self.ringing_s:.3g} s of each arrival, and then"
        return f"{told} without shaking by more than {limit}. {self._felt_words()}".rstrip()

    def _felt_words(self) -> str:
        if np.isnan(self.felt):
            return ""
        if self.step_m > 0.0:
            steps = f"steps of {self.step_m * 1e6:.3g} µm"
            if self.felt <= 1.0:
                return f"No vibration is seen in positions that come in {steps}."
            return f"Whether a fine vibration is felt cannot be told from positions in {steps}."
        if self.felt <= 1.0:
            return f"No vibration is felt (felt index {self.felt:.2g}; 1 is just felt)."
        return f"A fine vibration is felt: felt index {self.felt:.2g}, where 1 is just felt."


def judge(curves: Curves) -> Stability:
    """Judge one run at its first wall."""
    criterion = Criterion()
    step_m = _step_m(curves["x_m"])
    sensor_m = _step_m(curves["x_measured_m"]) if "x_measured_m" in curves else step_m
    limit_m = max(criterion.still_m, criterion.still_counts * sensor_m)
    spans = _touches(curves)
    window = max(2, round(criterion.window_s / curves.period_s))
    settled = [(_settled(curves, span), _fault_s(curves, span)) for span in spans]
    judged = [(_Touch(curves, touch, window), fault_s) for touch, fault_s in settled if touch is not None]
    touches = [touch for touch, _ in judged]
    faults_s = [fault_s for _, fault_s in settled if fault_s is not None]
    still = sum(fault_s is not None and touch.still(limit_m) for touch, fault_s in judged)
    worst = max((touch.worst for touch in touches), default=(0.0, 0.0, 0.0))
    felt = [index for touch in touches for index in touch.felt(limit_m)]
    return Stability(
        held_s=sum(len(touch.spans_m) * touch.window_s for touch in touches),
        shaking_s=sum(touch.shaking(limit_m) * touch.window_s for touch in touches),
        ringing_s=max((ARRIVAL_S + touch.ringing(limit_m) * touch.window_s for touch in touches), default=0.0),
        worst_m=worst[0],
        worst_s=worst[1],
        worst_hz=worst[2],
        limit_m=limit_m,
        step_m=step_m,
        felt=max(felt, default=float("nan")),
        forceless_s=float(np.count_nonzero(curves.inside & ~curves.held)) * curves.period_s,
        faulted=len(faults_s),
        faulted_moving=len(faults_s) - still,
        fault_s=min(faults_s, default=float("nan")),
    )


class _Touch:
    """One touch after its arrival, window by window.

    Attributes:
        window_s: length of a window [s].
        spans_m: of the shaking in each window [m].
        worst: largest span [m], when it began [s], its strongest frequency [Hz].
    """

    def __init__(self, curves: Curves, touch: slice, window: int) -> None:
        time_s = curves["t_s"][touch]
        even_s = time_s
        if (time_s[-1] - time_s[0]) / curves.period_s <= _MOST_FILLED * len(time_s):
            even_s = np.arange(time_s[0], time_s[-1] + 0.5 * curves.period_s, curves.period_s)
        self._x_m = np.interp(even_s, time_s, curves["x_m"][touch])
        self._period_s = curves.period_s
        self._window = window
        self.window_s = window * curves.period_s
        fast_m = self._x_m - _slow(self._x_m, curves.period_s)
        parts = [fast_m[at : at + window] for at in range(0, len(fast_m) - window + 1, window)]
        self.spans_m = [float(np.ptp(part)) for part in parts]
        self.worst = (0.0, 0.0, 0.0)
        if parts:
            at = int(np.argmax(self.spans_m))
            begin_s = float(even_s[at * window])
            self.worst = (self.spans_m[at], begin_s, _strongest_hz(parts[at], curves.period_s))

    def ringing(self, limit_m: float) -> int:
        """Windows before the first in which it was still."""
        return next((at for at, span_m in enumerate(self.spans_m) if span_m <= limit_m), len(self.spans_m))

    def shaking(self, limit_m: float) -> int:
        """Windows in which it shook after it had been still, or all of them when it never was."""
        ringing = self.ringing(limit_m)
        if ringing == len(self.spans_m):
            return ringing
        return sum(span_m > limit_m for span_m in self.spans_m[ringing:])

    def still(self, limit_m: float) -> bool:
        """Whether it was still and stayed so to its end."""
        return self.ringing(limit_m) < len(self.spans_m) and not self.shaking(limit_m)

    def felt(self, limit_m: float) -> list[float]:
        """The felt index of each second that was still."""
        long = round(FELT_WINDOW_S / self.window_s)
        found = []
        for at in range(self.ringing(limit_m), len(self.spans_m) - long + 1, long):
            if max(self.spans_m[at : at + long]) <= limit_m:
                second = self._x_m[at * self._window : (at + long) * self._window]
                found.append(felt_index(second, self._period_s, FELT_FROM_HZ))
        return found


def _touches(curves: Curves) -> list[slice]:
    """The ticks of each touch, from the arrival to the last one at the wall."""
    time_s = curves["t_s"]
    held = np.flatnonzero(curves.held)
    if not len(held):
        return []
    apart = np.diff(time_s[held]) > BOUNCE_S
    begins = held[np.concatenate(([0], np.flatnonzero(apart) + 1))]
    ends = held[np.concatenate((np.flatnonzero(apart), [len(held) - 1]))]
    return [slice(begin, end + 1) for begin, end in zip(begins.tolist(), ends.tolist(), strict=True)]


def _settled(curves: Curves, touch: slice) -> slice | None:
    """What comes of a touch after its arrival; None where nothing does."""
    time_s = curves["t_s"]
    settled = int(np.searchsorted(time_s, time_s[touch.start] + ARRIVAL_S))
    return slice(settled, touch.stop) if settled < touch.stop else None


def _fault_s(curves: Curves, touch: slice) -> float | None:
    """When a fault ended a touch, or came while the device bounced off it; None where none did [s]."""
    time_s = curves["t_s"]
    begin_s, end_s = float(time_s[touch.start]), float(time_s[touch.stop - 1]) + BOUNCE_S
    return next((fault_s for fault_s in curves.faults_s if begin_s <= fault_s <= end_s), None)


def _slow(x_m: Array, period_s: float) -> Array:
    """The motion that a hand may make: the moving mean."""
    count = 2 * round(HAND_S / period_s / 2.0) + 1
    padded = np.pad(x_m, count // 2, mode="edge")
    mean: Array = np.convolve(padded, np.full(count, 1.0 / count), mode="valid")
    return mean


def _strongest_hz(fast_m: Array, period_s: float) -> float:
    lines: npt.NDArray[np.float64] = np.abs(np.fft.rfft((fast_m - fast_m.mean()) * np.hanning(len(fast_m))))
    hz = np.fft.rfftfreq(len(fast_m), period_s)
    return float(hz[int(np.argmax(np.where(hz < 0.25 / HAND_S, 0.0, lines)))])


def _step_m(x_m: Array) -> float:
    """The step of the sensor; 0 for positions that have hardly any value twice, or steps that no sensor has."""
    values = np.unique(np.round(x_m, 12))
    if len(values) < 2 or len(values) > 0.5 * len(x_m):
        return 0.0
    step_m = float(np.min(np.diff(values)))
    return step_m if step_m >= _FINEST_M else 0.0

"""What of a vibration is felt: third-octave bands of the true position against detection thresholds.

Thresholds: Israr, Choi & Tan, "Detection threshold and mechanical impedance of the hand in a pen-hold posture", IROS
2006: a stylus held like a pen, ten people. 1 is just felt; people differ threefold.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WINDOW_S = 1.0
JUST_FELT = 1.0
"""The felt index at the threshold."""

MOVING_HZ = 40.0
"""Bands from here up add their energy (one sense), and no hand moves so fast."""

_THRESHOLD_HZ = (10.0, 20.0, 32.0, 40.0, 50.0, 80.0, 100.0, 160.0, 320.0, 500.0)
_THRESHOLD_M = (26e-6, 8.5e-6, 2.8e-6, 1.7e-6, 1.0e-6, 0.33e-6, 0.20e-6, 0.066e-6, 0.06e-6, 0.1e-6)  # peak
_LOWEST_HZ = 3.0
_BANDS_HZ = (8.0, *(10.0 ** (at / 10.0) for at in range(11, 28)))  # 3-11 Hz as one, where the threshold is flat


def threshold_m(frequency_hz: float) -> float:
    """The smallest peak displacement that is felt [m]."""
    found = np.interp(math.log(frequency_hz), np.log(_THRESHOLD_HZ), np.log(_THRESHOLD_M))
    return math.exp(float(found))


def felt_index(x_m: Array, period_s: float, from_hz: float = 0.0) -> float:
    """How many times the threshold a position vibrates.

    Args:
        x_m: true position, about `WINDOW_S` of it.
        period_s: between samples [s].
        from_hz: only bands from here up, as where a hand moves below [Hz].

    Returns:
        The larger of the strongest band below 40 Hz and the root of the summed squares of those above.
    """
    count = len(x_m)
    if count < 8:
        return 0.0
    if not np.all(np.isfinite(x_m)):
        return math.inf
    steps = np.arange(count) - 0.5 * (count - 1)
    still = x_m - x_m.mean()
    still = still - steps * (float((steps * still).sum()) / float((steps * steps).sum()))
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    # mean square of each line: twice its square over the window's energy
    lines = 2.0 * np.abs(np.fft.rfft(still * hann)) ** 2 / (count * float((hann * hann).sum()))
    hz = np.fft.rfftfreq(count, period_s)
    low, high = 0.0, 0.0
    for centre in _BANDS_HZ:
        half = 10.0**0.05
        bottom, top = (_LOWEST_HZ, 10.0**1.05) if centre == _BANDS_HZ[0] else (centre / half, centre * half)
        if centre < from_hz * 0.999:
            continue
        peak_m = math.sqrt(2.0 * float(lines[(hz >= bottom) & (hz < top)].sum()))
        ratio = peak_m / threshold_m(centre)
        if centre < 0.99 * MOVING_HZ:
            low = max(low, ratio)
        else:
            high += ratio * ratio
    return max(low, math.sqrt(high))

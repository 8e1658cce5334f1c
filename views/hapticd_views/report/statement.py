"""What a report states: the law's part and the machine's, each in a sentence with a mark."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from hapticd.figures.curves import Curves
from hapticd.figures.panels import displayed_stiffness_n_per_m
from hapticd.telemetry.records import LATE_US
from hapticd_views.recording import Recording
from hapticd_views.report.stability import Stability, judge
from hapticd_views.source import Source

Mark = Literal["good", "bad", "unknown"]

_SHOWN_S = 0.02


@dataclass(frozen=True, slots=True)
class Statement:
    """One answer.

    Attributes:
        question: that it answers.
        mark: how it is.
        text: the answer, in sentences.
        numbers: the same for programs; None where a number is not known.
    """

    question: str
    mark: Mark
    text: str
    numbers: dict[str, float | None]


def statements(source: Source) -> list[Statement]:
    """What there is to say of a run."""
    recording = source.recording
    in_space = recording is not None and any(receipt.get("object_name") for receipt in recording.receipts)
    told = [_stability(judge(source.curves[0]), in_space), _law(source.curves[0], recording)]
    if recording is not None:
        told += [_faults(recording), _machine(source.curves[0], recording)]
    return told


def _stability(found: Stability, in_space: bool) -> Statement:
    mark: Mark = "bad" if found.unstable else "good" if found.stable else "unknown"
    words = found.words
    if in_space and not found.judged and not found.faulted:
        words = "Not judged: the scene has objects, and only what happens at a wall is judged."
    return Statement("Was it stable?", mark, words, {key: _known(value) for key, value in asdict(found).items()})


def _law(curves: Curves, recording: Recording | None) -> Statement:
    held = curves.held
    if curves.inside.any() and not held.any():
        return Statement("What did the law add?", "unknown", "No force was let through at the wall.", {})
    numbers: dict[str, float | None] = {}
    text = []
    if "damping_n_s_per_m" in curves and held.any():
        damping = curves["damping_n_s_per_m"][held]
        numbers["damping_median_n_s_per_m"] = float(np.median(damping))
        numbers["damping_max_n_s_per_m"] = float(damping.max())
        text.append(
            f"At the wall the law's damping was {np.median(damping):.3g} N s/m in the median and {damping.max():.3g} "
            "N s/m at most."
            if damping.any()
            else "The law added no damping of its own."
        )
    shown = displayed_stiffness_n_per_m(curves, _SHOWN_S)
    if np.isfinite(shown).any():
        numbers["displayed_stiffness_n_per_m"] = float(np.nanmedian(shown))
        commanded = f" of {curves.stiffness_n_per_m * 1e-3:g} kN/m" if np.isfinite(curves.stiffness_n_per_m) else ""
        text.append(f"The wall showed {np.nanmedian(shown) * 1e-3:.3g} kN/m{commanded} in the median.")
    if recording is not None and "generated_j" in recording.ticks:
        made_j, taken_j = (_grown(recording, name) for name in ("generated_j", "dissipated_j"))
        numbers |= {"generated_j": made_j, "dissipated_j": taken_j}
        times = f", {taken_j / made_j:.3g} times as much" if made_j > 1e-9 and taken_j > 0.0 else ""
        did = "took" if taken_j >= 0.0 else "made another"
        text.append(
            f"Sampling and hold made {made_j * 1e3:.3g} mJ; law and damping {did} {abs(taken_j) * 1e3:.3g} mJ{times}."
        )
    elif "energy_j" in curves:
        numbers["energy_j"] = float(curves["energy_j"][-1])
        text.append(f"At the end {curves['energy_j'][-1] * 1e3:.3g} mJ had flowed into the walls.")
    mark: Mark = "good" if text else "unknown"
    return Statement("What did the law add?", mark, " ".join(text) or "Nothing is known of it.", numbers)


def _faults(recording: Recording) -> Statement:
    faults = recording.faults
    latched_s = _latched_s(recording)
    numbers: dict[str, float | None] = {"faults": len(faults), "latched_s": latched_s}
    if faults:
        count = f"{len(faults)} faults, the first" if len(faults) > 1 else "One"
        text = (
            f"{count} at {faults[0].timestamp - _first_s(recording):.2f} s: {faults[0].text} (code {faults[0].code})."
        )
    elif latched_s is not None:
        status = recording.topics["status"]
        code, why = next(
            (int(code), told)
            for code, told, latched in zip(status["fault_code"], status["fault_text"], status["latched"], strict=True)
            if latched
        )
        text = f"None, but it was stopped by one from before, at {latched_s:.2f} s: {why} (code {code})."
    else:
        return Statement("Was there a fault?", "good", "None.", numbers)
    return Statement("Was there a fault?", "bad", text, numbers)


def _machine(curves: Curves, recording: Recording) -> Statement:
    numbers: dict[str, float | None] = {"missing": recording.missing, "overruns": _overruns(recording)}
    text = []
    if "late_us" in curves:
        late_us = curves["late_us"]
        median, most, latest = np.quantile(late_us, (0.5, 0.999, 1.0))
        share = float(np.mean(late_us >= LATE_US))
        numbers |= {"late_median_us": median, "late_999_us": most, "late_max_us": latest, "late_share": share}
        text.append(
            f"Ticks started {median:.0f} µs late in the median, 99.9 % within {most:.0f} µs, the latest after "
            f"{latest:.0f} µs; {100.0 * share:.2g} % were {LATE_US} µs late or more."
        )
    overruns, missing = numbers["overruns"] or 0, recording.missing
    text.append(f"The loop skipped {overruns:g} deadlines." if overruns else "The loop skipped no deadline.")
    text.append(f"{missing} ticks are missing in the recording." if missing else "No tick is missing.")
    if recording.cut:
        text.append(f"The file ends early: {recording.cut}.")
    if not all(receipt["realtime"] for receipt in recording.receipts):
        text.append("The loop was not real-time.")
    good = not overruns and not missing and not recording.cut
    return Statement("What did the machine do?", "good" if good else "bad", " ".join(text), numbers)


def _grown(recording: Recording, name: str) -> float:
    """By how much a sum of the books has grown; each loop begins them anew [J]."""
    values, loops = recording.ticks[name], recording.loops
    return float(sum(values[loops == one][-1] - values[loops == one][0] for one in np.unique(loops)))


def _latched_s(recording: Recording) -> float | None:
    """When a status first told that a fault had stopped the daemon, since the first tick; None: never [s]."""
    status = recording.topics.get("status", {})
    if "latched" not in status or not status["latched"].any():
        return None
    at_s = float(status["timestamp"][int(np.argmax(status["latched"]))])
    return max(0.0, at_s - _first_s(recording))


def _overruns(recording: Recording) -> float:
    """Deadlines that the loop skipped while it was recorded."""
    ticks = recording.ticks
    if "deadline_ns" in ticks:
        rates_hz = np.array([receipt["rate_hz"] for receipt in recording.receipts])[recording.in_force]
        periods = np.rint(np.diff(ticks["deadline_ns"]) * 1e-9 * rates_hz[1:])
        skipped = periods - np.diff(ticks["seq"])
        return float(skipped[np.diff(recording.loops) == 0].sum())  # of another loop, not while it was looked for
    status: dict[str, Any] = recording.topics.get("status", {})
    if "overruns" not in status:
        return 0.0
    counts, run = status["overruns"], status["run"]
    runs = np.unique(run)  # a daemon that was started meanwhile has counted from 0
    return float(sum(counts[run == one][-1] - (counts[run == one][0] if one == runs[0] else 0) for one in runs))


def _first_s(recording: Recording) -> float:
    return float(recording.ticks["timestamp"][0])


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

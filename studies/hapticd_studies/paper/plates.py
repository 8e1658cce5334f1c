"""The figures of the report: each with what was simulated and what is to be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from hapticd_studies.paper import charts, figures
from hapticd_studies.paper.claims import Evidence


@dataclass(frozen=True, slots=True)
class Plate:
    """One figure.

    Attributes:
        name: of its file.
        title: above it.
        scenario: what was simulated.
        seen: what to see in it.
        draw: makes it.
    """

    name: str
    title: str
    scenario: str
    seen: str
    draw: Callable[[Evidence], Figure]


_OMEGA = "Model of an omega.7 (0.25 kg, 4.4 N s/m, steps of 10 um, 12 N), 1 kHz, pressed with 3 N from rest at the wall"

PLATES = (
    Plate(
        "fig3",
        "Fig. 3: a wall without a controller generates energy",
        "0.5 kg without friction, wall of 3 kN/m, 5 N from rest at the wall, no law.",
        "Green is stored in the wall, red comes back. More comes back than was stored: at the end of each cycle the "
        "energy is lower than at the end of the one before, by the purple bar, and the oscillation grows.",
        figures.leak,
    ),
    Plate(
        "fig6",
        "Fig. 6: energy cycles stop it",
        "As Fig. 3 with the energy-cycle law. Right: from 0.2 s on (dashed) wall or device has a damping of -1 N s/m.",
        "The damping steps up at the ends of the first cycles and then stays; position and energy come to rest, in the "
        "wall at -5/3 mm, although something in the loop keeps feeding it.",
        figures.converging,
    ),
    Plate(
        "native",
        "The limit of the device alone",
        "The omega.7 model without a law; a dot a start (from the wall to 10 mm above it), three hand forces.",
        "Up to 7 kN/m one or two counts of the position remain, at 8 kN/m up to a dozen, from 9 kN/m on every start "
        "oscillates. The model's friction was chosen for this: it is where the comparison starts from.",
        charts.native_limit,
    ),
    Plate(
        "fig7",
        "Fig. 7: without the time window",
        "The omega.7 model at 12 kN/m under 5 N, 2 um of sensor noise. Left: the shipped reading. Middle and right: "
        "the energy E_tot of the complete force, and no bound on the damping. Middle row: 40 ms of the energy.",
        "The power changes sign all the time (red) without a cycle of the motion. Where each counts as a cycle and "
        "E_tot is used, the damping runs away and the wall breaks; the window rejects them. The shipped reading holds "
        "the wall all the same.",
        figures.without_window,
    ),
    Plate(
        "fig8",
        "Fig. 8: 12 kN/m without a controller",
        f"{_OMEGA}, 12 kN/m, no law.",
        "The device bounces in and out of the wall, and the energy falls without end: each cycle generates as much as "
        "the friction of the device takes.",
        figures.uncontrolled,
    ),
    Plate(
        "fig9",
        "Fig. 9: 12, 18 and 20 kN/m with energy cycles",
        f"{_OMEGA}; dashed: the depth and the force at which hand and wall balance.",
        "Three or four cycles set the damping, and the device rests where the wall should hold it. The energy goes "
        "below zero: the wall has generated some, which the paper's method allows.",
        figures.controlled,
    ),
    Plate(
        "fig10",
        "Fig. 10: time-domain passivity control at 12 kN/m",
        f"{_OMEGA}, 12 kN/m. Left: as published. Right: damping of at most 50 N s/m, none below 1 mm/s.",
        "As published the damping divides by the square of the speed: it reaches 100 000 N s/m near standstill and "
        "throws the device about at the limit of its force. With the two bounds it comes to rest.",
        figures.passivity_control,
    ),
    Plate(
        "map",
        "What TDPA does at 12 kN/m depends on hand and start",
        "The omega.7 model at 12 kN/m, a cell a run of 6 s. Top: how far it still moves. Bottom: the verdict.",
        "As published it moves by millimetres at some hand forces and starts, and rests at others, sometimes out of "
        "place: a single experiment decides little. Bounded TDPA and energy cycles hold the wall everywhere here.",
        charts.tdpa_map,
    ),
    Plate(
        "fig11",
        "Fig. 11: the displayed stiffness",
        f"{_OMEGA}; force over depth, both means over 20 ms, of ticks in contact.",
        "It comes to the commanded stiffness (dashed). Over the measured depth it equals it by construction at rest; "
        "over the true depth it is off by up to half a count of the position, 2 to 3 % at these depths.",
        figures.displayed_stiffness,
    ),
    Plate(
        "speed",
        "The damping at low speed",
        "As Figs. 9 and 10; a dot a tick in contact with damping in force.",
        "TDPA asks for the more damping the slower the device is. The damping of the energy cycles does not know the "
        "speed. Above the dashed line a sampled damper alone makes this device unstable.",
        charts.damping_at_speed,
    ),
    Plate(
        "long",
        "Is what the wall generates bounded?",
        "As Fig. 9, for much longer; purple: a position sensor without steps. Right: the last 0.2 s.",
        "Without steps the energy stays where it is after the first cycles. With steps of 10 um some contacts never "
        "stand quite still: they toggle within a step or two, and generate a little for ever.",
        charts.long_contact,
    ),
    Plate(
        "readings",
        "What the text leaves open",
        "Rows: the law as shipped, each choice changed alone; then energy, sum, rule and cap in every combination, and "
        "the pairings and the window of the print, without what we have added to the print (delay identified, small "
        "cycles bounded). "
        "Columns: the paper's four simulations (0.5 kg undamped), and a device of 0.25 kg, 4 N s/m, 10 um, 12 N at six "
        "walls. Right: how many of 28 settle.",
        "The pairing of force and motion must see the hold; a damping that may fall winds up; the work of the damping "
        "must not count as energy, or the undamped simulations stay lossless; a velocity over many samples breaks "
        "stiff walls.",
        charts.readings,
    ),
)

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
        "fig1",
        "Fig. 1: force over displacement",
        "0.5 kg without friction thrown at a wall of 3 kN/m at 0.2 m/s, no hand, no law. Right: the deepest part.",
        "A force is held until the next sample: on the way in it is that of a place less deep, on the way out that of "
        "a deeper one. The release runs above the press, and the area between them is what the wall has generated.",
        figures.loop,
    ),
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
        "Up to 7 kN/m one to four counts of the position remain, at 8 kN/m up to a dozen, which is more than the "
        "0.05 mm that counts as still (dashed), from 9 kN/m on every start oscillates. The model's "
        "friction was chosen for about this: it is where the comparison starts from.",
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
        "window",
        "Fig. 7 under every hand, with and without noise",
        "The omega.7 model and one of 2.1 N s/m without a limit of force, 12 kN/m; a cell the share of starts and "
        "devices that rests. Literal: E_tot, no bounds; spring: the spring's energy, no bounds; letter: nothing but "
        "eqs. 7 to 10 as printed.",
        "The window helps the readings without bounds, but makes none of them stable: noise decides, and whether the "
        "hand force is a whole number of counts (multiples of 0.12 N: 3 and 6 N). The shipped reading rests "
        "everywhere, with it and without.",
        charts.window,
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
        f"{_OMEGA}, 12 kN/m. Left: unbounded, with an observer that sees the hold's leak. Middle: unbounded, with the "
        "observer of eq. 2 as printed. Right: damping of at most 50 N s/m, none below 1 mm/s.",
        "Unbounded the damping divides by the square of the speed: it reaches 100 000 N s/m near standstill and "
        "throws the device about at the limit of its force. The printed observer sees no leak and never acts. With the "
        "two bounds it comes to rest.",
        figures.passivity_control,
    ),
    Plate(
        "map",
        "TDPA and energy cycles at 12 kN/m over hand and start",
        "The omega.7 model at 12 kN/m, a cell a run of 6 s. Top: how far it still moves. Bottom: the verdict.",
        "Unbounded it rests hardly anywhere; how far it moves depends on hand force and start. "
        "Bounded TDPA and energy cycles hold the wall everywhere here.",
        charts.tdpa_map,
    ),
    Plate(
        "fig11",
        "Fig. 11: the displayed stiffness",
        f"{_OMEGA}, and (below) with 3.03 N, which no whole number of counts balances; force over true depth "
        "in contact.",
        "Smoothed over 20 ms (blue) it comes to the commanded stiffness (dashed). Tick by tick (orange) it stays "
        "within a few per cent only where the position happens to stand still on a count.",
        figures.displayed_stiffness,
    ),
    Plate(
        "moving",
        "A hand that moves",
        "The omega.7 model with a hand of 5 N s/m and 200 N/m that presses with 3 N and draws back with 1 N, once a "
        "second.",
        "At 4 kN/m the device needs no law. Each time the hand lets go, eq. 7 takes the spring's return for generated "
        "energy, and damping that never falls keeps it: the force leaves that of the spring. Ring-damping lets go of "
        "its damping.",
        figures.moving,
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

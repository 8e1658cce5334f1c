"""Runs of walls, clients and objects in which everything happens that may happen to a loop."""

from __future__ import annotations

import math

from hapticd.errors import DeviceDisconnectedError, DeviceFaultError, DeviceTimeoutError
from hapticd.loop.resume import ResumeState
from hapticd.tick.event import EventCode
from hapticd.tick.remote.update import (
    DAMPING,
    FORCE,
    ORIENTATION,
    POSITION,
    RELEASED,
    STIFFNESS,
    TURNING,
    VELOCITY,
)
from tests.recorded.acts import (
    asks,
    befalls,
    calibrated,
    computes,
    fails,
    freeze,
    jumping,
    moving,
    placed_at,
    reads_take,
    silent,
    switches,
    thaw,
    with_broken_law,
)
from tests.recorded.loops import Loop, Script
from tests.recorded.scenes import CUP, CUP_CHANGED, ROOM, thing

WALL = "[[scene.walls]]\nstiffness_n_per_m = 1500.0\nposition_m = 0.002\n"
CHANGING = (
    WALL + "damping_n_s_per_m = 1.5\nchanges = [{at_s = 0.08, stiffness_n_per_m = 900.0}, "
    "{at_s = 0.2, stiffness_n_per_m = 1200.0, damping_n_s_per_m = 0.5}]\n"
)
CEILING = '[[scene.walls]]\nstiffness_n_per_m = 700.0\nposition_m = 0.004\nfree_side = "negative"\n'
LATE = '[velocity]\nestimator = "foaw"\nsamples = 16\nnoise_m = 1e-6\n'
SIDE = '[[scene.walls]]\naxis = "x"\nstiffness_n_per_m = 2500.0\nposition_m = -0.001\ndamping_n_s_per_m = 3.0\n'


def by_law(name: str, more: str = "") -> str:
    return f'[controller]\nlaw = "{name}"\n{more}'


def walls() -> dict[str, Script]:
    fast = "[safety]\nramp_s = 0.03\nmax_force_n = 6.0\n"
    changed = WALL.replace("1500", "2500") + CEILING
    return {
        "requests": Script(
            CHANGING + CEILING + by_law("energy-cycle") + fast + '[velocity]\nestimator = "lowpass"\n',
            acts={
                250: Loop.disarm,
                300: asks("tare"),
                310: asks("arm"),
                320: asks("tare"),
                330: asks("calibrate"),
                420: switches(changed + by_law("energy-cycle") + fast),
                560: switches(changed + by_law("tdpa") + fast),
                640: switches(CEILING + by_law("tdpa") + "[safety]\nramp_s = 0.06\nmax_force_n = 3.0\n"),
                700: switches(CEILING + by_law("tdpa") + "[safety]\nramp_s = 0.06\nmax_force_n = 300.0\n"),
                760: Loop.disarm,
                830: asks("calibrate"),
                840: asks("arm"),
                860: asks("arm"),
                900: switches(CEILING + by_law("tdpa"), law="absent", params={}, keep_law=False),
                980: asks("clear"),
            },
            ticks=1000,
            seed=11,
        ),
        "faults": Script(
            WALL
            + SIDE
            + by_law("tdpa")
            + "[safety]\nmax_axis_force_n = 2.5\nmax_force_n = 3.0\nmax_speed_m_per_s = 3.0\n"
            + "supervisor_stall_s = 0.5\n",
            axes="xz",
            declared={"has_sequence": True, "nominal_rate_hz": 1000.0},
            acts={
                150: freeze,
                156: thaw,
                200: freeze,
                240: thaw,
                250: asks("arm"),
                260: asks("clear"),
                270: asks("arm"),
                400: placed_at(math.nan),
                430: moving,
                440: asks("clear"),
                445: asks("arm"),
                560: calibrated(False),
                590: calibrated(True),
                600: asks("clear"),
                605: asks("arm"),
                700: silent(True),
                1230: asks("clear"),
                1250: silent(False),
                1260: asks("clear"),
                1265: asks("arm"),
                **dict.fromkeys((1400, 1401, 1402), jumping),
                1460: asks("clear"),
                1465: asks("arm"),
                1560: with_broken_law(WALL + SIDE + by_law("none")),
            },
            ticks=1900,
            seed=12,
        ),
        "late": Script(
            WALL + by_law("energy-cycle") + LATE,
            declared={"has_clock": True, "host_silence_ms": 20.0},
            acts={
                100: reads_take(0.6e-3),
                150: reads_take(1.4e-3),
                180: reads_take(3.6e-3),
                190: reads_take(12.5e-3),
                192: reads_take(0.1e-3),
                300: reads_take(11.2e-3),
                301: reads_take(0.1e-3),
                340: computes(0.9e-3),
                341: reads_take(0.95e-3),
                345: computes(20e-6),
                346: reads_take(0.1e-3),
                440: reads_take(7.3e-3),
                470: reads_take(0.1e-3),
                500: asks("clear"),
                505: asks("arm"),
                598: switches(WALL + CEILING + by_law("energy-cycle") + LATE),
                600: computes(0.96e-3),
                601: reads_take(0.97e-3),
                640: computes(20e-6),
                641: reads_take(0.1e-3),
                660: asks("clear"),
                665: asks("arm"),
            },
            ticks=900,
            seed=13,
        ),
        "gone": Script(
            WALL + by_law("none") + '[velocity]\nestimator = "device"\n',
            declared={"has_velocity": True, "has_sequence": True, "nominal_rate_hz": 4000.0},
            resume=ResumeState(seq=700, skipped=3, law=2, may_arm=True, latched=True, device=""),
            acts={
                50: asks("arm"),
                60: asks("clear"),
                65: asks("arm"),
                70: asks("unknown"),
                200: fails(EventCode.OVER_SPEED),
                300: asks("clear"),
                310: befalls("enable", DeviceTimeoutError("it does not answer")),
                315: asks("arm"),
                320: asks("arm"),
                340: Loop.disarm,
                341: asks("arm"),
                400: befalls("write", DeviceFaultError("too hot")),
            },
            ticks=500,
            seed=14,
        ),
        "lost": Script(
            WALL + by_law("none") + '[velocity]\nsamples = 5\n[safety]\nprofile = "simulation"\n',
            declared={"simulated": True, "has_clock": True},
            acts={30: asks("arm"), 300: befalls("read", DeviceDisconnectedError("unplugged"))},
            ticks=500,
            seed=15,
        ),
    }


COUPLING = (
    '[[scene.couplings]]\nname = "tool"\nstiffness_n_per_m = 800.0\ndamping_n_s_per_m = 4.0\nmax_force_n = 4.0\n'
    "hold_s = 0.06\nmax_speed_m_per_s = 0.3\n"
)
FORCE_TABLE = '[[scene.forces]]\nname = "field"\nmax_force_n = 2.0\nhold_s = 0.05\nunchanged_s = 0.12\n'


def client(loop: Loop) -> None:
    """Says something of every port at 60 Hz, is silent for a while, jumps, asks for too much, and lets go."""
    number = loop.journal.tick
    if number % 17 or 300 < number < 420 or 700 < number < 760:
        return
    turn = (number // 17 % 9 - 4) * 2e-3
    for index, port in enumerate(loop.tick.ports):
        if port.kind == "force":
            loop.say(index, said=FORCE, force_n=[250.0 * turn if number < 500 else 1.0, -50.0 * turn, 0.3])
        elif port.kind == "coupling":
            said = POSITION | (VELOCITY if number % 34 else 0)
            if number > 200:
                said |= STIFFNESS | DAMPING
            if number in (612, 629):
                said |= RELEASED
            loop.say(
                index,
                said=said,
                position_m=[turn, -0.5 * turn, 0.3 * turn],
                velocity_m_per_s=[0.02, 0.01, -0.03],
                stiffness_n_per_m=300.0 + number,
                damping_n_s_per_m=1.0,
            )
        else:
            loop.say(
                index,
                said=POSITION | ORIENTATION | VELOCITY | TURNING | (STIFFNESS if number > 400 else 0),
                position_m=[0.5 * turn, 0.2 * turn, -0.02 + turn],
                velocity_m_per_s=[0.05, 0.0, -0.02],
                orientation=[1.0, 20.0 * turn, 0.1, -10.0 * turn],
                angular_velocity_rad_per_s=[0.3, 0.1, 0.0],
                stiffness_n_per_m=1500.0,
            )


def driven() -> dict[str, Script]:
    remote = '[remote]\nlaw = "{}"\n'
    return {
        "tool and field": Script(
            COUPLING + FORCE_TABLE + WALL + by_law("energy-cycle") + remote.format("tdpa"),
            ticks=900,
            seed=21,
            each_tick=client,
            acts={
                500: switches(
                    COUPLING.replace("4.0\nhold", "2.5\nhold")
                    + "driven = true\n"
                    + by_law("tdpa")
                    + remote.format("tdpa")
                ),
                640: Loop.disarm,
                700: asks("arm"),
                800: switches(WALL + by_law("tdpa") + remote.format("tdpa")),
            },
        ),
        "tool in space": Script(
            COUPLING + "driven = true\n" + FORCE_TABLE + by_law("none") + remote.format("energy-cycle"),
            axes="xyz",
            declared={"simulated": True, "has_clock": True},
            ticks=800,
            seed=22,
            reach_m=0.006,
            each_tick=client,
            acts={450: freeze, 462: thaw, 520: placed_at(math.nan), 540: moving, 560: asks("clear"), 570: asks("arm")},
        ),
        "moved ball": Script(
            CUP + by_law("energy-cycle") + remote.format("none"),
            axes="xyz",
            declared={"simulated": True, "has_clock": True},
            ticks=900,
            seed=23,
            reach_m=0.015,
            each_tick=client,
            acts={
                350: switches(CUP_CHANGED + by_law("energy-cycle") + remote.format("none")),
                480: freeze,
                485: thaw,
                600: switches(CUP + by_law("tdpa") + remote.format("none")),
                800: switches(WALL + by_law("tdpa") + remote.format("none")),
            },
        ),
    }


def space() -> dict[str, Script]:
    declared = {"has_clock": True, "max_force_n": 8.0}
    return {
        f"space {name}": Script(
            ROOM + by_law(name),
            axes="xyz",
            declared={**declared, "simulated": name != "tdpa"},
            ticks=900,
            seed=seed,
            reach_m=0.02,
            acts={
                260: switches(ROOM.replace("1500", "2500").replace("0.6", "0.4") + by_law(name)),
                400: Loop.disarm,
                460: asks("tare"),
                465: asks("arm"),
                500: freeze,
                506: thaw,
                540: calibrated(False),
                560: calibrated(True),
                570: asks("clear"),
                575: asks("arm"),
                640: switches(CUP.replace("remote = true\n", "") + by_law(name)),
                740: with_broken_law(CUP.replace("remote = true\n", "") + by_law("none")),
            },
        )
        for name, seed in (("none", 31), ("energy-cycle", 32), ("tdpa", 33))
    }


def seldom(loop: Loop) -> None:
    """A device that has something new at two of five reads, while things change at any of them."""
    loop.driver.stale = loop.journal.tick % 5 not in (0, 3)


def slow() -> dict[str, Script]:
    """Devices that are slower than the loop."""
    declared = {"has_sequence": True, "nominal_rate_hz": 400.0, "max_force_n": 8.0}
    rough = thing("ball", "sphere", radius_m=0.012, static_friction=0.7, dynamic_friction=0.5)
    smooth = thing("ball", "sphere", radius_m=0.0125, stiffness=2200.0)
    hollow = thing("ball", "box", size_m=[0.02, 0.02, 0.02], inside=True)
    scenes = [rough, smooth, hollow, rough, WALL, rough + SIDE, hollow, smooth]
    return {
        "slow in space": Script(
            rough + by_law("tdpa"),
            axes="xyz",
            declared=declared,
            seed=41,
            reach_m=0.012,
            each_tick=seldom,
            acts={
                **{100 * (at + 1): switches(scene + by_law("tdpa")) for at, scene in enumerate(scenes)},
                230: Loop.disarm,
                251: asks("arm"),
                431: Loop.disarm,
                433: asks("arm"),
            },
        ),
        "slow at walls": Script(
            CHANGING + CEILING + by_law("set-position"),
            declared=declared,
            seed=42,
            each_tick=seldom,
            acts={
                150: switches(WALL + by_law("set-position")),
                290: switches(CEILING + by_law("energy-cycle")),
                410: Loop.disarm,
                431: asks("arm"),
                520: switches(CEILING + WALL + by_law("energy-cycle")),
                660: fails(EventCode.OVER_SPEED),
                680: asks("clear"),
                685: asks("arm"),
            },
        ),
    }


SCRIPTS = walls() | driven() | space() | slow()

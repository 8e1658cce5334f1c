"""Objects that change under a hand: by a ramp, under their name, and their work in a book of its own."""

from __future__ import annotations

import dataclasses
import math
from contextlib import nullcontext
from itertools import pairwise
from typing import Any

import pytest

from hapticd import plugins
from hapticd.errors import ConfigError
from hapticd.law import LawSnapshot
from hapticd.tick.assemble import make_tick
from hapticd.tick.contact import RunningLaw
from tests.tick.space.rig import INFO, Rig, apart, ball, config, length, table

RAMP_TICKS = 50


def pressed(scene: str = "", law: str = "energy-cycle") -> Rig:
    return Rig(scene or ball(), law).start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.0292), 60)


CHANGED = {
    "stiffer": ball(stiffness=9000.0),
    "softer": ball(stiffness=1000.0),
    "lower": ball(position_m=(0.0, 0.0, -0.0004)),
    "aside": ball(position_m=(0.003, 0.0, 0.0)),
    "away": ball(position_m=(0.2, 0.0, 0.0)),
    "larger": ball(radius_m=0.0302),
    "rough": ball(static_friction=0.5, dynamic_friction=0.4),
    "a box": table("ball", "box", size_m=(0.06, 0.06, 0.0598)),
    "gone": "",
}


@pytest.mark.parametrize("after", CHANGED.values(), ids=CHANGED)
def test_no_force_jumps_when_an_object_changes(after: str) -> None:
    rig = pressed()
    before = rig.force
    worst = 0.0
    rig.switch(after)
    for _ in range(2 * RAMP_TICKS):
        last = rig.force
        rig.go((0.0, 0.0, 0.0292))
        worst = max(worst, apart(rig.force, last))
    assert abs(before[2]) > 3.0
    assert worst <= 2.0 * 12.0 / RAMP_TICKS
    settled = Rig(after).start((0.0, 0.0, 0.05)).to((0.0, 0.0, 0.0292), 150).to((0.0, 0.0, 0.0292), 60)
    if "position" not in after:  # a proxy that was carried aside has another history than one that came from above
        assert apart(rig.force, settled.force) < 0.02
    assert rig.unbalanced_j() < 1e-13


@pytest.mark.parametrize("after", CHANGED.values(), ids=CHANGED)
def test_what_was_applied_is_held_until_a_slower_device_has_news_of_the_change(after: str) -> None:
    """All of it was gone until the next sample."""
    rig = pressed(ball(static_friction=0.9, dynamic_friction=0.9)).to((0.0005, 0.0, 0.0292), 30)
    rig.switch(after)
    for _ in range(3):
        for _ in range(4):
            before = tuple(rig.tick.force_n)
            rig.tick.advance(rig.sample, 1e-3)
            assert apart(rig.tick.force_n, before) <= 2.0 * 12.0 / RAMP_TICKS
        x, y, z = rig.tick.force_n
        rig.force = (x, y, z)
        rig.go((0.0005, 0.0, 0.0292))
        assert apart(rig.force, (x, y, z)) <= 5.0 * 2.0 * 12.0 / RAMP_TICKS
    assert rig.unbalanced_j() < 1e-13


@pytest.mark.parametrize("after", ["", ball(radius_m=0.0302)], ids=["gone", "changed"])
def test_no_force_jumps_when_it_is_armed_again_while_an_object_still_fades_out(after: str) -> None:
    """It would have stood in what the release had left of it."""
    rig = pressed()
    rig.switch(after).to((0.0, 0.0, 0.0292), 5)
    rig.tick.release()
    rig.to((0.0, 0.0, 0.0292), 20)
    before = rig.force
    assert rig.tick.guard.gain < 0.7
    rig.tick.arm()
    rig.go((0.0, 0.0, 0.0292))
    assert before[2] > 1.0
    assert apart(rig.force, before) <= 2.0 * 12.0 / RAMP_TICKS
    rig.to((0.0, 0.0, 0.0292), 2 * RAMP_TICKS)
    assert rig.unbalanced_j() < 1e-13


WALL = '[[scene.walls]]\naxis = "{}"\nstiffness_n_per_m = {}\n'
ON_ITS_SIDE = (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0)


@pytest.mark.parametrize(
    ("floor", "side", "softer"),
    [
        (WALL.format("z", 12000.0), WALL.format("y", 12000.0), WALL.format("y", 5000.0)),
        (table("floor", "plane", 12000.0), table("side", "plane", 9000.0, orientation=ON_ITS_SIDE), ""),
        (table("floor", "plane", 12000.0), WALL.format("y", 9000.0), ""),
    ],
    ids=["a wall is softer", "a plane goes", "a wall goes beside a plane"],
)
def test_no_force_jumps_when_one_of_two_that_share_the_limit_changes(floor: str, side: str, softer: str) -> None:
    """The one that stays took the most of it at once, 8 N in a tick: it asks for many times the limit."""
    inside = (0.0, -0.008, -0.008)
    rig = Rig(floor + side, "none").start((0.0, 0.01, 0.01)).to(inside, 300).to(inside, 60)
    assert length(rig.force) == pytest.approx(12.0)
    rig.switch(floor + softer)
    worst = 0.0
    for _ in range(3 * RAMP_TICKS):
        last = rig.force
        rig.go(inside)
        worst = max(worst, apart(rig.force, last))
    assert worst <= 2.0 * 2.0 * 12.0 / RAMP_TICKS
    assert length(rig.force) == pytest.approx(12.0)
    assert rig.unbalanced_j() < 1e-13


def test_friction_that_is_taken_away_takes_its_laws_along_and_new_friction_learns_anew() -> None:
    rough = ball(static_friction=0.5, dynamic_friction=0.4)
    rig = pressed(rough).to((0.002, 0.0, 0.0292), 60)
    (contact,) = rig.tick.solids
    before = [channel.law for channel in contact.channels]
    rig.switch(ball()).to((0.0, 0.0, 0.0292), 60)
    assert [channel.law for channel in contact.channels] == before[:1]
    rig.switch(rough).to((0.002, 0.0, 0.0292), 60)
    after = [channel.law for channel in contact.channels]
    assert len(after) == 3
    assert [law in before for law in after] == [True, False, False]


@pytest.mark.parametrize("moved_m", [0.03, -0.01])
def test_a_part_of_a_union_that_moves_takes_its_surface_with_it(moved_m: float) -> None:
    """Two balls are one solid; the second moves to the device or away from it, and the first stays."""
    first = ball(position_m=(-0.05, 0.0, 0.0), radius_m=0.04)
    rig = Rig(first + ball("other", position_m=(0.0, 0.0, -0.03), radius_m=0.04), "energy-cycle")
    rig.start((0.0, 0.0, 0.031)).to((0.0, 0.0, 0.02), 60)
    rig.switch(first + ball("other", position_m=(0.0, 0.0, moved_m - 0.03), radius_m=0.04))
    for _ in range(3 * RAMP_TICKS):
        rig.go((0.0, 0.0, 0.0095))
    anew = Rig(first + ball("other", position_m=(0.0, 0.0, moved_m - 0.03), radius_m=0.04), "energy-cycle")
    anew.start((0.0, 0.0, 0.08)).to((0.0, 0.0, 0.0095), 400).to((0.0, 0.0, 0.0095), 100)
    assert apart(rig.force, anew.force) < 0.05 * max(1.0, abs(anew.force[2]))


def test_an_object_goes_on_under_its_name_wherever_it_stands_in_the_file() -> None:
    rig = pressed(ball() + ball("other", position_m=(0.2, 0.0, 0.0)))
    contact = rig.tick.solids[0]
    law, cycle = contact.normal.law, contact.ledger.energy_j
    rig.switch(ball("other", position_m=(0.25, 0.0, 0.0)) + ball(stiffness=7000.0))
    assert rig.tick.solids[1] is contact
    assert contact.normal.law is law
    assert contact.ledger.energy_j == cycle
    assert contact.solid.index == 1


@pytest.mark.parametrize("refused", [False, True])
def test_until_a_switch_is_taken_ticks_tell_of_the_scene_that_is_there(refused: bool) -> None:
    """A reader of the record of an object that its scene does not have ended the daemon."""
    rig = pressed(ball())
    before = rig.tick.solids[0].solid
    wanted = config(ball("other", position_m=(0.2, 0.0, 0.0)) + ball(), safety="max_force_n = 900.0" if refused else "")
    switching = rig.tick.switch(wanted.config.scene, wanted.config.safety)
    seen = []
    with pytest.raises(ConfigError, match="900") if refused else nullcontext():
        for _ in switching:
            seen.append((rig.tick.objects, before.index, before.members))
    assert len(seen) > 1
    assert set(seen) == {(1, 0, (0,))}
    assert (rig.tick.objects, before.index, before.members) == ((1, 0, (0,)) if refused else (2, 1, (1,)))


@pytest.mark.parametrize("first", [1, 2, 3])
@pytest.mark.parametrize("remote", [False, True], ids=["still", "remote"])
def test_one_that_is_gone_fades_out_on_a_device_that_has_news_every_third_tick(remote: bool, first: int) -> None:
    """What has faded out is looked at no more, also at a tick without a new sample."""
    rig = pressed(ball(remote=remote), "none")
    rig.switch("")
    forces = [rig.force[2]]
    for number in range(first + 120):
        if number < first or (number - first) % 3 == 0:
            rig.go((0.0, 0.0, 0.0292))
        else:
            rig.tick.advance(rig.sample, 1e-3)
        x, y, z = rig.tick.force_n
        rig.force = (x, y, z)
        forces.append(z)
    assert forces[0] == pytest.approx(4.0)
    assert max(abs(b - a) for a, b in pairwise(forces)) <= 3.0 * 4.0 / RAMP_TICKS + 1e-9
    assert forces[-1] == 0.0
    assert rig.tick.fault == 0
    assert rig.unbalanced_j() < 1e-13


def test_work_of_a_change_is_the_scenes_and_no_leak() -> None:
    rig = pressed(law="none").to((0.0, 0.0, 0.0292), 5)
    generated = rig.totals.ledger.generated_j
    rig.switch(ball(stiffness=10000.0)).to((0.0, 0.0, 0.0292), 100)
    assert rig.totals.moved_j == pytest.approx(0.5 * 5000.0 * 0.0008**2)
    assert rig.totals.ledger.generated_j == pytest.approx(generated)
    assert rig.totals.ledger.stored_j == pytest.approx(0.5 * 10000.0 * 0.0008**2)
    assert rig.unbalanced_j() < 1e-14


def test_a_switch_that_is_refused_changes_nothing() -> None:
    rig = pressed()
    solids, force = list(rig.tick.solids), rig.force
    with pytest.raises(ConfigError, match="rounding_m"):
        rig.switch(table("ball", "box", size_m=(0.01, 0.01, 0.01), rounding_m=0.02))
    assert rig.tick.solids == solids
    rig.go((0.0, 0.0, 0.0292))
    assert apart(rig.force, force) < 0.2


def test_another_law_comes_in_by_a_ramp_on_every_direction() -> None:
    rig = pressed(ball(static_friction=0.8, dynamic_friction=0.6))
    rig.switch(ball(static_friction=0.8, dynamic_friction=0.6), law="damper")
    names = {channel.law.module.__name__ for channel in rig.tick.solids[0].channels}
    assert names == {"hapticd_controllers.damper"}
    assert len(rig.tick.solids[0].channels) == 3


def test_laws_start_from_what_is_measured_when_the_switch_is_taken_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight walls and as many objects take some 30 ticks to make ready, in which the hand goes on."""
    laws, before = plugins.law("tdpa"), plugins.law("tdpa").start
    started = []

    def start(state: Any, params: Any, snapshot: LawSnapshot) -> None:
        started.append((round(snapshot.x_m, 9), round(snapshot.velocity_m_per_s, 6)))
        before(state, params, snapshot)

    monkeypatch.setattr(laws, "start", start)
    wall = '[[scene.walls]]\naxis = "z"\nstiffness_n_per_m = 100.0\nposition_m = 0.03\n'
    far = [ball(f"far {n}", position_m=(0.1 * n, 1.0, 0.0)) for n in range(1, 8)]
    rig = pressed(ball() + far[0])
    wanted = config(ball() + far[0] + "".join(far[1:]) + 8 * wall, "tdpa")
    switching = rig.tick.switch(
        wanted.config.scene, wanted.config.safety, lambda: RunningLaw(wanted.law, wanted.params)
    )
    ticks = 0
    for ticks, _ in enumerate(switching, 1):
        rig.go((0.0, 0.0, 0.0292 - 1e-6 * ticks * ticks))
    assert ticks > 20
    at_m, speed = rig.tick.motion.position_m[2] - 0.03, round(rig.tick.motion.velocity_m_per_s[2], 6)
    assert speed < -0.04
    assert len(started) == 16
    assert started.count((round(at_m, 9), speed)) == 9, "the ball, and walls as high as it"


def test_a_turned_normal_makes_a_law_forget_the_mass_of_its_direction() -> None:
    rig = pressed()
    contact = rig.tick.solids[0]
    contact.normal.law.state.felt_mass_kg = 2.0
    contact.normal.law.state.damping_n_s_per_m = contact.normal.damping_n_s_per_m = 700.0
    for n in range(1, 101):  # 19 degrees about y
        a = n * 0.0033
        rig.go((0.0292 * math.sin(a), 0.0, 0.0292 * math.cos(a)))
    assert contact.normal.law.state.felt_mass_kg == 2.0
    rig.go((0.0292 * math.sin(0.4), 0.0, 0.0292 * math.cos(0.4)))
    assert contact.normal.law.state.felt_mass_kg == 0.0
    assert contact.normal.damping_n_s_per_m == 50.0  # its own bound while it knows no mass


def test_a_device_with_one_axis_takes_no_object_over() -> None:
    wall = "[[scene.walls]]\nstiffness_n_per_m = 9000.0\n"
    one = dataclasses.replace(INFO, axes=("z",), workspace_m=INFO.workspace_m[:1])
    tick = make_tick(config(wall), one)
    scene = config(wall + ball()).config.scene
    with pytest.raises(ConfigError, match="objects need three axes, and bench has 1"):
        list(tick.switch(scene))
    assert len(tick.contacts) == 1


def test_what_fades_out_has_no_force_of_its_own_and_is_dropped_when_it_is_gone() -> None:
    """The device goes on inwards at 0.3 m/s: what is left is the old force alone, a share less each tick."""
    rig = pressed(ball(damping_n_s_per_m=20.0))
    old_n, stored_j = rig.force[2], rig.totals.ledger.stored_j
    rig.switch("")
    assert rig.totals.moved_j == pytest.approx(-stored_j)
    assert rig.totals.ledger.stored_j == 0.0
    assert len(rig.tick.awake) == 1
    for count in range(RAMP_TICKS):
        rig.go((0.0, 0.0, 0.0292 - 3e-4 * (count + 1)))
        assert rig.force[2] == pytest.approx(old_n * (1.0 - count / RAMP_TICKS), rel=1e-6)
    rig.go((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert rig.force == (0.0, 0.0, 0.0)
    assert rig.tick.awake == []
    assert rig.unbalanced_j() < 1e-12


@pytest.mark.parametrize(("first_m", "other_m"), [(0.0, 0.05), (-0.01, 0.04), (0.01, 0.05)])
def test_objects_of_a_union_are_where_the_file_has_them_whichever_moves(first_m: float, other_m: float) -> None:
    """Where the first moved, the others went along: they are placed as they are seen from there."""

    def scene(first_m: float, other_m: float) -> str:
        return ball("first", position_m=(first_m, 0.0, 0.0)) + ball("other", position_m=(other_m, 0.0, 0.0))

    over = [(x, 0.0, 0.0285) for x in (first_m, other_m)]
    felt = []
    for begun, then in ((scene(0.0, 0.04), scene(first_m, other_m)), (scene(first_m, other_m), "")):
        rig = Rig(begun, "none").start((0.0, 0.0, 0.05)).to((0.0, 0.0, 0.035), 30)
        if then:
            rig.switch(then)
        for x, y, z in over:
            rig.to((x, y, 0.035), 200).to((x, y, z), 200)
            felt.append(rig.force)
    assert felt[:2] == [pytest.approx(force, abs=1e-6) for force in felt[2:]]
    assert all(force[2] > 5.0 for force in felt)


def test_a_change_under_a_disarmed_device_is_nobodys_work() -> None:
    """The books had the spring as if it pushed: 12 mJ a reload."""
    rig = Rig(ball(), "none")
    rig.sample.position_m[:] = (0.0, 0.0, 0.035)
    rig.sample.time_ns = 0
    rig.tick.start(rig.sample)
    rig.to((0.0, 0.0, 0.028), 50)
    for scene in (ball(stiffness=6000.0), ball(stiffness=9000.0), ""):
        rig.switch(scene).to((0.0, 0.0, 0.028), 5)
    totals = rig.totals
    assert (totals.moved_j, totals.ledger.dissipated_j, totals.ledger.generated_j) == (0.0, 0.0, 0.0)


def test_a_change_in_a_release_is_booked_by_what_is_left_of_the_force() -> None:
    rig = pressed(law="none")
    rig.tick.release()
    rig.to((0.0, 0.0, 0.0292), 20)
    gain = rig.tick.guard.gain
    before_j = rig.totals.moved_j
    rig.switch(ball(stiffness=9000.0))
    assert 0.4 < gain < 0.7
    assert rig.totals.moved_j - before_j == pytest.approx(gain * 0.5 * 4000.0 * 0.0008**2, rel=0.05)
    rig.to((0.0, 0.0, 0.0292), 100)
    assert rig.unbalanced_j() < 1e-13

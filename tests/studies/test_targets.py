"""What the default law was asked for: that the table counts what it says, and what the laws reach of it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from hapticd.cli import main
from hapticd.offline.outcome import Criterion
from hapticd_studies.law_spec import LawSpec, parse_laws
from hapticd_studies.targets import hindsight
from hapticd_studies.targets.hands import softening, taking_over
from hapticd_studies.targets.missed import markdown, missed
from hapticd_studies.targets.plan import Size, TargetsPlan
from hapticd_studies.targets.presses import noisy
from hapticd_studies.targets.report import front_of, targets_of
from hapticd_studies.targets.table import LATER, Reached, interval, known_beforehand

TINY = Size(pressed=8, moved=7, moved_s=3.0, based=7, based_s=12.0, starts=2)


def law(text: str) -> LawSpec:
    (found,) = parse_laws(text, {})
    return found


def targets(*arguments: str) -> int:
    with pytest.raises(SystemExit) as left:
        main(["study", "targets", *arguments])
    return int(left.value.code or 0)


def test_a_target_is_met_from_its_side_only() -> None:
    assert Reached("held", 99.0, True, 99.0, 10).met
    assert not Reached("held", 99.0, True, 98.9, 10).met
    assert Reached("damping", 1.5, False, 1.5, 10).met
    assert not Reached("damping", 1.5, False, 1.6, 10).met
    assert not Reached("settling", 1.5, False, math.nan, 10).met


@pytest.mark.parametrize(("share", "of", "low", "high"), [(0.5, 10, 0.2366, 0.7634), (1.0, 100, 0.9630, 1.0)])
def test_a_share_stands_with_wilsons_interval(share: float, of: int, low: float, high: float) -> None:
    assert interval(share, of) == pytest.approx((low, high), abs=1e-4)


def test_what_reaches_a_missed_target_is_said_with_what_it_loses() -> None:
    def rows(held: float, pulls: float, taps: float) -> list[Reached]:
        return [
            Reached("held", 99.0, True, held, 100),
            Reached("pulls", 2.0, False, pulls, 100),
            Reached("taps", 1.5, False, taps, 100),
            Reached(f"taps{LATER}", 1.5, False, 9.0, 100),
        ]

    laws = {
        "default": rows(98.0, 0.1, 1.0),
        "firm": rows(100.0, 30.0, 20.0),
        "blunt": rows(99.5, 0.2, 9.0),
        "weak": rows(90.0, 0.0, 0.5),
        "mute": rows(99.9, math.nan, 9.0),
        "known beforehand": [Reached("held", 99.0, True, 98.9, 100)],
    }
    (held,) = missed(laws)
    assert [one.law for one in held.others] == ["mute", "blunt", "firm", "known beforehand", "weak"]
    assert [one.what for one in held.others[2].costs] == ["pulls", "taps"]
    assert held.says == "3 of 5 reach it, and each loses what the default reaches"
    assert "| `firm` | 100 | pulls: 30, not 0.1; taps: 20, not 1 |" in markdown([held])
    (free,) = missed({"default": rows(98.0, 0.1, 1.0), "better": rows(99.0, 0.1, 1.0)})
    assert free.says == "better reaches it, and nothing that the default reaches is lost"
    (none,) = missed({"default": rows(98.0, 0.1, 1.0), "weak": rows(97.0, 0.1, 1.0)})
    assert none.says == "none of 1 reaches it"
    _, pulls = missed({"default": rows(98.0, 0.1, 1.0), "weak": rows(97.0, 3.0, 1.0)}, ("pulls",))
    assert (pulls.target.what, pulls.says) == ("pulls", "the default reaches it here; none of 1 reaches it")
    assert pulls.others[0].costs == ()


@pytest.mark.nightly
def test_dampers_chosen_for_each_device_are_calm_or_fast_and_never_both() -> None:
    plan = TargetsPlan(9, Size(10, 7, 2.0, 7, 2.0, 2), [law("damper")], Criterion(), ("moved", "hindsight"))
    job = plan.job()
    tables = plan.tables([job.work(job.spec, block, 1) for block in range(len(job.sizes))])
    assert "hindsight" not in tables[1]
    least, fastest = ({one.what: one.reached for one in rows} for rows in known_beforehand(plan, tables[0]).values())
    assert tuple(known_beforehand(plan, tables[0])) == hindsight.LABELS
    settling, base = "settling over the best damper's, hard arrival", "base after ten minutes of hands within need [%]"
    assert fastest[settling] == 1.0 < least[settling]
    assert least[base] == 100.0 > fastest[base]


def test_the_devices_with_noise_have_no_delay() -> None:
    found = [noisy(3, index) for index in range(50)]
    assert all(device.options.noise_m == 4e-6 and not device.delayed for device in found)
    assert len({device.options.seed for device in found}) == 50


@pytest.mark.nightly
def test_every_target_of_a_small_study_is_counted_and_the_known_devices_are_held() -> None:
    plan = TargetsPlan(5, TINY, [law("ring-damping"), law("damper")], Criterion())
    job = plan.job()
    tables = plan.tables([job.work(job.spec, block, 1) for block in range(len(job.sizes))])
    found = targets_of(plan, tables)
    ring, damper = ({one.what: one for one in found[name]} for name in ("ring-damping", "damper"))
    assert list(ring) == list(damper)
    assert all(one.of > 0 for one in ring.values() if "exits" not in one.what)
    for what in ("Fig. 6 of the paper converges [%]", "omega7 model at 12, 18, 20 kN/m held [%]"):
        assert ring[what].reached == 100.0
    weighted = "damping over need, from 10 s on: all hands"
    assert ring[weighted].reached < 0.5 * damper[weighted].reached
    assert ring["ticks in contact that pull [%]"].reached < damper["ticks in contact that pull [%]"].reached
    points = {one.law: one for one in front_of(plan, tables)}
    assert points["ring-damping"].over_need < points["damper"].over_need


def test_a_wall_that_softens_takes_the_damping_along_and_a_constant_damper_stays() -> None:
    ring = np.array(softening([2.0, 3.0, 4.0], law("ring-damping"), 1))[:, 0]
    assert np.median(ring) <= 1.0
    assert np.isinf(softening([3.0], law("damper"), 1)).all()


def test_another_hand_is_another_base() -> None:
    assert np.isfinite(taking_over([2.0, 4.0], law("ring-damping"), 1)).all()
    assert np.isinf(taking_over([3.0], law("energy-cycle"), 1)).all()


@pytest.mark.parametrize(
    "wrong", [("--share", "0"), ("--seed", "-1"), ("--laws", "no-such-law"), ("--front", "--missed")]
)
def test_what_cannot_be_run_is_one_line_and_exit_2(
    wrong: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert targets(*wrong, "--output", str(tmp_path)) != 0
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.nightly
def test_the_command_writes_the_front_and_its_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert targets("--front", "--share", "0.01", "--seed", "5", "--output", str(tmp_path), "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found == json.loads((tmp_path / "front.json").read_text())
    assert found["laws"][0]["law"] == "ring-damping"
    assert (tmp_path / "front.png").read_bytes().startswith(b"\x89PNG")

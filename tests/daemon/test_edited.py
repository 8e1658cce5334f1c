"""Code and fields that were edited come into force after a loss when somebody arms the device, not by themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from hapticd.config.loading import load
from hapticd.loop.resume import FROM_START
from hapticd.loop.sources import edited, loaded
from hapticd.paths import directory
from hapticd.shapes.field import Field
from hapticd.tick.event import EventCode
from tests.faults.rig import Rig, anew_where_late, events_until

SOFT = '[controller]\nlaw = "mylab.soft"\n'
LAWS = {"soft": "pass", "other": "pass"}


def away(rig: Rig, do: Callable[[], object] = lambda: None) -> list[dict[str, Any]]:
    """Lose the device, do something, and find it again; the events until the loop runs."""
    with rig.subscriber() as subscriber:
        rig.order("unplugged")
        events_until(subscriber, EventCode.DEVICE_LOST)
        do()
        rig.mend()
        return events_until(subscriber, EventCode.STARTED)


def edit(rig: Rig, name: str = "soft") -> None:
    """Three times the force."""
    file = rig.directory / "mylab" / f"{name}.py"
    file.write_text(file.read_text().replace("return ", "return 3.0 * "))


def said(events: list[dict[str, Any]]) -> str:
    """What is told of edited files."""
    return " ".join(str(event["text"]) for event in events if "edited since" in str(event["text"]))


def stays_disarmed(rig: Rig, events: list[dict[str, Any]], what: str) -> None:
    assert said(events) == f"stays disarmed: edited since it was loaded: {what}; `hapticd arm` for what it is now"
    assert not rig.ask("status")["status"]["armed"]
    assert rig.felt().force_n == 0.0
    assert said(away(rig)) == "", "it was said"
    assert not rig.ask("status")["status"]["armed"]
    rig.goes_on("arm")
    assert said(away(rig)) == ""
    rig.pressing()


@anew_where_late
def test_a_law_that_was_edited_since_it_was_imported_does_not_arm_itself_when_the_device_is_back() -> None:
    """1.18 N became 3.45 N, with nothing said; a reload in between keeps what is imported."""
    with Rig(safety="auto_arm = true", more=SOFT, laws=LAWS) as rig:
        rig.pressing()
        edit(rig, "other")
        assert said(away(rig)) == "", "another one is in force"
        rig.pressing()
        edit(rig)
        rig.switch("# saved\n")
        stays_disarmed(rig, away(rig), "law mylab.soft")


@anew_where_late
def test_a_law_that_came_by_a_switch_is_what_was_imported_then() -> None:
    with Rig(safety="auto_arm = true", laws=LAWS) as rig:
        rig.pressing()
        rig.switch(SOFT)
        assert said(away(rig)) == ""
        rig.pressing()
        edit(rig)
        stays_disarmed(rig, away(rig), "law mylab.soft")


@anew_where_late
def test_a_reload_while_the_device_is_away_brings_another_law_and_no_edited_one() -> None:
    with Rig(safety="auto_arm = true", more=SOFT, laws=LAWS) as rig:
        rig.pressing()
        other = SOFT.replace("soft", "other").join(rig.config.split(SOFT))

        def reload(config: str) -> None:
            rig.config = config
            rig.switch()

        assert said(away(rig, lambda: reload(other))) == "", "it was asked for"
        rig.pressing()
        edit(rig, "other")
        stays_disarmed(rig, away(rig, lambda: reload(other + "# saved\n")), "law mylab.other")


def test_a_field_that_was_edited_since_it_was_read_does_not_arm_itself(tmp_path: Path) -> None:
    mesh = directory("config") / "mesh.toml"
    config = load(mesh)
    ring = directory("config") / "ring.field"
    (tmp_path / "ring.field").write_bytes(ring.read_bytes())
    file = tmp_path / "mesh.toml"
    file.write_text(mesh.read_text())
    before = loaded(FROM_START, load(file))
    assert before == loaded(FROM_START, config)
    assert loaded(before, config).may_arm
    assert list(edited(before, loaded(before, config), config)) == []
    field = Field.unpack(ring.read_bytes())
    field.distances_m[0] += 1e-3
    (tmp_path / "ring.field").write_bytes(field.pack())
    now = loaded(before, load(file))
    assert now.fields != before.fields
    assert not now.may_arm
    assert list(edited(before, now, config)) == ["a field of the scene"]
    assert loaded(replace(before, fields=0), load(file)).may_arm, "a reload reads them anew"


def test_the_law_of_couplings_counts_as_well() -> None:
    config: Any = SimpleNamespace(config=SimpleNamespace(remote=SimpleNamespace(law="mylab.soft")))
    before = replace(FROM_START, port_law_code=1)
    assert list(edited(before, replace(before, port_law_code=2), config)) == ["remote law mylab.soft"]

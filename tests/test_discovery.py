"""Each driver is asked in a process of its own: what one of them does spoils no other one's answer."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from hapticd import discovery, plugins
from hapticd.device import Diagnosis, FoundDevice
from hapticd.discovery import Discovery
from hapticd.simulation.options import SimulationOptions
from tests.drivers.plugin import install, write_module

look = partial(discovery.look, timeout_s=300.0)  # on a computer with other work

LOOPBACK = Discovery("loopback", (FoundDevice("omega7 model, simulated", ""),), absent="plug it in")


def test_what_a_driver_finds_and_says_arrives_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(
        tmp_path,
        monkeypatch,
        "find(cls, options=None): return [FoundDevice('rïg', '7', '1-2', 'bad', 'odd', ('sudo a', '# b'))]",
        "diagnose(cls, options=None): return [Diagnosis('advice', 'old', ('get',)), Diagnosis('ok', 'well')]",
    )
    assert look({"odd": None}) == [
        Discovery(
            "odd",
            (FoundDevice("rïg", "7", "1-2", "bad", "odd", ("sudo a", "# b")),),
            (Diagnosis("advice", "old", ("get",)), Diagnosis("ok", "well")),
            "plug it in",
        )
    ]
    assert look({"odd": None}, find=False)[0].devices == ()


def test_a_driver_is_given_its_options() -> None:
    options = SimulationOptions.model_validate({"mass_kg": 0.5, "changes": [{"at_s": 1.0, "mass_kg": 0.4}]})
    assert look({"loopback": options}) == [LOOPBACK]


@pytest.mark.parametrize(
    ("find", "says"),
    [
        ("raise DriverError('the bus is down')", "the bus is down"),
        ("raise ValueError('odd')", "its driver failed: ValueError: odd"),
        ("raise SystemExit('enough')", "it ended with exit code 1: enough"),
        ("os._exit(0)", "it ended with exit code 0"),
        ("os.abort()", "it crashed, signal 6"),
        ("return ctypes.string_at(0)", "it crashed, signal 11"),
        ("return [1]", "1 is no FoundDevice"),
        ("return None", "NoneType"),
    ],
)
def test_a_driver_that_fails_says_how_and_spoils_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, find: str, says: str
) -> None:
    install(tmp_path, monkeypatch, f"find(cls, options=None): {find}")
    odd, loopback = look({"odd": None, "loopback": None})
    assert says in odd.problem
    assert odd.devices == ()
    assert loopback == LOOPBACK


def test_a_driver_that_hangs_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "find(cls, options=None): time.sleep(1000)")
    assert look({"odd": None}, timeout_s=1.0) == [Discovery("odd", problem="it did not answer within 1 s")]


def test_a_thread_that_a_driver_leaves_behind_keeps_nobody_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    thread = "__import__('threading').Thread(target=lambda: time.sleep(1000)).start()"
    install(tmp_path, monkeypatch, f"find(cls, options=None): {thread}; return []")
    assert look({"odd": None}) == [Discovery("odd", absent="plug it in")]


def test_what_a_library_prints_is_no_part_of_the_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The C library's own output as well: SDKs are talkative."""
    install(tmp_path, monkeypatch, "find(cls, options=None): print('x'); ctypes.CDLL(None).puts(b'y'); return []")
    assert look({"odd": None}) == [Discovery("odd", absent="plug it in")]


def test_a_driver_that_cannot_be_imported_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch)
    (tmp_path / "odd_driver.py").write_text("import no_such_library")
    (odd,) = look({"odd": None})
    assert "No module named 'no_such_library'" in odd.problem


@pytest.mark.parametrize("name", plugins.names(plugins.DRIVERS))
def test_every_built_in_driver_answers(name: str) -> None:
    (looked,) = look({name: None})
    assert looked.problem == ""
    assert looked.absent


def test_a_driver_that_is_named_by_its_module_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_module(tmp_path, monkeypatch, "find(cls, options=None): return []")
    for name in ("mylab.rig", "mylab.rig.Driver"):
        assert look({name: None}) == [Discovery(name, absent="plug it in")]

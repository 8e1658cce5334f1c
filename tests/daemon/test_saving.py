"""A file that is saved, in every way that editors and orchestrators have, is taken over where it says so itself."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from hapticd.config.loading import LoadedConfig, parse
from hapticd.errors import ConfigError
from hapticd.supervisor import file_watch
from hapticd.supervisor.file_watch import QUIET_S, FileWatcher
from hapticd.supervisor.reload import Reload
from hapticd.tick.event import EventCode
from tests.daemon.running import PATIENCE_S, Daemon, Subscriber, wait_until
from tests.daemon.test_deaths import PRESSED, pressing

OLD = '[controller]\nlaw = "none"\n'
NEW = '[controller]\nlaw = "tdpa"\n'
BAD = '[controller]\nlaw = "tdap"\n'


@contextmanager
def watched(path: Path) -> Iterator[FileWatcher]:
    watcher = FileWatcher(path)
    try:
        first = found(watcher)
        assert isinstance(first, LoadedConfig), first
        assert first.text == path.read_text()
        yield watcher
    finally:
        watcher.close()


def found(watcher: FileWatcher) -> LoadedConfig | ConfigError:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        saved = watcher.take()
        if saved is not None:
            return saved
        time.sleep(0.01)
    raise AssertionError("nobody saw that the file was saved")


def law_in(watcher: FileWatcher) -> str:
    saved = found(watcher)
    assert isinstance(saved, LoadedConfig), saved
    return saved.config.controller.law


def in_place(file: Path, text: str) -> None:
    file.write_text(text)


def renamed_over(file: Path, text: str) -> None:
    new = file.with_name(f".{file.name}.new")
    new.write_text(text)
    new.replace(file)


def moved_away_first(file: Path, text: str) -> None:
    """As vim does with `backup`: for a moment there is no file."""
    file.rename(f"{file}~")
    file.write_text(text)
    Path(f"{file}~").unlink()


def in_pieces(file: Path, text: str) -> None:
    """Truncated first, written by and by, each piece a usable file or none."""
    with file.open("w") as open_file:
        for letter in text:
            open_file.write(letter)
            open_file.flush()
            time.sleep(0.005)


def with_its_directory(file: Path, text: str) -> None:
    """The whole directory is exchanged, as a package manager or `rsync` into a new tree does."""
    new, old = file.parent.with_name("new"), file.parent.with_name("old")
    new.mkdir()
    (new / file.name).write_text(text)
    file.parent.rename(old)
    new.rename(file.parent)
    shutil.rmtree(old)


SAVES = [in_place, renamed_over, moved_away_first, with_its_directory]


@pytest.mark.parametrize("save", SAVES)
def test_however_it_is_saved_it_is_seen_once_and_whole(tmp_path: Path, save: Callable[[Path, str], None]) -> None:
    file = tmp_path / "etc" / "lab.toml"
    file.parent.mkdir()
    file.write_text(OLD)
    with watched(file) as watcher:
        for _ in range(2):  # what replaced it is watched as well
            save(file, NEW)
            assert law_in(watcher) == "tdpa"
            save(file, OLD)
            assert law_in(watcher) == "none"


def test_a_file_that_is_written_in_pieces_is_seen_whole_in_the_end(tmp_path: Path) -> None:
    """On a computer that is busy enough a piece may be seen first; it is not the last word."""
    file = tmp_path / "lab.toml"
    file.write_text(OLD)
    with watched(file) as watcher:
        in_pieces(file, NEW)
        for _ in NEW:
            saved = found(watcher)
            if isinstance(saved, LoadedConfig) and saved.text == NEW:
                return
        raise AssertionError("the last piece was never seen")


def test_a_link_that_is_turned_on_the_way_to_the_file_is_a_save(tmp_path: Path) -> None:
    """lab.toml -> ..data/lab.toml, ..data -> ..1/, which is how Kubernetes exchanges all files of a volume at once."""
    volume = tmp_path / "volume"
    for generation, text in (("..1", OLD), ("..2", NEW), ("..3", OLD)):
        (volume / generation).mkdir(parents=True)
        (volume / generation / "lab.toml").write_text(text)
    (volume / "..data").symlink_to("..1")
    file = volume / "lab.toml"
    file.symlink_to("..data/lab.toml")
    with watched(file) as watcher:
        for generation, law in (("..2", "tdpa"), ("..3", "none")):
            (volume / "..new").symlink_to(generation)
            (volume / "..new").replace(volume / "..data")
            assert law_in(watcher) == law


def test_a_file_elsewhere_that_a_link_leads_to_is_watched_there(tmp_path: Path) -> None:
    real = tmp_path / "store" / "real.toml"
    real.parent.mkdir()
    real.write_text(OLD)
    file = tmp_path / "lab.toml"
    file.symlink_to(real)
    with watched(file) as watcher:
        renamed_over(real, NEW)
        assert law_in(watcher) == "tdpa"


def test_a_file_that_cannot_be_used_is_told_with_the_reason_and_the_next_save_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(OLD)
    with watched(file) as watcher:
        file.write_text(BAD)
        refused = found(watcher)
        assert isinstance(refused, ConfigError)
        assert 'controller.law = "tdap"' in str(refused)
        file.write_bytes(b"\xff")
        assert "UTF-8" in str(found(watcher))
        file.write_text(NEW)
        assert law_in(watcher) == "tdpa"


def test_a_file_whose_checks_fail_in_an_unknown_way_is_told_and_the_next_save_is_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As may be in a driver's check of its options: nothing that was saved later was seen."""
    path = tmp_path / "lab.toml"
    path.write_text(OLD)

    def checked(text: str, name: str) -> LoadedConfig:
        if text == BAD:
            raise ZeroDivisionError("division by zero")
        return parse(text, name)

    monkeypatch.setattr(file_watch, "parse", checked)
    with watched(path) as watcher:
        path.write_text(BAD)
        assert str(found(watcher)) == f"{path}: cannot be checked: ZeroDivisionError: division by zero"
        path.write_text(NEW)
        assert law_in(watcher) == "tdpa"


def test_what_was_saved_while_the_file_of_before_was_checked_is_all_that_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The import of a law takes seconds; a newer file that was reloaded meanwhile was replaced by the older one."""
    file = tmp_path / "lab.toml"
    file.write_text(OLD)
    with watched(file) as watcher:

        def slow(text: str, name: str) -> LoadedConfig:
            if "0.1" in text:
                renamed_over(file, NEW)
            return parse(text, name)

        monkeypatch.setattr(file_watch, "parse", slow)
        renamed_over(file, OLD + "[safety]\nramp_s = 0.1\n")
        assert law_in(watcher) == "tdpa"


def test_a_file_that_is_empty_or_away_is_no_save(tmp_path: Path) -> None:
    """An emptied file would be a usable configuration, without a wall: it is one that somebody is about to write."""
    file = tmp_path / "lab.toml"
    file.write_text(OLD)
    with watched(file) as watcher:
        file.write_text("")
        time.sleep(6.0 * QUIET_S)
        file.unlink()
        time.sleep(6.0 * QUIET_S)
        (tmp_path / "other.toml").write_text(NEW)
        time.sleep(6.0 * QUIET_S)
        assert watcher.take() is None
        file.write_text(NEW)
        assert law_in(watcher) == "tdpa"


class Following:
    """A reload without a daemon around it, of a file that is taken over when it is saved."""

    ON = "[service]\nreload_on_save = true\n"

    def __init__(self, file: Path) -> None:
        file.write_text(self.ON)
        self.file = file
        self.switches = 0
        self.refused: list[str] = []
        state: Any = SimpleNamespace(
            config=parse(self.ON, str(file)),
            recovery=SimpleNamespace(lost=False),
            requests=SimpleNamespace(submit=self._switch),
            reload_asked=[],
            notifier=Mock(),
            tell=lambda code, text: self.refused.append(text) if code == EventCode.REFUSED else None,
            adopt=lambda config, _ring: setattr(state, "config", config),
        )
        self.state = state
        self.reload = Reload(state)

    def _switch(self, _request: object, finish: Callable[[str], None]) -> None:
        self.switches += 1
        finish("")

    def ask(self) -> str:
        """The verdict on a reload that somebody asks for."""
        verdicts: list[str] = []
        self.state.reload_asked = [verdicts.append]
        self.turn_until(lambda: bool(verdicts), "a verdict")
        return verdicts[0]

    def turn_until(self, condition: Callable[[], bool], what: str) -> None:
        def turned() -> bool:
            self.reload.turn()
            return condition()

        wait_until(turned, what)

    def turn_for(self, span_s: float) -> None:
        end_s = time.monotonic() + span_s
        self.turn_until(lambda: time.monotonic() > end_s, "the time to pass")


@pytest.fixture
def following(tmp_path: Path) -> Iterator[Following]:
    made = Following(tmp_path / "lab.toml")
    yield made
    made.reload.close()


def test_what_is_saved_right_after_a_reload_that_was_asked_for_comes_into_force(following: Following) -> None:
    """Also where it says what it said before that: the file and what is in force differed for good."""
    following.turn_for(4.0 * QUIET_S)  # the watcher has seen what the file says
    for _ in range(3):
        following.file.write_text(following.ON + NEW)
        assert following.ask() == ""
        following.file.write_text(following.ON)
        following.turn_until(lambda: following.state.config.text == following.ON, "what the file says")


def test_a_save_that_says_what_is_in_force_switches_nothing(following: Following) -> None:
    os.utime(following.file)
    following.turn_for(6.0 * QUIET_S)
    following.file.write_text("")
    following.file.write_text(following.ON)
    following.turn_for(6.0 * QUIET_S)
    assert (following.switches, following.refused) == (0, [])


def test_where_no_thread_can_be_started_a_reload_is_refused_and_the_next_one_is_not(
    following: Following, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended the daemon."""
    with monkeypatch.context() as full:
        full.setattr(threading.Thread, "start", no_thread)
        following.file.write_text(following.ON + NEW)
        said = following.ask()
    assert said.startswith(f"{following.file}: cannot be read: no thread can be started; free memory, or raise")
    assert following.refused == [f"configuration refused, nothing changed: {said}"]
    assert following.ask() == ""


def test_a_file_for_which_there_is_no_thread_yet_is_looked_at_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as full:
        full.setattr(threading.Thread, "start", no_thread)
        following = Following(tmp_path / "lab.toml")
        following.reload.turn()
        following.file.write_text(following.ON + NEW)
    following.turn_until(lambda: following.state.config.config.controller.law == "tdpa", "what was saved")
    following.reload.close()


def no_thread(_: threading.Thread) -> None:
    raise RuntimeError("can't start new thread")


def test_links_that_lead_in_a_circle_are_no_file_until_they_lead_to_one(tmp_path: Path) -> None:
    file = tmp_path / "lab.toml"
    file.write_text(OLD)
    with watched(file) as watcher:
        file.unlink()
        file.symlink_to("lab.toml")
        time.sleep(6.0 * QUIET_S)
        assert watcher.take() is None
        (tmp_path / "new.toml").write_text(NEW)
        file.unlink()
        file.symlink_to("new.toml")
        assert law_in(watcher) == "tdpa"


def test_a_daemon_takes_over_what_is_saved_for_as_long_as_the_file_says_so() -> None:
    on = "[service]\nreload_on_save = true\n"
    with Daemon(PRESSED + on).wait_ready() as daemon, Subscriber(daemon.endpoint) as subscriber:
        pressing(daemon)
        first = subscriber.until("hapticd/status")["config_hash"]
        renamed_over(daemon.config, PRESSED + on + BAD)
        refused = subscriber.until("hapticd/event", code=EventCode.REFUSED)
        assert "tdap" in refused["text"]
        assert subscriber.until("hapticd/status")["config_hash"] == first

        renamed_over(daemon.config, PRESSED + on + NEW)
        switched = subscriber.until("hapticd/event", code=EventCode.SWITCHED)
        assert (switched["law_before"], switched["law"]) == ("ring-damping", "tdpa")

        in_place(daemon.config, PRESSED + NEW)  # takes itself over, and then no more
        assert subscriber.until("hapticd/event", code=EventCode.SWITCHED)["law"] == "tdpa"
        in_place(daemon.config, PRESSED + OLD)
        time.sleep(6.0 * QUIET_S)
        with Subscriber(daemon.endpoint, "hapticd/status") as late:
            assert late.until("hapticd/status")["law"] == "tdpa"
        daemon.process.terminate()
        assert daemon.wait_exit() == 0


def test_a_daemon_that_looks_at_its_file_ends_as_any_other() -> None:
    with Daemon(PRESSED + "[service]\nreload_on_save = true\n").wait_ready() as daemon:
        daemon.process.terminate()
        assert daemon.wait_exit() == 0

"""Where a daemon's keys lie, and who may read and change them."""

from __future__ import annotations

import os
import shlex
import stat
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from hapticd.config.loading import parse
from hapticd.errors import ConfigError
from hapticd.keys import store
from hapticd.keys.file import Key, KeyWriteError, new_pair
from hapticd.keys.policy import key_ring
from hapticd.keys.store import KeyDirectory, KeyRing, key_directory


@pytest.fixture
def keys(tmp_path: Path) -> KeyDirectory:
    return KeyDirectory(tmp_path / "hapticd" / "keys")


def modes(root: Path) -> dict[str, int]:
    return {str(path.relative_to(root)): stat.S_IMODE(path.stat().st_mode) for path in (root, *root.rglob("*"))}


def test_the_environment_comes_first_then_the_unit_then_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("HAPTICD_KEYS_DIR", "CONFIGURATION_DIRECTORY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/lab")
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert key_directory() == Path("/home/lab/.config/hapticd/keys")
    monkeypatch.setenv("XDG_CONFIG_HOME", "/c")
    assert key_directory() == Path("/c/hapticd/keys")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert key_directory() == Path("/etc/hapticd/keys")
    monkeypatch.setenv("CONFIGURATION_DIRECTORY", "/etc/hapticd:/etc/other")
    assert key_directory() == Path("/etc/hapticd/keys")
    monkeypatch.setenv("HAPTICD_KEYS_DIR", "/k")
    assert key_directory() == Path("/k")


def test_only_the_user_reads_the_keys_of_a_daemon_of_ones_own(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "_service_group", lambda: -1)
    keys.make()
    keys.add("laptop", new_pair())
    assert modes(keys.path) == {".": 0o700, "server.key_secret": 0o600, "clients": 0o700, "clients/laptop.key": 0o600}


def test_the_services_group_reads_its_keys_and_nobody_else(keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch) -> None:
    group = next(iter({*os.getgroups(), os.getgid()}))
    monkeypatch.setattr(store, "_service_group", lambda: group)
    keys.make()
    keys.add("laptop", new_pair())
    assert modes(keys.path) == {".": 0o750, "server.key_secret": 0o640, "clients": 0o750, "clients/laptop.key": 0o640}
    assert {path.stat().st_gid for path in (keys.path, *keys.path.rglob("*"))} == {group}
    assert {path.stat().st_uid for path in (keys.path, *keys.path.rglob("*"))} == {os.geteuid()}


def test_the_services_group_is_for_root_to_give(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grp.getgrnam", lambda name: SimpleNamespace(gr_gid=77 if name == "hapticd" else 0))
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert store._service_group() == 77
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert store._service_group() == -1


@pytest.mark.parametrize("user", [0, 1000])
def test_where_there_is_no_service_no_group_reads_its_keys(
    user: int, keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(name: str) -> None:
        raise KeyError(name)

    monkeypatch.setattr("grp.getgrnam", unknown)
    monkeypatch.setattr(os, "geteuid", lambda: user)
    keys.make()
    keys.add("laptop", new_pair())
    assert set(modes(keys.path).values()) == {0o700, 0o600}
    assert {path.stat().st_gid for path in keys.path.rglob("*")} == {os.getegid()}


def test_a_ring_says_who_may_watch_and_who_may_command(keys: KeyDirectory) -> None:
    laptop, wall = new_pair(), new_pair()
    keys.add("laptop", laptop)
    keys.add("wall", replace(wall, watch_only=True))
    assert keys.clients() == {"laptop": Key(laptop.public), "wall": Key(wall.public, watch_only=True)}
    ring = KeyRing(new_pair(), keys.clients())
    assert ring.watchers() == {laptop.public, wall.public}
    assert ring.commanders() == {laptop.public}
    assert laptop.secret not in (keys.path / "clients" / "laptop.key").read_text()


def test_nothing_is_replaced_unless_that_is_asked_for(keys: KeyDirectory) -> None:
    pair, laptop = keys.make(), new_pair()
    keys.add("laptop", laptop)
    with pytest.raises(KeyWriteError, match="is there already"):
        keys.make()
    with pytest.raises(KeyWriteError, match="is there already"):
        keys.add("laptop", new_pair())
    assert (keys.pair(), keys.clients()) == (pair, {"laptop": Key(laptop.public)})
    assert keys.make(force=True) != pair
    keys.add("laptop", Key(laptop.public, watch_only=True), force=True)
    assert keys.clients() == {"laptop": Key(laptop.public, watch_only=True)}


def test_a_client_is_removed_by_its_name(keys: KeyDirectory) -> None:
    keys.add("laptop", new_pair())
    with pytest.raises(ConfigError, match="labtop: not listed; listed are: laptop"):
        keys.remove("labtop")
    keys.remove("laptop")
    assert keys.clients() == {}
    with pytest.raises(ConfigError, match="laptop: not listed; listed are: none"):
        keys.remove("laptop")


def test_a_key_has_one_name_since_it_can_have_one_right_only(keys: KeyDirectory) -> None:
    laptop = new_pair()
    keys.add("laptop", laptop)
    with pytest.raises(ConfigError, match="other: that key is listed already as laptop: `hapticd keys add ") as refused:
        keys.add("other", laptop)
    advice = shlex.split(
        str(refused.value).split("`")[1]
    )  # it lacked the key, so that the shell's answer was a refusal
    assert advice == ["hapticd", "keys", "add", "laptop", laptop.public, "--force"]
    copy = keys.path / "clients" / "copy.key"
    copy.write_text((keys.path / "clients" / "laptop.key").read_text())
    with pytest.raises(ConfigError, match=f"laptop.key: the same key as {copy}"):
        keys.clients()


@pytest.mark.parametrize("name", ["", "..", "../server", "a/b", ".hidden", "a b", "x" * 65, "é"])
def test_a_name_that_is_no_file_is_refused(keys: KeyDirectory, name: str) -> None:
    with pytest.raises(ConfigError, match="a client's name has letters"):
        keys.add(name, new_pair())
    with pytest.raises(ConfigError, match="not listed; listed are: none"):
        keys.remove(name)
    assert not keys.path.exists()


def test_a_file_with_a_name_that_is_refused_can_be_removed_and_nothing_beside_the_list(keys: KeyDirectory) -> None:
    """Put there by hand, it lets its client in, and the command only said what names may have in them."""
    keys.make()
    keys.add("laptop", new_pair())
    by_hand = keys.path / "clients" / "my viewer.key"
    (keys.path / "clients" / "laptop.key").rename(by_hand)
    (keys.path / "beside.key").write_text(by_hand.read_text())
    assert list(keys.clients()) == ["my viewer"]
    with pytest.raises(ConfigError, match="beside: not listed; listed are: my viewer"):
        keys.remove("../beside")
    keys.remove("my viewer")
    assert (keys.clients(), by_hand.exists()) == ({}, False)
    assert (keys.path / "beside.key").exists()


def test_what_an_editor_hides_beside_a_client_lists_no_client_and_spoils_no_reload(keys: KeyDirectory) -> None:
    keys.make()
    keys.add("laptop", new_pair())
    listed = keys.clients()
    clients = keys.path / "clients"
    (clients / ".#laptop.key").symlink_to("somebody@lab.1234:1700000000")  # as Emacs locks it
    keys.add("other", new_pair())
    (clients / "other.key").rename(clients / ".other.key")
    assert keys.clients() == listed


def test_a_file_that_is_no_key_is_named_and_lets_nobody_in(keys: KeyDirectory) -> None:
    keys.make()
    broken = keys.path / "clients" / "broken.key"
    broken.write_text("nonsense")
    with pytest.raises(ConfigError, match=f"{broken}: no public-key in it"):
        keys.clients()
    (keys.path / "server.key_secret").write_text((keys.path / "server.key_secret").read_text().split("    secret")[0])
    with pytest.raises(ConfigError, match=r"server\.key_secret: no secret-key in it"):
        keys.pair()


def test_what_a_writer_left_unfinished_is_no_client(keys: KeyDirectory) -> None:
    keys.add("laptop", new_pair())
    (keys.path / "clients" / ".wall.key.x8f3").write_text("half")
    assert list(keys.clients()) == ["laptop"]


def test_keys_that_the_services_user_may_not_read_are_named_with_a_remedy(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys.make()
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ConfigError, match=f"server.key_secret: .*sudo chgrp -R hapticd {keys.path}"):
        keys.pair()


@pytest.mark.parametrize(("look", "asked"), [("stat", "pair"), ("iterdir", "clients")])
def test_a_directory_that_may_not_be_looked_into_is_named_with_the_remedy(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch, look: str, asked: str
) -> None:
    """Root may look into any, so that a refusal is made here."""

    def refuse(path: Path, **_options: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    keys.make()
    monkeypatch.setattr(Path, look, refuse)
    with pytest.raises(ConfigError, match=f"this user may not read it.*sudo chgrp -R hapticd {keys.path}"):
        getattr(keys, asked)()


def test_a_client_that_cannot_be_removed_is_named(keys: KeyDirectory) -> None:
    (keys.path / "clients" / "wall.key").mkdir(parents=True)
    with pytest.raises(KeyWriteError, match=r"wall\.key: Is a directory"):
        keys.remove("wall")


@pytest.mark.parametrize("changed", [".", "clients", "clients/laptop.key"])
def test_keys_that_everybody_may_change_let_no_one_in(keys: KeyDirectory, changed: str) -> None:
    """Any user of the computer could list a key that commands the device."""
    keys.make()
    keys.add("laptop", new_pair())
    place = keys.path / changed
    mode = place.stat().st_mode
    place.chmod(mode | stat.S_IWOTH)
    for look in [keys.clients, keys.pair][: 2 if changed == "." else 1]:
        with pytest.raises(ConfigError, match=f"{place}: everybody may change it, .*chmod o-w {place},"):
            look()
    place.chmod(mode)
    assert keys.pair()
    assert list(keys.clients()) == ["laptop"]


@pytest.mark.parametrize(("mode", "who", "remedy"), [(0o757, "everybody", "o-w"), (0o775, "group guests", "g-w")])
def test_a_directory_above_the_keys_that_others_may_change_lets_no_one_in(
    mode: int, who: str, remedy: str, keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its users could put another directory of keys in the place of this one."""
    monkeypatch.setattr("grp.getgrgid", lambda _: SimpleNamespace(gr_name="guests", gr_mem=[]))
    keys.make()
    above = keys.path.parent
    above.chmod(mode)
    with pytest.raises(ConfigError, match=f"^{above}: {who} may change it, .*chmod {remedy} {above},"):
        keys.pair()
    above.chmod(mode | stat.S_ISVTX)  # as /tmp has it
    assert keys.pair()


def test_its_owners_private_group_may_change_a_directory_above_the_keys(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a umask of 002 makes them in a home directory."""
    members = ["lab"]
    monkeypatch.setattr("pwd.getpwuid", lambda _: SimpleNamespace(pw_name="lab"))
    monkeypatch.setattr("grp.getgrgid", lambda _: SimpleNamespace(gr_name="lab", gr_mem=members))
    keys.make()
    keys.path.parent.chmod(0o775)
    assert keys.pair()
    members.append("guest")
    with pytest.raises(ConfigError, match="group lab may change it"):
        keys.pair()


def test_a_directory_of_another_user_above_the_keys_lets_no_one_in(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    above, look = keys.path.parent, Path.stat

    def seen(path: Path, **options: bool) -> os.stat_result:
        found = list(look(path, **options))
        found[stat.ST_UID] += 70000 if path == above else 0
        return os.stat_result(found)

    keys.make()
    monkeypatch.setattr(Path, "stat", seen)
    with pytest.raises(ConfigError, match=f"^{above}: user [0-9]+ may change it, .*sudo chown root {above},"):
        keys.pair()


def test_a_directory_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(KeyWriteError, match=f"{tmp_path}/file/keys: Not a directory"):
        KeyDirectory(tmp_path / "file" / "keys").make()


def test_a_daemon_that_no_other_computer_reaches_needs_no_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its measurements stay here; commands over a port take keys on this computer too."""
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path))
    assert key_ring(parse("[telemetry]\ntcp = 'tcp://127.0.0.1:9872'\n", "lab")) is None
    assert key_ring(parse("", "lab")) is None
    for table, address in (("telemetry", "0.0.0.0"), ("control", "127.0.0.1")):
        with pytest.raises(ConfigError, match=f"{table}.tcp = .*: takes keys, and there are none in"):
            key_ring(parse(f"[{table}]\ntcp = 'tcp://{address}:9872'\n", "lab"))


def test_a_daemon_that_takes_keys_has_its_own_and_those_of_its_clients(
    keys: KeyDirectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(keys.path))
    pair, laptop = keys.make(), new_pair()
    keys.add("laptop", laptop)
    ring = key_ring(parse("[control]\ntcp = 'tcp://127.0.0.1:9872'\n", "lab"))
    assert ring == KeyRing(pair, {"laptop": Key(laptop.public)})

"""`hapticd keys` as a shell sees it, from nothing to a client's file."""

from __future__ import annotations

import json
import os
import re
import shlex
import stat
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from hapticd.cli import main
from hapticd.keys.file import read
from hapticd.keys.store import KeyDirectory


@pytest.fixture
def keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KeyDirectory:
    monkeypatch.setenv("HAPTICD_KEYS_DIR", str(tmp_path / "keys"))
    monkeypatch.delenv("HAPTICD_KEYS", raising=False)
    monkeypatch.chdir(tmp_path)
    return KeyDirectory(tmp_path / "keys")


def hapticd(*arguments: str) -> subprocess.CompletedProcess[str]:
    """What a shell would see, without the time that a process of its own takes to start."""
    with (
        redirect_stdout(StringIO()) as output,
        redirect_stderr(StringIO()) as errors,
        pytest.raises(SystemExit) as ended,
    ):
        main(arguments)
    assert isinstance(ended.value.code, int)
    return subprocess.CompletedProcess(arguments, ended.value.code, output.getvalue(), errors.getvalue())


def said(*arguments: str) -> str:
    done = hapticd(*arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def refused(*arguments: str) -> str:
    done = hapticd(*arguments)
    assert done.returncode in (1, 2)
    assert "Traceback" not in done.stderr
    return done.stderr


def test_without_a_command_it_shows_what_is_there_and_what_to_do_next(keys: KeyDirectory) -> None:
    assert "hapticd keys make" in said("keys")
    assert json.loads(said("keys", "--json")) == {"directory": str(keys.path), "server_key": None, "clients": []}
    assert keys.path == Path(os.environ["HAPTICD_KEYS_DIR"])
    assert not keys.path.exists()
    said("keys", "make")
    pair = keys.pair()
    assert pair is not None
    shown = said("keys")
    assert pair.public in shown
    assert "No client is listed" in shown
    said("keys", "make", "laptop", "--watch-only")
    shown = said("keys")
    laptop = keys.clients()["laptop"]
    assert f"{laptop.public}  laptop, may only watch" in shown
    assert "--connect tcp://HOST:9872 --keys NAME.key_secret" in shown
    assert pair.secret not in shown
    listed = {"name": "laptop", "key": laptop.public, "watch_only": True}
    told = json.loads(said("keys", "--json"))
    assert told == {"directory": str(keys.path), "server_key": pair.public, "clients": [listed]}


def test_a_client_made_on_the_daemons_computer_is_listed_and_has_all_it_needs_in_a_file(keys: KeyDirectory) -> None:
    said("keys", "make")
    assert "reload" in said("keys", "make", "laptop")
    pair, client = keys.pair(), read(Path("laptop.key_secret"))
    assert pair is not None
    assert client.server == pair.public
    assert keys.clients()["laptop"].public == client.public
    assert stat.S_IMODE(Path("laptop.key_secret").stat().st_mode) == 0o600


def test_a_client_made_on_its_own_computer_is_listed_by_the_line_that_is_printed(keys: KeyDirectory) -> None:
    said("keys", "make")
    line = re.search(r"^  (hapticd keys make NAME --server-key .*)$", said("keys"), re.MULTILINE)
    assert line
    _, *made = shlex.split(line[1].replace("NAME", "laptop"))
    line = re.search(r"^  (sudo hapticd keys add .*)$", said(*made), re.MULTILINE)
    assert line
    assert keys.clients() == {}
    _, _, *added = shlex.split(line[1])
    said(*added)
    assert keys.clients()["laptop"].public == read(Path("laptop.key_secret")).public


def test_a_key_may_be_given_as_a_file_and_only_its_public_part_is_kept(keys: KeyDirectory) -> None:
    said("keys", "make")
    said("keys", "make", "laptop")
    said("keys", "remove", "laptop")
    said("keys", "add", "desk", "laptop.key_secret", "--watch-only")
    listed = keys.clients()
    assert listed["desk"].public == read(Path("laptop.key_secret")).public
    assert (listed["desk"].secret, listed["desk"].watch_only) == ("", True)


def test_a_client_before_the_daemon_is_told_what_comes_first(keys: KeyDirectory) -> None:
    assert "`hapticd keys make` first" in refused("keys", "make", "laptop")
    assert not keys.path.exists()
    assert not Path("laptop.key_secret").exists()


def test_what_is_there_already_stays_and_a_refusal_leaves_no_client_behind(keys: KeyDirectory) -> None:
    said("keys", "make")
    pair = keys.pair()
    assert "is there already; --force" in refused("keys", "make")
    assert keys.pair() == pair
    said("keys", "make", "laptop")
    listed = keys.clients()
    assert "laptop.key_secret: is there already" in refused("keys", "make", "laptop")
    Path("laptop.key_secret").unlink()
    assert "clients/laptop.key: is there already" in refused("keys", "make", "laptop")
    assert not Path("laptop.key_secret").exists()
    assert keys.clients() == listed
    said("keys", "make", "laptop", "--force")
    assert keys.clients()["laptop"].public == read(Path("laptop.key_secret")).public
    assert "every listed client needs that key" in said("keys", "make", "--force")


def test_a_new_key_that_cannot_be_listed_leaves_the_old_one_in_its_place(keys: KeyDirectory) -> None:
    said("keys", "make")
    said("keys", "make", "laptop")
    secret, listed = Path("laptop.key_secret").read_text(), keys.clients()
    broken = keys.path / "clients" / "broken.key"
    broken.write_text("nonsense")
    assert "broken.key: no public-key in it" in refused("keys", "make", "laptop", "--force")
    broken.unlink()
    Path("a b.key_secret").write_text("of somebody's own")
    assert "a client's name has letters" in refused("keys", "make", "a b", "--force")
    assert Path("laptop.key_secret").read_text() == secret
    assert Path("a b.key_secret").read_text() == "of somebody's own"
    assert keys.clients() == listed
    assert not list(Path().glob(".*"))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["make", "--watch-only"], "give it a NAME"),
        (["make", "--server-key", "x"], "give it a NAME"),
        (["make", "laptop", "--server-key", "nonsense"], "nonsense: neither a key"),
        (["make", "../laptop", "--server-key", "x" * 40], "'../laptop': a client's name has letters"),
        (["make", "Lab PC", "--server-key", "x" * 40], "'Lab PC': a client's name has letters"),
        (["make", "", "--server-key", "x" * 40], "'': a client's name has letters"),
        (["add", "laptop"], "KEY"),
        (["add", "laptop", "x" * 39], "neither a key, which has 40 characters of Z85, nor a file"),
        (["remove", "laptop"], "laptop: not listed; listed are: none"),
        (["lst"], "'lst'"),
    ],
)
@pytest.mark.usefixtures("keys")
def test_misuse_says_what_was_expected(arguments: list[str], named: str) -> None:
    assert named in refused("keys", *arguments)


def test_an_endpoint_for_other_computers_is_refused_until_there_are_keys(keys: KeyDirectory) -> None:
    file = Path("lab.toml")
    file.write_text('[telemetry]\ntcp = "tcp://0.0.0.0:9872"\n[control]\ntcp = "tcp://127.0.0.1:9873"\n')
    done = hapticd("check", "lab.toml")
    assert done.returncode == 2
    assert [line.split(": takes keys")[0] for line in done.stderr.splitlines()] == [
        'lab.toml: telemetry.tcp = "tcp://0.0.0.0:9872"',
        'lab.toml: control.tcp = "tcp://127.0.0.1:9873"',
    ]
    assert done.stderr.count("`hapticd keys make`") == 2
    said("keys", "make")
    assert "ok" in said("check", "lab.toml")
    (keys.path / "server.key_secret").write_bytes(b"\xff\x00")
    assert f"{keys.path}/server.key_secret: is no text" in hapticd("check", "lab.toml").stderr
    file.write_text('[telemetry]\ntcp = "tcp://127.0.0.1:9872"\n')
    assert "ok" in said("check", "lab.toml")


@pytest.mark.usefixtures("keys")
def test_commands_over_tcp_want_a_clients_file() -> None:
    assert "commands over TCP take keys" in refused("arm", "--connect", "tcp://127.0.0.1:9")
    said("keys", "make", "laptop", "--server-key", "0" * 40)
    assert "no such file" in refused("arm", "--connect", "tcp://127.0.0.1:9", "--keys", "none.key_secret")
    text = Path("laptop.key_secret").read_text()
    Path("laptop.key_secret").write_text(re.sub(".*server-key.*\n", "", text))
    assert "no server-key in it" in refused("watch", "--connect", "tcp://127.0.0.1:9", "--keys", "laptop.key_secret")
    Path("laptop.key_secret").write_text(re.sub(".*secret-key.*\n", "", text))
    assert "no secret-key in it" in refused("watch", "--connect", "tcp://127.0.0.1:9", "--keys", "laptop.key_secret")
    assert "an endpoint is tcp://HOST:PORT" in refused("arm", "--connect", "lab:9873")

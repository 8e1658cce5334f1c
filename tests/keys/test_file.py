"""Key files: what other ZeroMQ programs write and read, never half written, never readable by others."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
import zmq.auth
from hypothesis import example, given
from hypothesis import strategies as st

from hapticd.errors import ConfigError
from hapticd.keys.file import Key, KeyWriteError, is_key, new_pair, read, write, written
from tests.examples import examples


def test_zeromqs_own_tools_read_ours_and_we_theirs(tmp_path: Path) -> None:
    pair = new_pair(server=new_pair().public)
    write(tmp_path / "ours", pair)
    assert zmq.auth.load_certificate(tmp_path / "ours") == (pair.public.encode(), pair.secret.encode())
    public, secret = zmq.auth.create_certificates(tmp_path, "theirs", {"name": "a laptop"})
    Path(secret).chmod(0o600)
    theirs = read(Path(secret))
    assert read(Path(public)) == Key(theirs.public)
    assert zmq.curve_public(theirs.secret.encode()).decode() == theirs.public


@examples(30)
@given(st.booleans(), st.booleans(), st.booleans())
def test_what_is_written_is_what_is_read(
    tmp_path_factory: pytest.TempPathFactory, secret: bool, server: bool, watch_only: bool
) -> None:
    pair = new_pair()
    key = Key(pair.public, pair.secret * secret, new_pair().public * server, watch_only)
    path = tmp_path_factory.mktemp("keys") / "a.key"
    write(path, key)
    assert read(path) == key


def test_a_public_key_can_be_typed_in_a_shell_and_is_no_option() -> None:
    for _ in range(200):
        public = new_pair().public
        assert is_key(public)
        assert not public.startswith("-")
        assert not set(public) & set("'\"\\` ")


def test_a_file_is_closed_to_others_from_its_first_moment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    modes: list[int] = []
    real = os.fsync

    def look(descriptor: int) -> None:
        modes.extend(stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir())
        real(descriptor)

    monkeypatch.setattr(os, "fsync", look)
    previous = os.umask(0)
    try:
        write(tmp_path / "a.key_secret", new_pair())
        write(tmp_path / "b.key_secret", new_pair(), mode=0o640)
    finally:
        os.umask(previous)
    assert set(modes) <= {0o600, 0o640}
    assert stat.S_IMODE((tmp_path / "a.key_secret").stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "b.key_secret").stat().st_mode) == 0o640


def test_a_file_is_never_replaced_unless_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.key_secret"
    first, second = new_pair(), new_pair()
    write(path, first)
    with pytest.raises(KeyWriteError, match=f"{path}: is there already; --force"):
        write(path, second)
    assert read(path) == first
    with pytest.raises(KeyWriteError), written(path, second):
        pytest.fail("what goes with the new key is not done")
    write(path, second, replace=True)
    assert read(path) == second
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "replace"), [("a.key_secret", True), ("b.key_secret", False)])
def test_a_disk_that_is_full_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, replace: bool
) -> None:
    path = tmp_path / "a.key_secret"
    pair = new_pair()
    write(path, pair)

    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(KeyWriteError, match="No space left on device"):
        write(tmp_path / name, new_pair(), replace=replace)
    assert list(tmp_path.iterdir()) == [path]
    assert read(path) == pair


KEY = st.text(alphabet="0123456789abcXYZ.-:+=^!/*?&<>()[]{}@%$# \"'", min_size=38, max_size=42)
LINES = st.lists(
    st.tuples(st.sampled_from(["public-key", "secret-key", "server-key", "rights", "metadata", "curve", "#"]), KEY)
).map(lambda lines: "\n".join(f'    {name} = "{value}"' for name, value in lines).encode())


@examples(300)
@given(st.binary(max_size=300) | LINES)
@example(b"public-key")
@example(b"public-key =")
@example(b'public-key = "' + b"#" * 40 + b'"')  # Z85 of more than 32 bits
@example(b"x" * 20_000)
@example("public-key = 'é'".encode())
def test_whatever_a_file_holds_it_is_a_key_or_an_error_that_names_it(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any.key"
    path.write_bytes(content)
    path.chmod(0o600)
    refusal, key = "", None
    try:
        key = read(path)
    except ConfigError as error:
        refusal = str(error)
    if key is None:
        assert refusal.startswith(f"{path}: ")
        assert "\n" not in refusal
    else:
        assert is_key(key.public)
        assert not key.secret or zmq.curve_public(key.secret.encode()).decode() == key.public


@pytest.mark.parametrize("text", ["", "0" * 39, "0" * 41, "#" * 40, "é" * 40, "'" * 40, " " * 40, "0" * 35 + "\n" * 5])
def test_what_is_not_forty_characters_of_z85_is_no_key(text: str, tmp_path: Path) -> None:
    """Five number signs are more than 32 bits."""
    assert not is_key(text)
    path = tmp_path / "a.key"
    path.write_text(f'curve\n    public-key = "{text.splitlines()[0] if text else text}"\n')
    with pytest.raises(ConfigError):
        read(path)
    assert is_key("0" * 40)


def test_what_is_no_file_is_named_and_never_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.key")
    for path, why in (
        (tmp_path / "pipe.key", "no regular file"),
        (tmp_path, "no regular file"),
        (Path("/dev/zero"), "no regular file"),
        (tmp_path / "none.key", "no such file"),
        (tmp_path / "none.key" / "deeper", "no such file"),
    ):
        with pytest.raises(ConfigError, match=f"^{path}: .*{why}"):
            read(path)


def test_a_secret_that_everybody_may_read_is_none(tmp_path: Path) -> None:
    path = tmp_path / "a.key_secret"
    write(path, new_pair(), mode=0o644)
    with pytest.raises(ConfigError, match=f"{path}: everybody may read this secret key: chmod o= {path}"):
        read(path)


def test_halves_of_two_pairs_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.key_secret"
    write(path, Key(new_pair().public, new_pair().secret))
    with pytest.raises(ConfigError, match="do not belong together"):
        read(path)


def test_a_secret_is_not_shown_by_accident() -> None:
    pair = new_pair()
    assert pair.secret not in repr(pair)
    assert pair.public in repr(pair)


def test_a_key_file_has_at_most_16_kib(tmp_path: Path) -> None:
    file = tmp_path / "a.key"
    write(file, new_pair())
    text = file.read_text()
    file.write_text(text + "#" * (16384 - len(text)))
    assert read(file).public in text
    file.write_text(text + "#" * (16385 - len(text)))
    with pytest.raises(ConfigError, match="is larger than 16 KiB"):
        read(file)


def test_a_name_that_no_file_can_have_cannot_be_read() -> None:
    with pytest.raises(ConfigError, match="cannot be read: embedded null byte"):
        read(Path("a\0b"))


def test_a_file_that_may_not_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may read any, so that a refusal is made here."""

    def refuse(path: Path, *_: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    write(tmp_path / "a.key", new_pair())
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ConfigError, match=f"^{tmp_path}/a.key: this user may not read it$"):
        read(tmp_path / "a.key")


def test_a_key_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that loses its power leaves the whole file or none."""
    sizes = []

    def sync(descriptor: int) -> None:
        sizes.append(os.fstat(descriptor).st_size)
        assert not (tmp_path / "a.key").exists()

    monkeypatch.setattr(os, "fsync", sync)
    write(tmp_path / "a.key", new_pair())
    assert sizes == [(tmp_path / "a.key").stat().st_size]

"""A configuration is replaced whole, by whoever may, and stays what it was to everybody else."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from hapticd.config.file import read, replace
from hapticd.errors import ConfigError

NOBODY = 65534


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "lab.toml"
    path.write_text("# one\n")
    path.chmod(0o640)
    return path


def test_mode_owner_and_links_stay_and_nothing_is_left_beside_it(file: Path) -> None:
    if os.geteuid() == 0:
        os.chown(file, NOBODY, NOBODY)
    os.utime(file, (1.0, 1.0))
    before = file.stat()
    link = file.with_name("link.toml")
    link.symlink_to("lab.toml")
    replace(link, "# two\n")
    after = file.stat()
    assert link.is_symlink()
    assert file.read_text() == "# two\n"
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert after.st_ino != before.st_ino
    assert after.st_mtime > 1e9, "whoever looks at times must see that it has changed"
    assert sorted(path.name for path in file.parent.iterdir()) == ["lab.toml", "link.toml"]


def test_line_ends_are_kept(file: Path) -> None:
    replace(file, "a = 1\r\nb = 2\n")
    assert read(file) == "a = 1\r\nb = 2\n"


def test_a_reader_sees_the_old_text_or_the_new_one_and_never_half_of_it(file: Path) -> None:
    texts = {"a" * 100_000, "b" * 100_000}
    replace(file, "a" * 100_000)
    seen = set()
    ended = threading.Event()

    def look() -> None:
        while not ended.is_set():
            seen.add(read(file))

    reader = threading.Thread(target=look)
    reader.start()
    for _ in range(20):
        for text in sorted(texts):
            replace(file, text)
    ended.set()
    reader.join()
    assert seen <= texts


def test_who_may_not_replace_it_is_told_so_and_it_stays_as_it_was() -> None:
    """As a user who may write neither the file nor its directory, whoever runs this test."""
    script = (
        "import os, sys\nfrom pathlib import Path\n"
        "from hapticd.config.file import replace\nfrom hapticd.errors import ConfigError\n"
        f"if os.geteuid() == 0:\n    os.setgroups([]); os.setgid({NOBODY}); os.setuid({NOBODY})\n"
        "try:\n    replace(Path(sys.argv[1]), 'new')\nexcept ConfigError as error:\n    print(error)\n"
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "lab.toml"
        file.write_text("# one\n")
        file.chmod(0o444)
        folder.chmod(0o555)
        done = subprocess.run([sys.executable, "-c", script, file], capture_output=True, text=True, check=False)
        folder.chmod(0o755)
        assert done.stdout == f"{file}: this user may not replace it and keep its owner: use sudo\n", done.stderr
        assert file.read_text() == "# one\n"


def test_a_file_that_cannot_be_written_is_as_it_was(file: Path) -> None:
    gone = file.with_name("gone") / "lab.toml"
    with pytest.raises(ConfigError, match=r"lab\.toml"):
        replace(gone, "# two\n")
    assert not gone.parent.exists()


def test_every_way_a_file_cannot_be_read_is_a_line(tmp_path: Path) -> None:
    (tmp_path / "latin").write_bytes(b"a = 1\n# \xe4\n")
    (tmp_path / "large").write_bytes(b"#" * (1 << 20) + b"#")
    for name, said in (
        ("absent", "no such file"),
        (".", "is a directory"),
        ("latin", "line 2: not UTF-8"),
        ("large", "1 MiB"),
        ("a\0b", "cannot be read"),
    ):
        with pytest.raises(ConfigError, match=said):
            read(f"{tmp_path}/{name}")

"""What a check has found, and how a check is run so that its own failure is a finding too."""

from __future__ import annotations

import errno
import os
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

Mark = Literal["ok", "advice", "problem", "unknown"]

_PATH_UNDER_SUDO = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check has found.

    Attributes:
        mark: `ok`; `advice`, the loop runs but could run better; `problem`, the loop runs badly or not at all;
            `unknown`, the check could not tell.
        text: what is so.
        mend: lines for a shell that mend it, as they stand; one that no command can mend is a comment, `# ...`.
        check: which check found it, such as `processor.governor`; `examine` fills it in.
        title: the same for people.
    """

    mark: Mark
    text: str
    mend: tuple[str, ...] = ()
    check: str = ""
    title: str = ""


@dataclass(frozen=True, slots=True)
class Check:
    """A check that can be made.

    Attributes:
        name: its stable name.
        title: what people call it, at most 12 characters.
        look: makes it.
    """

    name: str
    title: str
    look: Callable[[], Finding | Iterable[Finding]]


def ok(text: str) -> Finding:
    """A finding: nothing to mend."""
    return Finding("ok", text)


def advice(text: str, *mend: str) -> Finding:
    """A finding: it could be better."""
    return Finding("advice", text, mend)


def problem(text: str, *mend: str) -> Finding:
    """A finding: it keeps the loop from running well."""
    return Finding("problem", text, mend)


def unknown(reason: str, *mend: str) -> Finding:
    """A finding: the check could not tell."""
    return Finding("unknown", f"could not tell: {reason}", mend)


def examine(check: Check) -> list[Finding]:
    """Make a check; an error in it becomes a finding."""
    try:
        found = check.look()
        findings = [found] if isinstance(found, Finding) else list(found)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        as_root = error.errno in (errno.EACCES, errno.EPERM) and os.geteuid() != 0
        findings = [unknown(f"{where}{error.strerror or error}", *(["sudo " + own_command("doctor")] * as_root))]
    except Exception as error:  # noqa: BLE001 - a check that fails must not take the others with it
        findings = [unknown(f"{type(error).__name__}: {error}")]
    return [
        replace(finding, check=check.name, title=check.title, mend=tuple(map(for_this_user, finding.mend)))
        for finding in findings
    ]


def own_command(*words: str) -> str:
    """A command line of hapticd that also works after `sudo`, which looks in fewer places."""
    known = shutil.which("hapticd", path=_PATH_UNDER_SUDO) is not None
    program = "hapticd" if known else str(Path(sys.executable).with_name("hapticd"))
    return shlex.join([program, *words])


def for_this_user(command: str) -> str:
    """A command as this user can type it: root needs no sudo, and sudo does not find every hapticd."""
    command = command.replace("sudo hapticd ", f"sudo {own_command()} ")
    return command if os.geteuid() else command.replace("sudo ", "")

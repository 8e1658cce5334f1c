"""The form of the daemon's own file, and an edit of it through the daemon's own checks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hapticd.client import RefusedConfigError
from hapticd.client.commands import command
from hapticd.client.edited import put_into_force
from hapticd.config.editing import with_edits, with_law
from hapticd.config.file import read
from hapticd.config.loading import parse
from hapticd.errors import ConfigError, HapticdError
from hapticd_views.dashboard.form import form
from hapticd_views.dashboard.target import Target

_PARAMS = "controller.params."
_EDITABLE = re.compile(r"controller\.params\.\w+|safety\.\w+|scene\.(walls|objects)\[\d{1,2}\]\.\w+")

Values = dict[str, bool | int | float | str | None]


class Editor:
    """Reads and edits the file that a daemon on this computer has in force.

    Args:
        target: the daemon.
    """

    def __init__(self, target: Target) -> None:
        self._target = target

    def form(self) -> dict[str, Any]:
        """The form as the file is now, with the file's name and the hash of its text.

        Raises:
            HapticdError: there is none: no daemon answers, it runs elsewhere, or the file cannot be used.
        """
        path = self._file()
        loaded = parse(read(path), str(path))
        return {"file": str(path), "hash": loaded.hash, **form(loaded)}

    def edit(self, file_hash: str, law: str, values: Values) -> dict[str, str]:
        """Put a law and values into the file and into force.

        Args:
            file_hash: of the text that the edit was made from, as the form said it.
            law: name of the law.
            values: by key; None takes the key out. Parameters are those of `law`.

        Returns:
            What was wrong, by key, with "" for what belongs to none; empty when all of it is in force. When there is
            something, nothing has changed.
        """
        try:
            path = self._file()
            before = read(path)
            name = str(path)
            if parse(before, name).hash != file_hash:
                return {"": "the file was edited by others since this form was made: look at it again"}
            odd = [key for key in values if not _EDITABLE.fullmatch(key)]
            if odd:
                return {"": f"{odd[0]}: the form has no such key"}
            params = {key.removeprefix(_PARAMS): value for key, value in values.items() if key.startswith(_PARAMS)}
            others = {key: value for key, value in values.items() if not key.startswith(_PARAMS)}
            after = with_law(with_edits(before, name, others), name, law, params)
            put_into_force(path, before, after, self._target.instance)
        except (ConfigError, RefusedConfigError) as error:
            return _by_key(str(error))
        except HapticdError as error:
            return {"": str(error)}
        return {}

    def _file(self) -> Path:
        if not self._target.is_here:
            raise ConfigError("the daemon runs on another computer: edit its file there")
        return Path(command("status", self._target.instance)["status"]["config_file"])


def _by_key(text: str) -> dict[str, str]:
    """Problems, a line each as `file: key = value: sentence` or `file: key: sentence`, by their keys."""
    found: dict[str, str] = {}
    for line in text.splitlines():
        match = re.fullmatch(r".*?: ([a-z_]+[\w.\[\]]*)( = .*?)?: (.*)", line)
        key, sentence = (match[1], match[3]) if match else ("", line)
        found[key] = f"{found[key]}; {sentence}" if key in found else sentence
    return found

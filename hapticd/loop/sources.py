"""What a loop has loaded from files, beside what the loop before it had: nothing that was edited arms by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hapticd import plugins
from hapticd.config.loading import LoadedConfig
from hapticd.loop.resume import ResumeState
from hapticd.tick.space.solid import fields_of


def loaded(before: ResumeState, config: LoadedConfig) -> ResumeState:
    """The same with what this process has loaded; where that was edited since, the device stays disarmed.

    Args:
        before: what the loop before has left.
        config: what the loop is to run.

    Raises:
        ConfigError: a file of the scene cannot be read.
    """
    now = replace(
        before,
        law_code=plugins.code_of(config.law),
        port_law_code=plugins.code_of(config.port_law),
        fields=fields_of(config.config.scene.objects),
    )
    return replace(now, may_arm=False) if any(edited(before, now, config)) else now


def edited(before: ResumeState, now: ResumeState, config: LoadedConfig) -> Iterator[str]:
    """What was edited since the loop before loaded it, for people.

    Args:
        before: what that loop has left.
        now: the same as `loaded`.
        config: what the loop is to run.
    """
    if before.law_code not in (0, now.law_code):
        yield f"law {config.config.controller.law}"
    if before.port_law_code not in (0, now.port_law_code):
        yield f"remote law {config.config.remote.law}"
    if before.fields not in (0, now.fields):
        yield "a field of the scene"

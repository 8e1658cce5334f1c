"""hapticd: a service that owns a kinesthetic haptic device and publishes what it does, tick by tick.

The front door: `connect` to a running daemon; `load` a configuration, `simulate` it offline, `sweep` one of its values.
Each is imported when it is first used, so that `import hapticd` costs nothing.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hapticd.client.daemon import connect
    from hapticd.config.loading import LoadedConfig, load
    from hapticd.offline.outcome import Outcome
    from hapticd.offline.run import Run
    from hapticd.offline.simulate import simulate
    from hapticd.offline.sweep import Grid, sweep

from hapticd.version import __version__

__all__ = ["Grid", "LoadedConfig", "Outcome", "Run", "__version__", "connect", "load", "simulate", "sweep"]

_HOMES = {
    "connect": "hapticd.client.daemon",
    "Grid": "hapticd.offline.sweep",
    "load": "hapticd.config.loading",
    "LoadedConfig": "hapticd.config.loading",
    "Outcome": "hapticd.offline.outcome",
    "Run": "hapticd.offline.run",
    "simulate": "hapticd.offline.simulate",
    "sweep": "hapticd.offline.sweep",
}

if not TYPE_CHECKING:  # else a checker would take every misspelt name for one of these

    def __getattr__(name: str) -> object:
        if name not in _HOMES:
            raise AttributeError(f"module 'hapticd' has no attribute {name!r}")
        from importlib import import_module

        found = getattr(import_module(_HOMES[name]), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

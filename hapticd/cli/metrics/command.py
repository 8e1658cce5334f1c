"""`hapticd metrics`: what every daemon of this computer says of itself, for Prometheus."""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from hapticd.client.commands import command
from hapticd.errors import ConfigError, HapticdError, InstanceError
from hapticd.paths import living_instances
from hapticd.telemetry.records import Status

if TYPE_CHECKING:
    from prometheus_client.core import Metric

    from hapticd.cli.metrics.families import Daemons

ANSWER_S = 1.0
"""How long a daemon may take to answer [s]; who scrapes waits for 10 s."""


def metrics(
    listen: Annotated[
        str | None,
        typer.Option("--listen", metavar="HOST:PORT", help="Serve them there until interrupted, by HTTP."),
    ] = None,
) -> None:
    """Print what every daemon says of itself, for Prometheus.

    Rate, lateness, armed or not, faults and more; docs/metrics.md has all of it, and a dashboard for Grafana. With
    --listen they are served at http://HOST:PORT/metrics, by this process and not by a daemon; who may connect there can
    read them. Exits with 1 when nothing runs that could be asked, unless it serves.

    Example: hapticd metrics --listen 127.0.0.1:9876
    """
    try:
        import prometheus_client
    except ModuleNotFoundError:
        raise HapticdError("this needs prometheus_client: pip install 'hapticd[metrics]'") from None
    from hapticd.cli.metrics.server import Asked

    if listen is not None:
        _serve(listen)
        return
    registry = prometheus_client.CollectorRegistry()
    daemons = _daemons()
    registry.register(Asked(lambda: _metrics(daemons)))
    typer.echo(prometheus_client.generate_latest(registry).decode(), nl=False)
    if not any(status for _, status in daemons):
        raise InstanceError("no daemon answers: start one with `hapticd run` or `systemctl start hapticd`")


def _serve(listen: str) -> None:
    from hapticd.cli.metrics.server import Asked, MetricsServer

    host, port = _address(listen)
    try:
        server = MetricsServer(host, port, Asked(lambda: _metrics(_daemons())))
    except (OSError, UnicodeError) as error:  # the latter of a host that is no name, such as a..b
        why = error.strerror if isinstance(error, OSError) else "is no name of a host"
        raise HapticdError(f"--listen {listen}: {why}; name another address or port") from error
    signal.signal(signal.SIGTERM, _end)
    with server:
        typer.echo(f"serving {server.url}", err=True)
        server.serve_forever(poll_interval=60.0)  # a connection wakes it


def _address(listen: str) -> tuple[str, int]:
    host, colon, port = listen.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isdecimal() and int(port) < 1 << 16):
        raise ConfigError(f"--listen {listen}: must be HOST:PORT, such as 127.0.0.1:9876 or [::1]:9876")
    return host, int(port)


def _end(_signal: int, _frame: FrameType | None) -> None:
    sys.exit(0)


def _daemons() -> Daemons:
    return [(name, _status(name)) for name in living_instances()]


def _status(name: str) -> Status | None:
    try:
        return Status.of(command("status", name, timeout_s=ANSWER_S)["status"])
    except InstanceError:
        return None


def _metrics(daemons: Daemons) -> list[Metric]:
    from hapticd.cli.metrics.families import families

    return list(families(daemons))

"""`hapticd hapkit-table`: the angle table of a Hapkit's board.h, measured by swinging the handle."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import ConfigError
from hapticd.paths import directory
from hapticd.progress import progress_bar

_HEADER = "drivers/firmware/serial-rig/hapkit/board.h"


def hapkit_table(
    board: Annotated[
        Path | None, typer.Option(help="The board.h that the Hapkit was flashed with; the shipped one if not given.")
    ] = None,
    port: Annotated[str, typer.Option(help='Serial port, as device.options.port: "auto" is the only one on USB.')] = (
        "auto"
    ),
    baud: Annotated[int, typer.Option(min=1200, max=12_000_000, help="Bits a second.")] = 1_000_000,
    longest: Annotated[float, typer.Option(min=1.0, max=3600.0, help="Swinging ends after this time [s].")] = 60.0,
    write: Annotated[bool, typer.Option("--write", help="Put the table into --board.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure the angle table of a Hapkit while you swing its handle.

    An uneven magnet makes positions wave by a part of a millimetre, the same over each half turn of the motor's shaft.
    Swing the handle to and fro over most of its travel, about twice a second, until the bar is full; turn a little
    elsewhere each time, and not at the stops. The motor gets no force, and no ruler is needed. End a daemon that has
    the port first.

    Example: hapticd hapkit-table --board hapkit/board.h --write
    """
    from hapticd.replacing import write as replace
    from hapticd_drivers.rig.angle_table import ENOUGH_PASSES
    from hapticd_drivers.rig.board_header import read_table, table_line, with_table
    from hapticd_drivers.rig.serial_ports import choose
    from hapticd_drivers.rig.swinging import measure

    if write and board is None:
        raise ConfigError("--write: say into which header with --board")
    header = board or directory("drivers") / Path(_HEADER).relative_to("drivers")
    try:
        text = header.read_text()
        before = read_table(text)
    except (OSError, UnicodeDecodeError, ConfigError) as error:
        raise ConfigError(f"{header}: {getattr(error, 'strerror', None) or error}") from None
    where = choose(port)
    typer.echo(
        "The motor gets no force. Switch its supply off, take the handle, and swing it to and fro over most", err=True
    )
    typer.echo("of its travel, about twice a second, turning elsewhere each time, until the bar is full.", err=True)
    with progress_bar(ENOUGH_PASSES, "half turns") as tell:
        found = measure(where, baud, before, longest, lambda more: tell(advance=more))
    if write:
        replace(header, with_table(text, found.nodes).encode())
    if as_json:
        typer.echo(json.dumps({**asdict(found), "board": str(header), "written": write}))
        return
    typer.echo(table_line(found.nodes))
    typer.echo(
        f"from {found.passes} half turns, each number good to {found.error_counts:.1f} counts; the table before was "
        f"off by up to {found.uneven_counts:.1f}",
        err=True,
    )
    done = f"written to {header}" if write else "put this line into board.h"
    typer.echo(f"{done}; then: make BOARD=hapkit flash, hapticd calibrate", err=True)

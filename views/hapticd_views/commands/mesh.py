"""`hapticd mesh`: a mesh into the distance field that a tick reads."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import ConfigError, HapticdError
from hapticd.progress import progress_bar

_ALONG = 64


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The mesh, .stl or .obj.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE.field", help="The field; FILE.field if not given.")
    ] = None,
    voxel: Annotated[
        float | None, typer.Option(help="Between points of the grid [m]; a 64th of the longest side if not given.")
    ] = None,
    scale: Annotated[
        float, typer.Option(help="Metres that a unit of the file is: 0.001 where it is drawn in mm.")
    ] = 1.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Make a distance field of a mesh, for a scene with shape = "mesh".

    The mesh must be closed and face outward. What is stated with the field is how far its distance is off near the
    surface: a smaller --voxel makes less of it, most of all at sharp edges, where it is a quarter of the spacing.

    Example: hapticd mesh bracket.stl --scale 0.001 -o bracket.field
    """
    try:
        from hapticd_views.mesh.reading import read_mesh
        from hapticd_views.mesh.sampling import sample
    except ImportError as missing:
        raise HapticdError(f"{missing.name} is not installed: pip install 'hapticd[mesh]'") from None
    from hapticd.replacing import place, write

    for option, value in (("--scale", scale), ("--voxel", voxel)):
        if value is not None and not 0.0 < value < math.inf:
            raise ConfigError(f"{option} {value:g}: must be above 0")
    path = output or file.parent / f"{file.stem}.field"
    place(path, overwrite)
    mesh = read_mesh(file, scale)
    spacing_m = max(mesh.size_m) / _ALONG if voxel is None else voxel
    with progress_bar(1.0, file.name) as advance:
        field, error = sample(mesh, spacing_m, advance)
    content = field.pack()
    write(path, content)
    if as_json:
        typer.echo(
            json.dumps(
                {
                    "output": str(path),
                    "triangles": len(mesh.faces),
                    "size_m": mesh.size_m,
                    "points": field.counts,
                    "voxel_m": spacing_m,
                    "bytes": len(content),
                    "error_bound_m": field.error_m,
                    "error_rms_m": error.typical_m,
                    "error_points": error.points,
                }
            )
        )
        return
    nx, ny, nz = field.counts
    sides = " x ".join(f"{1e3 * side:.4g}" for side in mesh.size_m)
    typer.echo(f"{file}: {len(mesh.faces)} triangles, {sides} mm, closed")
    typer.echo(f"{path}: {nx} x {ny} x {nz} points, {1e3 * spacing_m:.4g} mm apart, {len(content) / 2**20:.2g} MiB")
    typer.echo(
        f"distance near the surface: off by at most {1e3 * field.error_m:.3g} mm, "
        f"{1e3 * error.typical_m:.3g} mm rms, over {error.points} points"
    )

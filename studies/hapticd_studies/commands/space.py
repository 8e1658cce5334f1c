"""`hapticd study space`: what a device in space holds, by direction and place."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from hapticd.errors import ConfigError
from hapticd.progress import progress_bar
from hapticd_studies.grid.output import require_extra, require_folder, write

_FILES = ("space.csv", "space.json", "space.png")
_MOST_PLACES = 1_000_000
_HAND_N_PER_M = 1.0


def command(
    mass: Annotated[
        str, typer.Option(help="Of the device [kg]: one number, one an axis, or nine of a matrix, with commas.")
    ] = "0.1,0.25,0.5",
    damping: Annotated[str, typer.Option(help="Viscous friction of the device, in the same way [N s/m].")] = "4",
    linkage: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="On three arms, at this place [m]; --mass is one number, of the middle."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Of the loop [Hz].")] = 1000.0,
    delay: Annotated[int, typer.Option(min=0, max=16, help="Samples until a force acts.")] = 0,
    places: Annotated[
        int, typer.Option(help="Random devices at random places to step against their eigenvalues.")
    ] = 1000,
    seed: Annotated[int, typer.Option(help="Of these.")] = 1,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("space"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Find what stiffness a device with three axes holds, by direction and place, and whether stepping agrees.

    The limit is exact: eigenvalues of the sampled loop, delay included, on a plane that faces every way, in a hand of
    1 N/m. Then random devices press random shapes, edges and corners, and the loop's own proxy is stepped there.
    Writes a picture, CSV and JSON.

    Example: hapticd study space --mass 0.2,0.2,0.35 --damping 4.4 --delay 1

    Example: hapticd study space --mass 0.25 --linkage 0.06,0,0.04
    """
    require_extra("study", "numpy", "scipy", "matplotlib")
    import numpy as np

    from hapticd_studies.space.linear import SpaceLoop
    from hapticd_studies.space.plot import draw
    from hapticd_studies.space.study import TURNS, study

    if not 1.0 <= rate <= 1e5:
        raise ConfigError(f"--rate {rate:g}: must be from 1 to 100000 Hz")
    if not 0 <= places <= _MOST_PLACES:
        raise ConfigError(f"--places {places}: must be from 0 to {_MOST_PLACES}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    weighs = _matrix("--mass", mass) if linkage is None else _on_arms(mass, linkage)
    loop = SpaceLoop(weighs, _matrix("--damping", damping), _HAND_N_PER_M * np.eye(3), 1.0 / rate, delay)
    require_folder(output, _FILES)
    with progress_bar(TURNS + places, "space") as tell:
        found = study(loop, places, seed, lambda done: tell(completed=done))
    for file, content in zip(_FILES, (found.csv(), found.json(), draw(found)), strict=True):
        write(output / file, content)
    if as_json:
        typer.echo((output / "space.json").read_text(), nl=False)
        return
    console = Console(highlight=False)
    console.print(_held(found))
    if found.verdicts:
        console.print(_agreement(found))
    console.print(f"{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)


def _matrix(option: str, text: str) -> Any:
    """A symmetric, positive definite matrix from one, three or nine numbers."""
    import numpy as np

    try:
        numbers = [float(each) for each in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (1, 3, 9) or not all(map(math.isfinite, numbers)):
        raise ConfigError(f"{option} {text}: must be one number, three or nine, with commas")
    matrix = np.array(numbers).reshape(3, 3) if len(numbers) == 9 else np.diag(np.broadcast_to(numbers, 3).copy())
    if not np.array_equal(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() <= 0.0:
        raise ConfigError(f"{option} {text}: must be above 0 in every direction, a matrix symmetric")
    return matrix


def _on_arms(mass: str, place: str) -> Any:
    """The mass matrix of the linkage that the simulated device assumes, at a place."""
    import numpy as np

    from hapticd.simulation.space.linkage import REACH_M, mass_matrix

    try:
        at = [float(each) for each in place.split(",")]
        (mass_kg,) = (float(each) for each in mass.split(","))
    except ValueError:
        raise ConfigError(
            f"--linkage {place} --mass {mass}: must be three numbers with commas, and one mass, as 0.06,0,0.04 and 0.25"
        ) from None
    if len(at) != 3 or not all(abs(along) <= reach for along, reach in zip(at, REACH_M, strict=True)):
        x, y, z = (f"{1e3 * reach:g}" for reach in REACH_M)
        raise ConfigError(f"--linkage {place}: must be within {x}, {y} and {z} mm of the middle along x, y and z")
    if not 0.0 < mass_kg < math.inf:
        raise ConfigError(f"--mass {mass}: must be above 0")
    return np.array(mass_matrix(mass_kg, (0.0, 0.0, 0.0), *at))


def _held(found: Any) -> Table:
    table = Table(title="What a plane without friction may have, by the way it faces")
    for name in ("", "normal", "held [N/m]", "2 b_n/T [N/m]", "passive [N/m]"):
        table.add_column(name, justify="left" if name in ("", "normal") else "right")
    for name, each in (("weakest", found.weakest), ("strongest", found.strongest)):
        x, y, z = each.normal
        table.add_row(
            name,
            f"{x:+.2f} {y:+.2f} {z:+.2f}",
            f"{each.exact_n_per_m:.0f}",
            f"{each.estimate_n_per_m:.0f}",
            f"{each.passive_n_per_m:.0f}",
        )
    table.add_row("where friction sticks", "any", f"{found.sticking_n_per_m:.0f}", "", "")
    return table


def _agreement(found: Any) -> Table:
    table = Table(title="Random places: eigenvalues against stepping")
    for name in ("surface", "places", "stable", "stepping agrees"):
        table.add_column(name, justify="left" if name == "surface" else "right")
    for each in found.verdicts:
        table.add_row(each.kind, str(each.places), str(each.stable), str(each.agree))
    total = [sum(getattr(each, name) for each in found.verdicts) for name in ("places", "stable", "agree")]
    table.add_row("all", *map(str, total))
    return table

"""What a switch costs the tick that it comes between: counted in instructions of the interpreter, not timed."""

from __future__ import annotations

import pytest

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.operations import count_operations
from hapticd.supervisor.reload import switch_request
from tests.loop.bench import Bench

WALLS = 8
CHANGES = {
    "stiffer": (2000.0, "none", 0.0),
    "under another law": (1000.0, "energy-cycle", 0.0),
    "elsewhere, under another law": (2000.0, "ring-damping", 0.0005),
}


def pressed(walls: int, stiffness_n_per_m: float, law: str, at_m: float) -> LoadedConfig:
    """Walls close beside each other, all of them pressed."""
    table = "[[scene.walls]]\nposition_m = {}\nstiffness_n_per_m = {}\n"
    tables = [table.format(at_m - 0.001 * number, stiffness_n_per_m) for number in range(walls)]
    heavy = "[device.options]\nmass_kg = 1e4\ninitial_position_m = -0.02\n"
    return parse(f"{heavy}{''.join(tables)}[controller]\nlaw = '{law}'\n", "pressed")


def switched(bench: Bench, was: LoadedConfig, wanted: LoadedConfig) -> list[int]:
    """Instructions of each slice of the switch, one between two ticks."""
    bench.shared.post(switch_request(was, wanted))
    found = []
    while not bench.answered:
        found.append(count_operations(bench.loop.requests.work))
        if not bench.answered:
            bench.ticks(1)
    assert bench.shared.verdict() == ""
    return found


def slices(walls: int, change: str) -> tuple[list[int], int]:
    """Instructions of each slice of a switch, and of the tick of what is switched to, all walls touched."""
    was, wanted = pressed(walls, 1000.0, "none", 0.0), pressed(walls, *CHANGES[change])
    bench = Bench(was)
    assert bench.ask(do="arm") == ""
    bench.ticks(5)
    found = switched(bench, was, wanted)
    assert all(contact.in_contact for contact in bench.tick.contacts)
    tick = count_operations(lambda: bench.ticks(1))
    bench.close()
    return found, tick


@pytest.mark.parametrize("change", CHANGES)
def test_to_change_eight_walls_costs_no_tick_more_than_it_has_itself(change: str) -> None:
    """C9: it is made ready wall by wall, and what is left for the last slice is less than the tick of those walls."""
    found, tick = slices(WALLS, change)
    assert len(found) > WALLS
    assert max(found) < tick


def test_what_is_made_ready_for_one_wall_comes_in_slices_of_one_wall() -> None:
    one, _ = slices(1, "elsewhere, under another law")
    eight, _ = slices(WALLS, "elsewhere, under another law")
    assert len(eight) >= len(one) + 2 * (WALLS - 1)  # its table, and its contact
    assert sorted(eight)[-4] <= max(one)  # all but taking it over, and finding which wall goes on with which


def slices_of_balls(balls: int, apart_m: float) -> list[int]:
    """Instructions of each slice of a reload from one ball to many, in a row."""
    space = "[device.options]\naxes = 3\n"
    table = "[[scene.objects]]\nname = 'b{}'\nshape = 'sphere'\nradius_m = 0.01\nposition_m = [{}, 0.0, -0.5]\n"
    table += "stiffness_n_per_m = {}\n"
    was, wanted = (
        parse(space + "".join(table.format(at, at * apart_m, 1000.0 + at) for at in range(count)), "balls")
        for count in (1, balls)
    )
    bench = Bench(was)
    bench.ticks(5)
    found = switched(bench, was, wanted)
    bench.close()
    return found


@pytest.mark.parametrize("apart_m", [0.03, 0.002], ids=["apart", "over each other"])
def test_objects_are_made_ready_one_by_one(apart_m: float) -> None:
    """Taking them over is one slice; of those before none grows with the pairs that there are."""
    few, many = sorted(slices_of_balls(16, apart_m)), sorted(slices_of_balls(64, apart_m))
    assert len(many) > 3 * len(few)
    assert many[-2] < 2 * few[-2]

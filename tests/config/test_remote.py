"""What clients may drive is named in the file, with its limits, and each name stands once."""

from __future__ import annotations

import pytest

from hapticd.config.effective import effective_toml
from hapticd.config.loading import LoadedConfig, load
from hapticd.config.models import SceneConfig
from hapticd.config.ports import PortLimits, port_limits
from hapticd.errors import ConfigError

COUPLING = '[[scene.couplings]]\nname = "{}"\nstiffness_n_per_m = 2000.0\nmax_force_n = 6.0\n'
FORCE = '[[scene.forces]]\nname = "{}"\nmax_force_n = 3.0\n'
BALL = '[[scene.objects]]\nname = "{}"\nshape = "sphere"\nradius_m = 0.03\nstiffness_n_per_m = 800.0\n'


def scene(*tables: str) -> LoadedConfig:
    return load("\n".join(tables) + "\n")


def ports(loaded: LoadedConfig) -> list[PortLimits]:
    return port_limits(loaded.config.scene)


def test_ports_come_as_objects_couplings_forces_with_their_limits() -> None:
    loaded = scene(
        FORCE.format("field"),
        COUPLING.format("tool") + "damping_n_s_per_m = 5.0",
        BALL.format("still"),
        BALL.format("ball") + "remote = true\nmax_speed_m_per_s = 0.5",
    )
    assert ports(loaded) == [
        PortLimits("ball", "object", 0.1, 800.0, 0.0, 0.0, 0.5),
        PortLimits("tool", "coupling", 0.1, 2000.0, 5.0, 6.0, 1.0),
        PortLimits("field", "force", 0.05, 0.0, 0.0, 3.0, 0.0, 1.0),
    ]
    assert ports(load(effective_toml(loaded))) == ports(loaded)
    # As it comes to the loop:
    assert SceneConfig.model_validate(loaded.config.scene.model_dump()) == loaded.config.scene


@pytest.mark.parametrize("key", ["hold_s", "max_speed_m_per_s"])
def test_an_object_that_no_client_moves_has_no_keys_of_a_client(key: str) -> None:
    with pytest.raises(ConfigError, match=rf"scene\.objects\[0\].*{key} = 0\.1: only an object with remote = true"):
        scene(BALL.format("ball") + f"{key} = 0.1")


@pytest.mark.parametrize(
    ("tables", "problem"),
    [
        ([COUPLING.format("a"), COUPLING.format("a")], 'a coupling and a coupling have the name "a"'),
        ([COUPLING.format("a"), FORCE.format("a")], 'a coupling and a force have the name "a"'),
        ([BALL.format("a"), FORCE.format("a")], 'an object and a force have the name "a"'),
        ([COUPLING.format(i) for i in range(9)] + [FORCE.format(-i) for i in range(1, 9)], "must be 16 together"),
        ([COUPLING.format("a").replace("6.0", "0.0")], r"max_force_n = 0\.0: must be more than 0"),
        ([FORCE.format("a") + "hold_s = 0.0"], r"scene\.forces\[0\]\.hold_s = 0\.0: must be more than 0"),
        ([FORCE.format("a") + "stiffness_n_per_m = 1.0"], "unknown key"),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(tables: list[str], problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        scene(*tables)


def test_sixteen_couplings_and_forces_are_taken() -> None:
    tables = [COUPLING.format(index) for index in range(8)] + [FORCE.format(index) for index in range(8, 16)]
    assert [port.name for port in ports(scene(*tables))] == [str(index) for index in range(16)]

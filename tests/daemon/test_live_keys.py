"""Every key of the configuration either changes under a running loop or says that it needs a restart."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import pytest

from hapticd.config.loading import parse
from hapticd.config.models import Config
from hapticd.config.problems import tables_of
from hapticd.settings import Table
from hapticd.supervisor.reload import needs_restart, switch_request
from hapticd.tick.guard import Guard
from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_switching import Asker
from tests.loop.bench import Bench

HAND = "hand = { force = { profile = 'constant', newton = -3.0 }, stiffness_n_per_m = 2000.0 }\n"
DEVICE = f"[device.options]\n{HAND}"
WALL = "[[scene.walls]]\nstiffness_n_per_m = 12000.0\n"
BASE = DEVICE + WALL
COUPLING = "[[scene.couplings]]\nname = 'tool'\nstiffness_n_per_m = 500.0\nmax_force_n = 6.0\n"
FORCE = "[[scene.forces]]\nname = 'field'\nmax_force_n = 3.0\n"

LOOP: dict[str, tuple[str, Callable[[Bench], object], object]] = {
    "scene.walls[].axis": (WALL + "axis = 'y'\n", lambda bench: bench.tick.contacts[0].wall.config.axis, "y"),
    "scene.walls[].free_side": (
        WALL + "free_side = 'negative'\n",
        lambda bench: bench.tick.contacts[0].wall.outward,
        -1.0,
    ),
    "scene.walls[].position_m": (
        WALL + "position_m = 0.01\n",
        lambda bench: bench.tick.contacts[0].wall.position_m,
        0.01,
    ),
    "scene.walls[].stiffness_n_per_m": (
        WALL.replace("12000", "9000"),
        lambda bench: bench.tick.contacts[0].wall.stiffness_n_per_m,
        9000.0,
    ),
    "scene.walls[].damping_n_s_per_m": (
        WALL + "damping_n_s_per_m = 2.0\n",
        lambda bench: bench.tick.contacts[0].wall.damping_n_s_per_m,
        2.0,
    ),
    "scene.walls[].changes[].at_s": (
        WALL + "changes = [{ at_s = 5.0, stiffness_n_per_m = 7000.0 }]\n",
        lambda bench: bench.tick.contacts[0].wall.changes_left,
        True,
    ),
    "scene.walls[].changes[].stiffness_n_per_m": (
        WALL + "changes = [{ at_s = 0.0, stiffness_n_per_m = 7000.0 }]\n",
        lambda bench: bench.ticks(2).contacts[0].wall.stiffness_n_per_m,
        7000.0,
    ),
    "scene.walls[].changes[].damping_n_s_per_m": (
        WALL + "changes = [{ at_s = 0.0, damping_n_s_per_m = 3.0 }]\n",
        lambda bench: bench.ticks(2).contacts[0].wall.damping_n_s_per_m,
        3.0,
    ),
    "scene.couplings[].name": (
        WALL + COUPLING.replace("tool", "probe"),
        lambda bench: bench.tick.ports[0].name,
        "probe",
    ),
    "scene.couplings[].stiffness_n_per_m": (
        WALL + COUPLING.replace("500.0", "400.0"),
        lambda bench: bench.tick.ports[0].limits.stiffness_n_per_m,
        400.0,
    ),
    "scene.couplings[].damping_n_s_per_m": (
        WALL + COUPLING + "damping_n_s_per_m = 2.0\n",
        lambda bench: bench.tick.ports[0].limits.damping_n_s_per_m,
        2.0,
    ),
    "scene.couplings[].driven": (
        WALL + COUPLING + "driven = true\n",
        lambda bench: bench.tick.ports[0].limits.driven,
        True,
    ),
    "scene.couplings[].come_in_s": (
        WALL + COUPLING + "come_in_s = 0.5\n",
        lambda bench: bench.tick.ports[0].limits.come_in_s,
        0.5,
    ),
    "scene.couplings[].max_force_n": (
        WALL + COUPLING.replace("= 6.0", "= 4.0"),
        lambda bench: bench.tick.ports[0].limits.max_force_n,
        4.0,
    ),
    "scene.couplings[].hold_s": (
        WALL + COUPLING + "hold_s = 0.2\n",
        lambda bench: bench.tick.ports[0].limits.hold_s,
        0.2,
    ),
    "scene.couplings[].max_speed_m_per_s": (
        WALL + COUPLING + "max_speed_m_per_s = 0.5\n",
        lambda bench: bench.tick.ports[0].limits.max_speed_m_per_s,
        0.5,
    ),
    "scene.forces[].name": (WALL + FORCE.replace("field", "wind"), lambda bench: bench.tick.ports[0].name, "wind"),
    "scene.forces[].max_force_n": (
        WALL + FORCE.replace("= 3.0", "= 2.0"),
        lambda bench: bench.tick.ports[0].limits.max_force_n,
        2.0,
    ),
    "scene.forces[].hold_s": (WALL + FORCE + "hold_s = 0.2\n", lambda bench: bench.tick.ports[0].limits.hold_s, 0.2),
    "scene.forces[].unchanged_s": (
        WALL + FORCE + "unchanged_s = 0.0\n",
        lambda bench: bench.tick.ports[0].limits.unchanged_s,
        0.0,
    ),
    "controller.law": (
        WALL + "[controller]\nlaw = 'tdpa'\n",
        lambda bench: bench.tick.contacts[0].law.module.__name__,
        "hapticd_controllers.tdpa",
    ),
    "controller.params": (
        WALL + "[controller.params]\npull_after = 3\n",
        lambda bench: bench.tick.contacts[0].law.params.pull_after,
        3,
    ),
    "safety.profile": (WALL + "[safety]\nprofile = 'simulation'\n", lambda bench: settled(bench).max_force_n, 12.0),
    "safety.max_force_n": (WALL + "[safety]\nmax_force_n = 5.0\n", lambda bench: settled(bench).max_force_n, 5.0),
    "safety.max_axis_force_n": (
        WALL + "[safety]\nmax_axis_force_n = 4.0\n",
        lambda bench: settled(bench).max_axis_n,
        4.0,
    ),
    "safety.max_speed_m_per_s": (
        WALL + "[safety]\nmax_speed_m_per_s = 1.5\n",
        lambda bench: bench.tick.guard.max_speed_m_per_s,
        1.5,
    ),
    "safety.ramp_s": (WALL + "[safety]\nramp_s = 0.1\n", lambda bench: bench.tick.ramp_ticks, 100),
    "safety.supervisor_stall_s": (
        WALL + "[safety]\nsupervisor_stall_s = 3.0\n",
        lambda bench: bench.loop.session.stall_ns,
        3_000_000_000,
    ),
}
"""What the loop takes over: a text, where the loop shows it, and what it shows then."""

SUPERVISOR = {
    "safety.auto_arm": "[safety]\nauto_arm = true\n",  # of a device that is found again
    "telemetry.batch_ticks": "[telemetry]\nbatch_ticks = 5\n",
    "telemetry.every_ticks": "[telemetry]\nevery_ticks = 2\n",
    "telemetry.input_every_tick": "[telemetry]\ninput_every_tick = true\n",
    "remote.lease_s": "[remote]\nlease_s = 2.0\n",
    "faults.keep": "[faults]\nkeep = 3\n",
    "service.reload_on_save": "[service]\nreload_on_save = true\n",
}
"""What the supervisor takes over."""

RESTART = {
    "device.driver": "[device]\ndriver = 'omega7'\n",
    "device.options": f"[device.options]\nmass_kg = 0.3\n{HAND}",
    "device.accept_no_watchdog": f"[device]\naccept_no_watchdog = true\n{DEVICE}",
    "loop.rate_hz": f"{DEVICE}[loop]\nrate_hz = 2000.0\n",
    "loop.realtime": f"{DEVICE}[loop]\nrealtime = 'off'\n",
    "loop.priority": f"{DEVICE}[loop]\npriority = 70\n",
    "loop.cpu": f"{DEVICE}[loop]\ncpu = 0\n",
    "loop.law_budget": f"{DEVICE}[loop]\nlaw_budget = 0.6\n",
    "velocity.estimator": f"{DEVICE}[velocity]\nestimator = 'lowpass'\n",
    "velocity.samples": f"{DEVICE}[velocity]\nsamples = 4\n",
    "velocity.cutoff_hz": f"{DEVICE}[velocity]\ncutoff_hz = 100.0\n",
    "velocity.noise_m": f"{DEVICE}[velocity]\nnoise_m = 1e-6\n",
    "telemetry.ipc": f"{DEVICE}[telemetry]\nipc = false\n",
    "telemetry.tcp": f"{DEVICE}[telemetry]\ntcp = 'tcp://127.0.0.1:9871'\n",
    "telemetry.send_high_water": f"{DEVICE}[telemetry]\nsend_high_water = 500\n",
    "control.tcp": f"{DEVICE}[control]\ntcp = 'tcp://127.0.0.1:9870'\n",
    "remote.law": f"{DEVICE}[remote]\nlaw = 'tdpa'\n",
    "remote.params": f"{DEVICE}[remote.params]\nbase_s = 0.01\n",
    "remote.scene_tcp": f"{DEVICE}[remote]\nscene_tcp = 'tcp://127.0.0.1:9868'\n",
    "remote.state_tcp": f"{DEVICE}[remote]\nstate_tcp = 'tcp://127.0.0.1:9869'\n",
}
"""What is refused."""


BEFORE = {
    "safety.profile": "[safety]\nmax_force_n = 5.0\n",
    **{key: COUPLING for key in LOOP if key.startswith("scene.couplings")},
    **{key: FORCE for key in LOOP if key.startswith("scene.forces")},
}
"""What is in force before, where the defaults would show no difference."""


def settled(bench: Bench) -> Guard:
    """The guard when the ramps are over."""
    return bench.ticks(200).guard


def keys(model: type[Table], at: str = "") -> Iterator[str]:
    """Every key of a table, `walls[].axis` for those of its elements."""
    for name, field in model.model_fields.items():
        tables = [table for table in tables_of(field.annotation) if issubclass(table, Table)]
        if not tables:
            yield f"{at}{name}"
        for table in tables:
            yield from keys(table, f"{at}{name}{'[].' if 'tuple' in str(field.annotation) else '.'}")


def test_every_key_is_one_or_the_other() -> None:
    """Objects need three axes: tests/tick/space/test_changes.py has them."""
    of_one_axis = [key for key in keys(Config) if not key.startswith("scene.objects[].")]
    assert sorted([*LOOP, *SUPERVISOR, *RESTART]) == sorted(of_one_axis)


@pytest.mark.parametrize("key", LOOP)
def test_the_loop_takes_it_over(key: str) -> None:
    text, shown, expected = LOOP[key]
    start = parse(BASE + BEFORE.get(key, ""), "start")
    bench = Bench(start)
    bench.ticks(2)
    assert shown(bench) != expected
    wanted = parse(DEVICE + text, "lab.toml")
    assert not list(needs_restart(start, wanted))
    assert bench.ask(**switch_request(start, wanted)) == ""
    assert shown(bench) == expected
    bench.close()


def test_a_daemon_takes_the_one_kind_and_refuses_the_other_by_name() -> None:
    with (
        Daemon(BASE).wait_ready() as daemon,
        Asker(daemon) as ask,
        Subscriber(daemon.endpoint, "hapticd/status") as subscriber,
    ):
        now = subscriber.until("hapticd/status")["config_hash"]
        for key, text in RESTART.items():
            daemon.config.write_text(text + WALL)
            answer = ask("reload", wait=True)
            assert not answer["ok"], key
            assert re.search(rf"lab\.toml: {re.escape(key)}[ .].*: needs a restart, ", answer["text"]), (key, answer)
            assert ask("status")["status"]["config_hash"] == now, key
        for key, text in ({key: text for key, (text, *_) in LOOP.items()} | SUPERVISOR).items():
            daemon.config.write_text(DEVICE + text)
            assert ask("reload", wait=True) == {"ok": True, "text": ""}, key
            before, now = now, ask("status")["status"]["config_hash"]
            assert now != before, key

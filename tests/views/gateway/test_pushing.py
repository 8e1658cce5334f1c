"""Clients that push: through the limits of the configuration, one at a time, and never longer than they mean it."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator

import pytest
from websockets.sync.client import ClientConnection

from hapticd.client import Client, Position, Status
from tests.daemon.running import HAPTICD, Daemon
from tests.views.gateway.isaac import Isaac
from tests.views.gateway.served import PATIENCE_S, PROBE, Served, answer, force, position_m, told

HAND_N_PER_M = 200.0
MOST_N = 1.5
SEEN_M = 0.5e-3
"""Where the hand is seen to be pushed, if only for a moment."""
CONFIG = f"""
[device.options]
axes = 3
[device.options.space.hand]
aim = {{ path = "hold", at_m = [0.0, 0.0, 0.0] }}
stiffness_n_per_m = [{HAND_N_PER_M}, {HAND_N_PER_M}, {HAND_N_PER_M}]
damping_n_s_per_m = [10.0, 10.0, 10.0]
[[scene.forces]]
name = "field"
max_force_n = {MOST_N}
unchanged_s = 1.0
[[scene.couplings]]
name = "tool"
stiffness_n_per_m = 100.0
max_force_n = 1.0
[remote]
law = "none"
"""


@pytest.fixture(scope="module")
def daemon() -> Iterator[Daemon]:
    with Daemon(CONFIG) as daemon:
        yield daemon.wait_ready()


@pytest.fixture(scope="module")
def served(daemon: Daemon) -> Iterator[Served]:
    with Served(daemon.directory / "run", "--force", "field") as served:
        yield served


@pytest.fixture
def eye(served: Served) -> Iterator[ClientConnection]:
    """A client that only reads; the force is gone when a test begins."""
    with served.client() as client:
        told(client)
        waits(client, at_rest)
        yield client


def at_rest(at_m: tuple[float, float, float]) -> bool:
    return max(map(abs, at_m)) < 1e-4


def pushed(force_n: float) -> Callable[[tuple[float, float, float]], bool]:
    """Where this force along x puts the hand, within a tenth."""
    there_m = force_n / HAND_N_PER_M
    return lambda at_m: abs(at_m[0] - there_m) < 0.1 * abs(there_m) and at_rest((0.0, *at_m[1:]))


def waits(client: ClientConnection, where: Callable[[tuple[float, float, float]], bool], message: str = PROBE) -> None:
    """Exchange this message with the gateway until the device is where it should be."""
    end_s = time.monotonic() + PATIENCE_S
    while not where(at_m := position_m(answer(client, message))):
        assert time.monotonic() < end_s, at_m


def wobbling(client: ClientConnection, where: Callable[[tuple[float, float, float]], bool], force_n: float) -> None:
    """Push until the device is there, a little differently each time, as one does that computes."""
    end_s = time.monotonic() + PATIENCE_S
    for count in range(1_000_000):
        at_m = position_m(answer(client, force(force_n + 1e-6 * (count % 2))))
        if where(at_m):
            return
        assert time.monotonic() < end_s, at_m


def test_isaac_lab_pushes_the_hand_and_when_it_is_stopped_the_force_is_let_go(
    served: Served, eye: ClientConnection
) -> None:
    with Isaac(served.url) as isaac:
        isaac.push(1.0, 0.0, 0.0)
        waits(eye, pushed(1.0))
        assert isaac.read()[0] == pytest.approx(1.0 / HAND_N_PER_M, rel=0.3)  # of some milliseconds ago
        os.kill(isaac.process.pid, signal.SIGSTOP)
        waits(eye, at_rest)


def test_isaac_lab_whose_simulation_hangs_is_not_believed_for_ever(served: Served, eye: ClientConnection) -> None:
    """Its thread goes on sending the last force."""
    with Isaac(served.url) as isaac:
        isaac.push(1.0, 0.0, 0.0)
        waits(eye, pushed(1.0))
        waits(eye, at_rest)
        isaac.push(0.8, 0.0, 0.0)
        waits(eye, pushed(0.8))


def test_a_client_that_is_killed_lets_go_and_the_next_one_pushes(served: Served, eye: ClientConnection) -> None:
    with Isaac(served.url) as isaac:
        isaac.push(1.0, 0.0, 0.0)
        waits(eye, pushed(1.0))
    waits(eye, at_rest)
    wobbling(eye, pushed(-1.0), -1.0)


@pytest.mark.parametrize("key", ["values", "vector"])
def test_a_force_is_bounded_by_the_configuration(eye: ClientConnection, key: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    for count in range(1_000_000):
        at_m = position_m(answer(eye, force(1e6 + count % 2, key=key)))
        assert at_m[0] < 1.5 * MOST_N / HAND_N_PER_M
        if pushed(MOST_N)(at_m):
            return
        assert time.monotonic() < end_s, at_m


@pytest.mark.parametrize(
    "message", [PROBE, "{}", force(0.0), force(1.0, device="another"), force(float("nan")), "no JSON"]
)
def test_a_message_without_a_force_ends_it(eye: ClientConnection, message: str) -> None:
    wobbling(eye, pushed(1.0), 1.0)
    waits(eye, at_rest, message)


def test_one_client_pushes_at_a_time(served: Served, eye: ClientConnection) -> None:
    before = served.log.read_text().count("another client pushes")
    with served.client() as other:
        told(other)
        wobbling(other, pushed(1.0), 1.0)
        for _ in range(50):
            answer(other, force(1.0))
            answer(eye, force(-1.0))
        wobbling(other, pushed(1.0), 1.0)
    wobbling(eye, pushed(-1.0), -1.0)
    assert served.log.read_text().count("another client pushes") == before + 1


def test_a_client_that_pushes_and_does_not_read_is_let_go_and_costs_nothing(
    served: Served, daemon: Daemon, eye: ClientConnection
) -> None:
    """Its place in the gateway waits for it, and neither the others nor the loop do."""
    before_kb = served.memory_kb()
    with served.deaf() as deaf, Client(daemon.endpoint, topics=[Position, Status]) as ticks:
        ticks.wait_for(Status, timeout_s=PATIENCE_S)  # it hears every tick from now on
        deaf.say(force(1.0))
        ticks.wait_for(Position, lambda tick: tick.position_m[0] > SEEN_M, timeout_s=PATIENCE_S)
        waits(eye, at_rest)
        assert served.memory_kb() < before_kb + 2_000
    with Client(daemon.endpoint, topics=[Status]) as client:
        status = client.wait_for(Status, timeout_s=PATIENCE_S)
    assert status.ring_drops == 0
    assert status.armed


def test_what_is_no_force_is_refused_in_one_line(daemon: Daemon) -> None:
    done = subprocess.run(
        [HAPTICD, "gateway", "haply", "--force", "tool"],
        env={**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert "is a coupling of the scene" in done.stderr
    assert len(done.stderr.splitlines()) == 1

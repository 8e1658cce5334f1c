"""The scene socket with real clients: what is let in reaches the loop's side, what is refused is told and counted."""

from __future__ import annotations

import math
import os
import select
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zmq

from hapticd.errors import InstanceError
from hapticd.keys.connections import has_ended
from hapticd.loop.memory import REMOTE, SharedMemory
from hapticd.loop.remote_slots import SlotReader, SlotWriter
from hapticd.remote import refusals
from hapticd.remote.scene_socket import MOST_AT_ONCE, SCHEMA, SceneSocket
from hapticd.tick.record import RecordLayout
from hapticd.tick.remote.update import RELEASED
from tests.remote.heard import FIELD, TOOL, HeardPort

PORTS = [TOOL, FIELD]
PATIENCE_S = 20.0


class Scene:
    """A scene socket, and the loop's side of what it hands on."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="hapticd-")) / "scene"
        self.shared = SharedMemory(RecordLayout(1, False, 8), 100.0)
        self.ports = [HeardPort(limits) for limits in PORTS]
        self.loop = SlotReader(self.shared)
        self.loop.serve(self.ports, 0)
        self.socket = SceneSocket(self.path, None, None)
        self.serve(1.0)

    def serve(self, lease_s: float) -> None:
        writer = SlotWriter(self.shared, ((port.name, port.kind) for port in PORTS))
        self.socket.serve(PORTS, writer, lease_s, ("x",), 1000.0)

    def turn(self) -> None:
        self.socket.receive()
        self.socket.turn()
        self.loop.take(0)

    def until(self, condition: Any) -> None:
        end_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end_s
            self.turn()

    def close(self) -> None:
        self.socket.close()
        self.shared.close()
        self.path.parent.rmdir()


class Talker:
    """A client with no code of hapticd in it."""

    def __init__(self, scene: Scene, identity: bytes = b"") -> None:
        self.scene = scene
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.DEALER)
        if identity:
            self.socket.setsockopt(zmq.ROUTING_ID, identity)
        self.socket.connect(f"ipc://{scene.path}")

    def __enter__(self) -> Talker:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close(0)
        self.context.term()

    def say(self, **fields: Any) -> None:
        self.socket.send(msgpack.packb(fields))

    def answer(self) -> dict[str, Any]:
        self.scene.until(lambda: self.socket.poll(1))
        answer: dict[str, Any] = msgpack.unpackb(self.socket.recv())
        return answer


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene()
    yield scene
    scene.close()


def test_a_client_learns_what_there_is_and_drives_it(scene: Scene) -> None:
    with Talker(scene) as client:
        client.say(hello=True)
        hello = client.answer()
        assert (hello["ok"], hello["schema"], hello["rate_hz"], hello["axes"]) == (True, SCHEMA, 1000.0, ["x"])
        assert [(port["name"], port["kind"], port["max_force_n"]) for port in hello["ports"]] == [
            ("tool", "coupling", 3.0), ("field", "force", 2.0),
        ]  # fmt: skip
        before_ns = time.monotonic_ns()
        client.say(name="tool", seq=7, position_m=[0.02], sent_ns=before_ns)
        client.say(name="field", seq=1, force_n=[1])
        scene.until(lambda: scene.ports[0].heard and scene.ports[1].heard)
        update = scene.ports[0].heard[0]
        assert (update.seq, update.position_m[0], update.sent_ns) == (7, 0.02, before_ns)
        assert before_ns <= update.received_ns <= time.monotonic_ns()
        assert scene.ports[1].heard[0].force_n == [1.0, 0.0, 0.0]
        owner = scene.socket.ports["tool"].owner
        assert owner is not None
        assert owner.name == f"user {os.getuid()}, process {os.getpid()}"
        client.say(name="tool", seq=8, position_m=[0.03])
        scene.until(lambda: len(scene.ports[0].heard) == 2)
        assert scene.socket.ports["tool"].owner is owner, "who is known is not looked up again"


def test_its_descriptor_is_readable_when_something_may_have_come(scene: Scene) -> None:
    with Talker(scene) as client:
        client.say(hello=True)
        client.answer()
        while scene.socket.receive():
            pass
        assert not select.select([scene.socket.descriptor], (), (), 0.0)[0]
        client.say(hello=True)
        assert select.select([scene.socket.descriptor], (), (), PATIENCE_S)[0]


def test_of_two_clients_for_one_name_the_first_has_it_and_the_second_is_told_once_a_second(scene: Scene) -> None:
    with Talker(scene) as one, Talker(scene) as two:
        one.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
        port = scene.socket.ports["tool"]
        for seq in range(20):
            two.say(name="tool", seq=seq, position_m=[0.5])
        scene.until(lambda: port.refused == 20)
        refusal = two.answer()
        assert refusal["name"] == "tool"
        assert refusal["text"].startswith(f"tool belongs to user {os.getuid()}, process {os.getpid()}")
        scene.turn()
        assert not two.socket.poll(50), "once a second at most"
        assert [update.position_m[0] for update in scene.ports[0].heard] == [0.01]


@pytest.mark.parametrize("between", [0, 20])
def test_a_client_that_has_gone_leaves_its_name_to_the_next_at_once(scene: Scene, between: int) -> None:
    """Also where its descriptor is another connection's by then; one message is enough."""
    scene.serve(3600.0)
    with Talker(scene) as one:
        one.say(name="tool", seq=900, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
    with ExitStack() as stack:
        for _ in range(between):
            other = stack.enter_context(Talker(scene))
            other.say(hello=True)
            other.answer()
        two = stack.enter_context(Talker(scene))
        two.say(name="tool", seq=1, position_m=[0.02])
        scene.until(lambda: scene.ports[0].heard[-1].position_m[0] == 0.02)


def test_a_refusal_that_follows_another_is_told_when_its_second_is_over(scene: Scene) -> None:
    with Talker(scene) as client:
        client.say(name="tool", seq=1, position_m=[0.01], stiffness_n_per_m=1e9)
        assert "stiffness_n_per_m" in client.answer()["text"]
        client.say(name="tool", seq=2, position_m=[math.nan])
        assert "position_m: must be a finite number" in client.answer()["text"]


def test_who_has_the_name_by_now_does_not_hear_that_it_was_another_ones(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Talker(scene) as one, Talker(scene) as two:
        one.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
        port = scene.socket.ports["tool"]
        for seq in (1, 2):
            two.say(name="tool", seq=seq, position_m=[0.5])
        scene.until(lambda: port.refused == 2)
        assert "belongs to" in two.answer()["text"]
        one.say(name="tool", release=True)
        scene.until(lambda: port.owner is None)
        two.say(name="tool", seq=3, position_m=[0.02])
        scene.until(lambda: scene.ports[0].heard[-1].position_m[0] == 0.02)
        monkeypatch.setattr(refusals, "QUIET_NS", 0)
        scene.turn()
        assert not two.socket.poll(50), "its second refusal waited, and is not true any more"


def test_a_client_that_comes_back_by_its_identity_has_its_name_back(scene: Scene) -> None:
    scene.serve(3600.0)
    with Talker(scene, b"me") as first, Talker(scene) as other:
        first.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
        with Talker(scene, b"me") as again:  # the first still hangs, as behind a cable that was cut
            again.say(name="tool", seq=2, position_m=[0.02])
            scene.until(lambda: scene.ports[0].heard[-1].seq == 2)
            other.say(name="tool", seq=3, position_m=[0.5])
            assert other.answer()["ok"] is False


@pytest.mark.parametrize(
    ("frames", "text"),
    [
        ([b"\xc1"], "one msgpack map"),
        ([msgpack.packb([1])], "one msgpack map"),
        ([msgpack.packb({1: 2})], "one msgpack map"),
        ([b"", msgpack.packb({"hello": True})], "one msgpack map"),
        ([msgpack.packb({"name": "tol", "seq": 1})], "no such name in the scene; there is tool, field"),
        ([msgpack.packb({"name": ["tool"], "seq": 1})], "no such name"),
        ([msgpack.packb({"seq": 1})], "no such name"),
    ],
)
def test_what_makes_no_sense_is_told_and_counted(scene: Scene, frames: list[bytes], text: str) -> None:
    with Talker(scene) as client:
        client.socket.send_multipart(frames)
        answer = client.answer()
        assert not answer["ok"]
        assert text in answer["text"]
        assert scene.socket.strays == 1
        assert scene.shared.words[REMOTE] == 0


def test_who_makes_no_sense_for_long_is_disconnected_and_the_others_go_on(scene: Scene) -> None:
    with Talker(scene) as good, Talker(scene) as bad:
        news = bad.socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        good.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)

        def says_it_until_it_is_disconnected() -> bool:
            bad.socket.send(b"\xc1")  # what comes before its connection is known is not counted
            return bool(news.poll(1))

        try:
            scene.until(says_it_until_it_is_disconnected)
        finally:
            bad.socket.disable_monitor()
            news.close(0)
        good.say(name="tool", seq=2, position_m=[0.02])
        scene.until(lambda: len(scene.ports[0].heard) == 2)


def test_a_flood_costs_a_turn_no_more_than_so_many_messages_and_the_latest_is_in_force(scene: Scene) -> None:
    count = 4 * MOST_AT_ONCE
    with Talker(scene) as client:
        scene.until(lambda: client.socket.poll(0, zmq.POLLOUT))
        for seq in range(count):
            client.say(name="tool", seq=seq, position_m=[0.001])
        scene.until(lambda: scene.ports[0].heard)
        taken = scene.socket.ports["tool"].messages
        scene.socket.receive()
        assert scene.socket.ports["tool"].messages <= taken + MOST_AT_ONCE
        scene.until(lambda: scene.ports[0].heard[-1].seq == count - 1)


def test_a_turn_says_whether_more_may_wait(scene: Scene) -> None:
    """Who asks goes on at once then, and hears that it was a flood."""
    with Talker(scene) as client:
        scene.until(lambda: client.socket.poll(0, zmq.POLLOUT))
        for seq in range(60):
            client.say(name="tool", seq=seq, position_m=[0.001])
        assert select.select([scene.socket.descriptor], (), (), PATIENCE_S)[0]
        turns = []
        end_s = time.monotonic() + PATIENCE_S
        while scene.socket.ports["tool"].messages + scene.socket.ports["tool"].late < 60:
            assert time.monotonic() < end_s
            before = scene.socket.ports["tool"].messages
            more = scene.socket.receive()
            turns.append((scene.socket.ports["tool"].messages - before, more))
        assert all(more is True for count, more in turns if count == 50)
        assert max(count for count, _ in turns) <= 50
        assert scene.socket.receive() is False


def test_after_a_reload_a_name_keeps_its_owner_and_another_list_is_not_mixed_up(scene: Scene) -> None:
    with Talker(scene) as one, Talker(scene) as two:
        one.say(name="field", seq=5, force_n=[1.0])
        scene.until(lambda: scene.ports[1].heard)
        writer = SlotWriter(scene.shared, [(FIELD.name, FIELD.kind)])
        scene.socket.serve([FIELD], writer, 3600.0, ("x",), 1000.0)
        one.say(name="field", seq=6, force_n=[2.0])  # before the loop has the new list
        scene.until(lambda: scene.socket.ports["field"].messages == 2)
        assert scene.ports[0].heard == []
        scene.loop.serve([scene.ports[1]], 0)
        two.say(name="field", seq=7, force_n=[0.5])
        assert "belongs to" in two.answer()["text"]
        one.say(name="field", seq=8, force_n=[1.5])
        scene.until(lambda: scene.ports[1].heard[-1].seq == 8)


def test_each_port_has_the_owner_who_drives_it_until_it_is_gone(scene: Scene) -> None:
    me = f"user {os.getuid()}, process {os.getpid()}"
    scene.serve(3600.0)
    assert scene.socket.owners() == ["", ""]
    with Talker(scene) as one:
        one.say(name="field", seq=5, force_n=[1.0])
        scene.until(lambda: scene.ports[1].heard)
        assert scene.socket.owners() == ["", me]
        with Talker(scene) as two:
            two.say(name="tool", seq=1, position_m=[0.01])
            scene.until(lambda: scene.ports[0].heard)
            assert scene.socket.owners() == [me, me]
            gone = scene.socket.ports["tool"].owner
            assert gone is not None
        scene.until(lambda: has_ended(gone.descriptor, gone.inode))
        assert scene.socket.owners() == ["", me], "at once, and not the next time"
        assert scene.socket.ports["tool"].owner is None
    scene.until(lambda: scene.socket.owners() == ["", ""])


def test_a_name_that_is_of_another_kind_now_belongs_to_no_one(scene: Scene) -> None:
    with Talker(scene) as one:
        one.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
        before = scene.socket.ports["tool"]
        tighter, other = replace(TOOL, max_force_n=1.0), replace(TOOL, kind="force")
        for limits, kept in ((tighter, True), (other, False)):
            writer = SlotWriter(scene.shared, [(limits.name, limits.kind)])
            scene.socket.serve([limits], writer, 2.5, ("x", "y"), 500.0)
            now = scene.socket.ports["tool"]
            assert (now is before) == kept
            assert (now.limits, now.lease_s) == (limits, 2.5)
            one.say(hello=True)
            hello = one.answer()
            assert (hello["rate_hz"], hello["axes"], hello["lease_s"]) == (500.0, ["x", "y"], 2.5)
            assert [port["kind"] for port in hello["ports"]] == [limits.kind]


def test_a_refusal_names_the_port_and_the_key(scene: Scene) -> None:
    with Talker(scene) as one, Talker(scene) as two:
        one.say(name="tool", seq=1, position_m=[0.01], stiffness_n_per_m=-1)
        refusal = one.answer()
        assert (refusal["ok"], refusal["name"], refusal["key"]) == (False, "tool", "stiffness_n_per_m")
        assert scene.socket.ports["tool"].refused == 1
        two.say(name="x" * 100, seq=1)
        refusal = two.answer()
        assert (refusal["name"], refusal["key"]) == ("x" * 40, "")


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    path = tmp_path / "scene"
    path.write_text("mine")
    with pytest.raises(InstanceError, match="a file that is no socket is in the way"):
        SceneSocket(path, None, None)
    assert path.read_text() == "mine"


def test_of_a_client_that_has_gone_only_its_letting_go_is_taken(scene: Scene) -> None:
    """What it said may have waited for long."""
    with Talker(scene) as one:
        one.say(name="tool", seq=1, position_m=[0.01])
        scene.until(lambda: scene.ports[0].heard)
        owner = scene.socket.ports["tool"].owner
        assert owner is not None
        one.say(name="tool", seq=2, position_m=[0.02])
        one.say(name="tool", release=True)
        one.socket.close(1000)
        one.context.term()
    assert has_ended(owner.descriptor, owner.inode)
    scene.until(lambda: len(scene.ports[0].heard) == 2)
    assert scene.ports[0].heard[1].said & RELEASED
    assert scene.ports[0].heard[1].position_m[0] == 0.01
    assert scene.socket.ports["tool"].late == 1

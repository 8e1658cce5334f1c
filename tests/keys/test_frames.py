"""Of a message of many frames the first is read, and the others are passed over without holding a turn up."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import zmq

from hapticd.keys.frames import FrameReader
from tests.daemon.running import wait_until

MOST_PASSED_OVER = 5000


@contextmanager
def talking() -> Iterator[tuple[FrameReader, zmq.Socket[bytes], zmq.Socket[bytes]]]:
    """A reader, what it reads from, and a client."""
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router, context.socket(zmq.DEALER) as client:
        client.setsockopt(zmq.ROUTING_ID, b"me")
        router.bind("inproc://here")
        client.connect("inproc://here")
        yield FrameReader(router), router, client


def test_each_message_is_read_by_its_first_frame() -> None:
    with talking() as (reader, router, client):
        assert reader.read() is None
        for frames in ([b"one"], [b"two", b"x", b""], [b"three"]):
            client.send_multipart(frames)
        wait_until(lambda: router.poll(0), "the messages")
        read = [reader.read() for _ in range(4)]
        assert [(each.identity, each.frame.bytes, each.single) for each in read if each is not None] == [
            (b"me", b"one", True),
            (b"me", b"two", False),
            (b"me", b"three", True),
        ]
        assert read[3] is None


def test_a_turn_passes_over_five_thousand_frames_and_the_next_goes_on() -> None:
    with talking() as (reader, router, client):
        client.send_multipart([b"long", *[b""] * (2 * MOST_PASSED_OVER + 1)])
        client.send(b"behind it")
        wait_until(lambda: router.poll(0), "the messages")
        first = reader.read()
        assert first is not None
        assert (first.frame.bytes, first.single) == (b"long", False)
        assert [reader.read(), reader.read()] == [None, None]
        last = reader.read()
        assert last is not None
        assert (last.frame.bytes, last.single) == (b"behind it", True)

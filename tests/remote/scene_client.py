"""A client in a process of its own, to be killed: it says where the tool is a thousand times a second."""

from __future__ import annotations

import itertools
import sys
import time

import msgpack
import zmq


def main(endpoint: str, name: str, value: float, pause_s: float, tells_when: bool) -> None:
    socket = zmq.Context().socket(zmq.DEALER)
    socket.connect(endpoint)
    for seq in itertools.count(1):
        when = {"sent_ns": time.monotonic_ns()} if tells_when else {}
        socket.send(msgpack.packb({"name": name, "seq": seq, "position_m": [value], **when}))
        if seq == 1:
            sys.stdout.write("\n")
            sys.stdout.flush()
        time.sleep(pause_s)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4]), "when" in sys.argv)

"""Print the position twice a second, every cycle and every event. Needs pyzmq and msgpack, not hapticd."""

import sys

import msgpack
import zmq

endpoint = sys.argv[1] if len(sys.argv) > 1 else "ipc:///run/hapticd/default/telemetry"
socket = zmq.Context().socket(zmq.SUB)
for wanted in ("hapticd/position", "hapticd/cycle", "hapticd/event"):
    socket.subscribe(wanted)
socket.connect(endpoint)

last = None
while True:
    topic, payload = socket.recv_multipart()
    for tick in msgpack.unpackb(payload):
        seq = tick["seq"]
        if topic == b"hapticd/position":
            if last is not None and seq > last + 1:
                print("lost", seq - last - 1, "ticks")
            last = seq
            if seq % 500 == 0:
                print("tick", seq, "position", tick["position_m"], "force", tick["force_n"], flush=True)
        elif topic == b"hapticd/cycle":
            print("cycle", tick["cycle"], "generated", tick["generated_j"], flush=True)
        else:
            print("event", tick["code"], tick["text"], flush=True)

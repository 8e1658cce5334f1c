"""Twenty lines of a user's own: counts so many ticks, says what was missed. No code of hapticd.

It prints its first tick as soon as it has come, and in the end its last, how many it has missed and how often time
stepped back.
"""

import sys

import msgpack
import zmq

endpoint, count = sys.argv[1], int(sys.argv[2])
socket = zmq.Context().socket(zmq.SUB)
socket.setsockopt(zmq.SUBSCRIBE, b"hapticd/position")
socket.connect(endpoint)
first = seq = -1
missed, backwards, timestamp = 0, 0, 0.0
while first == -1 or seq < first + count:
    for tick in msgpack.unpackb(socket.recv_multipart()[1]):
        if first == -1:
            first, seq = tick["seq"], tick["seq"] - 1
            sys.stdout.write(f"{first}\n")
            sys.stdout.flush()
        missed += tick["seq"] - seq - 1
        backwards += tick["timestamp"] <= timestamp
        seq, timestamp = tick["seq"], tick["timestamp"]
sys.stdout.write(f"{seq} {missed} {backwards}\n")

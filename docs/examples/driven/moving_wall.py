"""A wall that goes up and down by 10 mm, moved 60 times a second. Needs hapticd.

hapticd run --config wall.toml
python moving_wall.py
"""

import math
import sys
import time

import hapticd

RATE_HZ = 60.0
SWING_M = 0.01
TURN_RAD_PER_S = math.pi

duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
most_n = 0.0
with hapticd.connect() as daemon, daemon.remote("wall") as wall:
    began_s = time.monotonic()
    while (passed_s := time.monotonic() - began_s) < duration_s:
        turn = TURN_RAD_PER_S * passed_s
        wall.move(
            position_m=[0.0, 0.0, -SWING_M * math.cos(turn)],
            velocity_m_per_s=[0.0, 0.0, SWING_M * TURN_RAD_PER_S * math.sin(turn)],  # it moves on with this by itself
        )
        state = wall.state()
        if state.port is not None:
            most_n = max(most_n, state.port.force_n[2])
        time.sleep(1.0 / RATE_HZ)
print(f"the wall lifted the hand with up to {most_n:.1f} N")

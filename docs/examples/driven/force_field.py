"""A curl field, as studies of motor learning use it: a force across the hand's own velocity. Needs hapticd.

hapticd run --config driven.toml
python force_field.py
"""

import sys
import time

import hapticd

ACROSS_N_S_PER_M = 15.0

duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
with hapticd.connect() as daemon, daemon.remote("field") as field:
    began_s = time.monotonic()
    while time.monotonic() - began_s < duration_s:
        state = field.state()  # waits for the next tick
        x_m_per_s, y_m_per_s, _ = state.velocity_m_per_s
        field.push([-ACROSS_N_S_PER_M * y_m_per_s, ACROSS_N_S_PER_M * x_m_per_s, 0.0])
    across_n = field.state().port.force_n
print(f"pushed with {across_n[0]:.2f} and {across_n[1]:.2f} N at the end")

"""An experiment: a spring to the middle, softer or stiffer from trial to trial, and from which tick each one holds.

hapticd run --config driven.toml
python trials.py                 # needs hapticd; recorded beside it: hapticd record
"""

import sys

import hapticd

TRIALS_N_PER_M = (100.0, 400.0, 200.0)

length_s = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
with hapticd.connect() as daemon, daemon.remote("tool") as tool:
    for stiffness_n_per_m in TRIALS_N_PER_M:
        tool.change(stiffness_n_per_m=stiffness_n_per_m)
        sent = tool.seq
        farthest_m, first, state = 0.0, None, tool.state()
        while first is None or state.timestamp < first.timestamp + length_s:
            tool.move(position_m=[0.0, 0.0, 0.0])  # says the stiffness as well: every message says everything
            state = tool.state()
            if first is None and state.port.seq >= sent:
                first = state  # the first tick with a message that has this stiffness
                daemon.mark(f"{stiffness_n_per_m:g} N/m from tick {state.seq}")
            farthest_m = max(farthest_m, abs(state.position_m[0]))
        print(f"{stiffness_n_per_m:g} N/m from tick {first.seq}: up to {1e3 * farthest_m:.1f} mm")

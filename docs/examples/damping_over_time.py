"""What a law adds to a wall at position 0 of a device with one axis, a line a minute. Needs hapticd.

damping_over_time.py [INSTANCE [SECONDS A LINE [LINES]]]
"""

import sys

import hapticd
from hapticd.client import Damping, Position


def line(ticks):
    """Largest damping, damping weighted by its work, share of the ticks that pull, stiffness shown."""
    work = sum(damping * v * v for _, v, _, damping in ticks)
    weighted = sum(damping * damping * v * v for _, v, _, damping in ticks) / work if work > 0.0 else 0.0
    shown = -sum(force * x for x, _, force, _ in ticks) / sum(x * x for x, _, _, _ in ticks)
    pulls = 100.0 * sum(force < 0.0 for _, _, force, _ in ticks) / len(ticks)
    return f"{max(tick[3] for tick in ticks):8.2f} {weighted:8.2f} {pulls:7.2f} {shown / 1e3:8.2f}"


def main():
    """Print until the lines are full, or for ever."""
    instance = sys.argv[1] if len(sys.argv) > 1 else "default"
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    lines = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    print("       s  largest weighted pulls,% shown,kN/m   (damping in N s/m)", flush=True)
    with hapticd.connect(instance, topics=[Position, Damping]) as daemon:
        positions, inside, began, printed = {}, [], None, 0
        for record in daemon:
            began = record.timestamp if began is None else began
            if isinstance(record, Position):
                positions[record.seq] = record
            elif isinstance(record, Damping) and record.seq in positions:
                at = positions.pop(record.seq)
                if record.in_contact[0]:
                    inside.append(
                        (at.position_m[0], at.velocity_m_per_s[0], at.force_n[0], record.damping_n_s_per_m[0])
                    )
            if record.timestamp - began >= seconds * (printed + 1):
                printed += 1
                print(f"{seconds * printed:8g} {line(inside) if inside else 'no contact'}", flush=True)
                positions, inside = {}, []
                if printed == lines:
                    return


if __name__ == "__main__":
    main()

"""`hapticd bench`: what parts of the service cost on this machine, next to a reference measured in the same run."""

from __future__ import annotations

from hapticd.cli.group import lazy_group

_COMMANDS = "hapticd_bench.commands"

app = lazy_group(
    {
        "tick": (f"{_COMMANDS}.tick:tick", "Measure what a tick costs, and how many of them a daemon runs."),
        "lateness": (
            f"{_COMMANDS}.lateness:lateness",
            "Measure how late the loop wakes beyond what the machine does to any loop.",
        ),
        "telemetry": (
            f"{_COMMANDS}.telemetry:telemetry",
            "Measure what publishing costs, with 0, 1 and 16 subscribers.",
        ),
        "viewers": (
            f"{_COMMANDS}.viewers:viewers",
            "Measure what two recorders, a dashboard with a page and 14 subscribers cost.",
        ),
        "remote": (
            f"{_COMMANDS}.remote:remote",
            "Measure how soon a client's message is felt and a tick is heard of, next to a bare ZeroMQ echo.",
        ),
        "batch": (
            f"{_COMMANDS}.batch:batch",
            "Measure the offline simulator next to the same computation in C.",
        ),
        "device": (
            f"{_COMMANDS}.device:device",
            "Measure what a tick costs on the configured device, next to the simulated one.",
        ),
        "rig": (
            f"{_COMMANDS}.rig:rig",
            "Measure what the serial rig's driver costs over a pseudo-terminal, next to a bare os.write and os.read.",
        ),
        "soak": (
            f"{_COMMANDS}.soak:soak",
            "Leave a daemon running and see whether anything grows, drifts or gets lost.",
        ),
        "start": (
            f"{_COMMANDS}.start:start",
            "Measure how long `hapticd run` takes to its first tick, and what of it.",
        ),
        "switch": (
            f"{_COMMANDS}.switch:switch",
            "Measure how long a switch to a law never loaded holds the loop up, at 1 kHz.",
        ),
    },
    help="Measure what the service costs on this machine, next to a reference measured in the same run.",
    epilog="What the figures mean: docs/benchmarks.md\n\nExample: hapticd bench tick",
)

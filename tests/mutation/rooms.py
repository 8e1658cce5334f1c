"""The rooms where a fault reaches a hand or lets someone in, and the tests that belong to each."""

from __future__ import annotations

from dataclasses import dataclass

LAWS = (
    "none",
    "damper",
    "energy_bounding",
    "input_to_state",
    "set_position",
    "tdpa",
    "virtual_coupling",
    "ring_damping",
    "energy_cycle",
    "late_cycle",
)


LAW_TESTS = ("tests/controllers/test_every_law.py", "tests/controllers/test_recorded_laws.py")
RUNS = "tests/loop/test_recorded_runs.py"
WALKS = "tests/shapes/test_recorded_walks.py"


@dataclass(frozen=True, slots=True)
class Room:
    """Some files, and what tests them.

    Attributes:
        files: below the root.
        tests: what pytest is told to run, those that are quick or find most first.
        select: its `-k`.
    """

    files: tuple[str, ...]
    tests: tuple[str, ...]
    select: str = ""

    @property
    def asked(self) -> tuple[str, ...]:
        """The same as arguments of pytest."""
        return (*self.tests, *(("-k", self.select) if self.select else ()))


def _law(name: str) -> Room:
    own = [name] if name != "none" else []
    own += ["ring_damping_rules"] if name == "ring_damping" else []
    own += ["cycle_sums"] if name in ("energy_cycle", "late_cycle") else []
    select = f"{name} or {name.replace('_', '-')} or give_every_law"
    tests = (*(f"tests/controllers/test_{each}.py" for each in own), *LAW_TESTS)
    return Room((f"controllers/hapticd_controllers/{name}.py",), tests, select)


def _tick(*names: str) -> tuple[str, ...]:
    return tuple(f"tests/tick/test_{name}.py" for name in names)


ROOMS = {
    "guard": Room(
        ("hapticd/tick/guard.py",),
        (*_tick("guard", "tick_transitions", "tick_books", "tick_motion"), RUNS),
    ),
    "energy": Room(("hapticd/tick/energy.py",), (*_tick("energy", "contact", "tick_books"), RUNS)),
    "tick": Room(
        tuple(
            f"hapticd/tick/{name}.py"
            for name in ("tick", "sight", "contact", "motion", "switch", "assemble", "fallback")
        ),
        ("tests/tick", RUNS),
    ),
    "space": Room(
        (
            *(f"hapticd/tick/space/{name}.py" for name in ("books", "channel", "crease")),
            *(f"hapticd/tick/space/{name}.py" for name in ("solid", "solid_contact", "switch", "tick")),
        ),
        (
            "tests/tick/space", "tests/shapes/test_solid.py", "tests/shapes/test_friction.py",
            *(f"tests/tick/remote/test_{name}.py" for name in ("turning", "objects", "resting_object")), RUNS, WALKS,
        ),
    ),
    "shapes": Room(
        tuple(
            f"hapticd/shapes/{name}.py"
            for name in (
                "distance", "field", "friction", "pose", "proxy", "reach", "scalars", "solid", "surface", "way_out",
            )
        ),
        ("tests/shapes", "tests/tick/space"),
    ),
    "driven": Room(
        tuple(
            f"hapticd/tick/remote/{name}.py"
            for name in (
                "asked_spring", "books", "coupling", "follower", "line", "one_port", "port", "port_state", "ports",
                "ramped", "port_site", "remote_object", "said_motion", "streamed_force", "tick_ports", "turning",
                "update",
            )
        ),
        ("tests/tick/remote", RUNS),
    ),
    "door": Room(
        (
            *(f"hapticd/remote/{name}.py" for name in ("bound_socket", "delays", "leased_port", "message", "refusals")),
            *(f"hapticd/remote/{name}.py" for name in ("scene_socket", "state_map", "state_socket")),
            "hapticd/loop/remote_slots.py",
        ),
        (
            *(f"tests/remote/test_{name}.py" for name in ("message", "refusals", "leased_port", "scene_socket")),
            *(f"tests/remote/test_{name}.py" for name in ("doors", "state_map")),
            "tests/loop/test_remote_slots.py",
        ),
    ),
    "velocity": Room(("hapticd/tick/velocity.py",), (*_tick("velocity", "tick_motion"), RUNS)),
    "scene": Room(
        ("hapticd/tick/scene.py",),
        (*_tick("scene", "wall_changes", "switching", "tick_transitions"), "tests/tick/space/test_changes.py", RUNS),
    ),
    "loop": Room(
        tuple(
            f"hapticd/loop/{name}.py"
            for name in ("loop", "law_budget", "session", "requests", "memory", "resume", "worker")
        ),
        tuple(
            f"tests/loop/test_{name}.py"
            for name in (
                "start", "arming", "budget", "watching", "loop", "requests", "disarming", "leaving", "memory", "ramps",
                "any_order_mutants", "recorded_runs", "worker",
            )
        ),
    ),
    **{name: _law(name) for name in LAWS},
    **{
        name: Room(
            (f"controllers/hapticd_controllers/{name}.py",),
            (
                *(f"tests/controllers/test_{law}.py" for law in ("cycle_sums", "felt_mass", "late_cycle")),
                *LAW_TESTS,
                "tests/controllers/test_energy_cycle.py",
            ),
            "cycle_sums or energy_cycle or energy-cycle or late_cycle or late-cycle or felt_mass or give_every_law",
        )
        for name in ("cycle_sums", "felt_mass")
    },
    "recovery": Room(
        (
            *("hapticd/supervisor/recovery.py", "hapticd/loop/resume.py"),
            *("hapticd/loop/sources.py", "hapticd/loop/force_mark.py"),
        ),
        (
            *(f"tests/daemon/test_{name}.py" for name in ("recovery", "plugged_in", "edited", "orphans")),
            "tests/loop/test_leaving.py",
        ),
    ),
    "keys": Room(
        tuple(
            f"hapticd/keys/{name}.py"
            for name in (
                "connections", "file", "frames", "heartbeat", "local_bind", "memory", "owners", "policy", "server",
                "store",
            )
        ),
        ("tests/keys",),
    ),
    "rig": Room(
        tuple(f"drivers/hapticd_drivers/rig/{name}.py" for name in ("messages", "frames", "conversation", "mapping")),
        tuple(
            f"tests/drivers/rig/test_{name}.py"
            for name in ("questions", "messages", "conversation", "mapping", "serial_driver", "serial_faults")
        ),
    ),
    "motion of the rig": Room(
        ("drivers/hapticd_drivers/rig/motion.py",),
        ("tests/drivers/rig/test_motion.py", "tests/drivers/rig/test_motion_bounds.py"),
    ),
}  # fmt: skip

REACHING = ("hapticd/tick", "hapticd/shapes", "hapticd/loop", "hapticd/keys", "hapticd/remote")
"""Where a fault reaches a hand or lets someone in."""

LEFT = {
    "what is published of a tick and not what is done in it": (
        *(f"hapticd/tick/{name}.py" for name in ("contact_record", "event", "flags", "record")),
        "hapticd/tick/remote/port_record.py",
    ),
    "how a process is started and scheduled; it has no force by then": (
        *(f"hapticd/loop/{name}.py" for name in ("press", "process", "realtime", "warm_up")),
        *(f"hapticd/remote/{name}.py" for name in ("priority", "process", "settings")),
    ),
    "the side of a client, who opens nothing": ("hapticd/keys/client.py",),
}
"""Modules there that are in no room, and why."""

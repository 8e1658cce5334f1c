"""`hapticd study`: the studies, each imported only when it is wanted, since they need the extra `study`."""

from __future__ import annotations

from hapticd.cli.group import lazy_group

_COMMANDS = "hapticd_studies.commands"

app = lazy_group(
    {
        "paper": (
            f"{_COMMANDS}.paper:command",
            "Run every simulation and experiment of the paper, and say what reproduces.",
        ),
        "zwidth": (
            f"{_COMMANDS}.zwidth:command",
            "Map where laws keep a pressed wall stable, over any two parameters.",
        ),
        "robustness": (
            f"{_COMMANDS}.robustness:command",
            "Press random devices into random walls under every law, and count which settle.",
        ),
        "transparency": (
            f"{_COMMANDS}.transparency:command",
            "Let hands move on random devices under every law, and score what they are given and what they feel.",
        ),
        "targets": (
            f"{_COMMANDS}.targets:command",
            "Hold laws against the targets of the default law: what holds, what it costs, what is felt.",
        ),
        "accuracy": (
            f"{_COMMANDS}.accuracy:command",
            "Measure what every shortcut costs in accuracy, and what every bit of accuracy costs in time.",
        ),
        "devices": (
            f"{_COMMANDS}.devices:command",
            "Hold the device model against limits and orders that others have published.",
        ),
        "scene": (f"{_COMMANDS}.scene:command", "Find the smallest model that keeps every answer of a scene."),
        "space": (
            f"{_COMMANDS}.space:command",
            "Find what stiffness a device with three axes holds, by direction and place.",
        ),
        "remote": (
            f"{_COMMANDS}.remote:command",
            "Press what other programs render, late and unevenly, and say what stiffness they get under each law.",
        ),
        "space-robustness": (
            f"{_COMMANDS}.space_robustness:command",
            "Let random hands press, stroke, tap, circle and let go of surfaces in space, and count who is steady.",
        ),
        "extremes": (
            f"{_COMMANDS}.extremes:command",
            "Hold the model's arithmetic against exact answers, over many decades of every parameter.",
        ),
    },
    help="Put laws to the test offline, over many runs. Needs: pip install 'hapticd[study]'",
    epilog="Example: hapticd study paper --output paper",
)

"""Scenes with objects of every shape: convex and hollow, alone and overlapping, smooth and rough."""

from __future__ import annotations


def thing(name: str, shape: str, stiffness: float = 1500.0, **keys: object) -> str:
    lines = [f"{key} = {_toml(value)}" for key, value in keys.items()]
    head = f'[[scene.objects]]\nname = "{name}"\nshape = "{shape}"\nstiffness_n_per_m = {stiffness}\n'
    return head + "\n".join(lines) + "\n"


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)


ROOM = (
    thing("room", "box", inside=True, size_m=[0.03, 0.024, 0.02], orientation=[1.0, 0.1, 0.05, 0.0])
    + thing("ball", "sphere", 1500.0, radius_m=0.006, position_m=[0.004, 0.0, -0.004], damping_n_s_per_m=2.0)
    + thing(
        "post",
        "cylinder",
        800.0,
        radius_m=0.004,
        length_m=0.02,
        rounding_m=0.001,
        position_m=[-0.009, 0.002, 0.0],
        static_friction=0.6,
        dynamic_friction=0.3,
    )
    + thing("pill", "capsule", 1500.0, radius_m=0.003, length_m=0.008, position_m=[0.004, 0.006, -0.004])
    + '[[scene.walls]]\naxis = "y"\nstiffness_n_per_m = 900.0\nposition_m = -0.008\n'
)

CUP = (
    thing("floor", "plane", 2000.0, position_m=[0.0, 0.0, -0.005], static_friction=0.5, dynamic_friction=0.4)
    + thing("lid", "plane", 1000.0, position_m=[0.0, 0.0, 0.012], orientation=[0.1, 1.0, 0.0, 0.0])
    + thing("moved", "sphere", 1500.0, radius_m=0.008, position_m=[0.0, 0.0, -0.02], remote=True)
    + thing("pipe", "cylinder", 1200.0, inside=True, radius_m=0.011, length_m=0.08)
)

CUP_CHANGED = (
    thing("floor", "plane", 2000.0, position_m=[0.0, 0.0, -0.003])
    + thing("moved", "sphere", 1500.0, radius_m=0.01, position_m=[0.0, 0.0, -0.02], remote=True, max_speed_m_per_s=0.2)
    + thing("pipe", "cylinder", 1200.0, inside=True, radius_m=0.009, length_m=0.08, static_friction=0.3)
)

"""A peg in MuJoCo that a hand holds: it pushes a ball and a drawer, and goes into a hole. Needs hapticd and mujoco.

hapticd run --config scene.toml
python coupled.py 60              # steps a second
"""

import math
import sys
import time
from pathlib import Path

import mujoco

import hapticd

LONGEST_S = 0.002
"""Of MuJoCo's own steps: with longer ones its contacts are soft [s]."""


class Scene:
    """The scene in MuJoCo; the hand's side of the coupling is in the daemon."""

    def __init__(self, rate_hz, peg_m):
        self.model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("scene.xml")))
        self.steps = math.ceil(1.0 / (rate_hz * LONGEST_S))
        self.model.opt.timestep = 1.0 / (rate_hz * self.steps)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:3] = peg_m

    def step(self, force_n):
        """Go on by 1 / rate under the force on the device, and say where the peg is; it gets the opposite force."""
        self.data.qfrc_applied[:3] = [-newton for newton in force_n]
        mujoco.mj_step(self.model, self.data, self.steps)
        return self.data.qpos[:3].tolist()


def main(rate_hz=60.0, duration_s=8.0):
    """Couple the peg to the device for a while, in real time."""
    with hapticd.connect() as daemon, daemon.remote("tool") as tool:
        scene = Scene(rate_hz, tool.state().position_m)
        due_s = time.monotonic()
        end_s = due_s + duration_s
        while due_s < end_s:
            tool.move(position_m=scene.step(tool.mean_force_n()))
            due_s += 1.0 / rate_hz
            time.sleep(max(0.0, due_s - time.monotonic()))
    ball, drawer = scene.data.body("ball").xpos, scene.data.joint("drawer").qpos[0]
    print(f"ball at x = {1e3 * ball[0]:.0f} mm, drawer {abs(1e3 * drawer):.0f} mm in")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))

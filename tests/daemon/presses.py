"""A driver that makes press after press in one daemon: each with a simulated device of its own, as `loopback` has it.

The scene stays, and a press brings its device along: mounted so that the ball, the edge or the plane of that press is
where the scene has one. Between two presses the device is taken off and comes back elsewhere; the law knows of no
change of hands, and goes on with what it has learnt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hapticd.config.loading import parse
from hapticd.device import DeviceInfo, Sample
from hapticd.shapes.pose import Pose, Vector
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.space.device import SpatialDevice
from hapticd_drivers.loopback import Loopback
from tests.offline.space_presses import KINDS, press_text, scene

PRESS = 4000
"""Ticks of a press."""
AWAY = 700
"""Ticks away from everything after it: longer than what a law remembers of a touch."""
OFF_M = 1e-4
"""How far the device is taken off in each of the first ticks away."""
PLACES: dict[str, Vector] = {"ball": (0.0, 0.0, 0.0), "edge": (0.3, 0.0, 0.0), "plane": (0.0, 0.0, -0.3)}
"""Where the scene has the object of a press."""


class Presses(Loopback):
    """Presses from many starts, kind after kind for each start.

    Args:
        options: of the loopback, and which presses.
        period_s: time between ticks [s].
    """

    class Options(SimulationOptions):
        """The options of the loopback, and how many presses."""

        kinds: tuple[str, ...] = KINDS
        starts: int = 1

    def _open(self) -> DeviceInfo:
        info = super()._open()
        assert isinstance(self.options, Presses.Options)
        self._tick = -1
        self._starts = [(kind, seed) for seed in range(self.options.starts) for kind in self.options.kinds]
        self._begin(0)
        return replace(info, start_m=self._pose.own(self._held.measured_m))

    def _read(self) -> Sample:
        self._tick += 1
        press, tick = divmod(self._tick, PRESS + AWAY)
        if tick == 0:
            self._begin(press % len(self._starts))
        elif tick <= PRESS:
            self._held.advance(self._pose.out(self._forces_n))
        elif tick <= PRESS + 200:
            for axis, outward in enumerate(self._outwards):
                self._held.measured_m[axis] += OFF_M * outward
        self._sample.position_m[:] = self._pose.own(self._held.measured_m)
        self._sample.time_ns = self._tick * self._period_ns
        self._sample.sequence = self._tick
        return self._sample

    def _begin(self, press: int) -> None:
        kind, seed = self._starts[press]
        alone = parse(press_text(kind, 1e3, None, seed), "a press")
        assert isinstance(alone.options, SimulationOptions)
        self._held = SpatialDevice(alone.options, self.period_s)
        there = alone.config.scene.objects[0]
        mounted = Pose.of(there.position_m, there.orientation)
        x, y, z = (at - to for at, to in zip(mounted.position_m, mounted.out(PLACES[kind]), strict=True))
        self._pose = Pose((x, y, z), mounted.rotation)
        _, _, self._outwards = scene(kind, seed)


def scene_text(stiffness: float, law: str | None, kinds: Sequence[str], starts: int) -> str:
    """The configuration of a daemon that makes these presses; without a law it is the default one."""
    objects = {
        "ball": 'shape = "sphere"\nradius_m = 0.03\n',
        "edge": 'shape = "box"\nsize_m = [0.04, 0.06, 0.04]\n',
        "plane": 'shape = "plane"\nstatic_friction = 0.8\ndynamic_friction = 0.6\n',
    }
    text = f"""telemetry.send_high_water = 100000
[device]
driver = "tests.daemon.presses.Presses"
[device.options]
model = "omega7"
axes = 3
kinds = {list(kinds)}
starts = {starts}
space.linkage = "delta"
"""
    for kind in kinds:
        where = f"stiffness_n_per_m = {stiffness}\nposition_m = {list(PLACES[kind])}\n"
        text += f'[[scene.objects]]\nname = "{kind}"\n{objects[kind]}{where}'
    return text if law is None else text + f'[controller]\nlaw = "{law}"\n'

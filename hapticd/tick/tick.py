"""One tick, without clocks or devices: sample in, force out. The daemon and every offline run share it.

positions -> velocities -> contacts -> laws -> guard -> force; then the books

What may happen between two samples stands in one module, so that the order of it can be read from top to bottom.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from traceback import walk_tb
from typing import TYPE_CHECKING

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.ports import PortLimits, port_limits
from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo, Sample
from hapticd.errors import ConfigError, in_words
from hapticd.tick import fallback
from hapticd.tick.arrangement import Arrangement, arrange
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd.tick.guard import BLIND_RAMP_S, Guard, Mode, let_out, limits
from hapticd.tick.motion import Motion
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.ports import PortArrangement, arrange_ports, axes_of
from hapticd.tick.scene import check_objects, compile_walls
from hapticd.tick.space.books import Totals

if TYPE_CHECKING:  # what a scene without couplings and forces never loads
    from hapticd.tick.remote.one_port import OnePort, PortAxis

MakePort = Callable[[PortLimits, Motion, float, float], "OnePort"]
"""Makes a coupling or a force: its limits, where the device is, the device's resolution [m], the duration of its ramps
[s]."""

_IMPOSSIBLE = "the device reported a position that is not possible"
_LOST = "the device does not know any more where it is"
_DISARMED, _ARMED = Mode.DISARMED, Mode.ARMED  # Python 3.11 takes 0.1 us to look a member up, each time
_MODE_FLAGS = (0, int(Flag.ARMED), int(Flag.RELEASING))  # in the order of guard.Mode
_LIMITED, _LATCHED, _FALLBACK = int(Flag.LIMITED), int(Flag.LATCHED), int(Flag.FALLBACK)


class ControlTick:
    """The state of the control loop between samples.

    Args:
        scene: the walls.
        velocity: how velocity is estimated.
        guard: force limits and arming.
        info: what the device declares.
        make_law: a fresh law, one a contact.
        period_s: nominal time between ticks [s].
        ramp_s: duration of every ramp [s].
        make_port: a coupling or a force.

    Attributes:
        motion: where the device is and how fast, as used by the last tick.
        contacts: one a wall, in scene order.
        leaving: walls that are gone and whose force still fades out.
        past: books of the walls that are gone, so that the sums over all walls never jump.
        force_n: force applied by the last tick, one element an axis [N].
        requested_n: what the laws asked for [N].
        fault: code of a fault raised by the last tick, 0 when there was none; the loop takes and clears it.
        fault_text: what there is to say about it.
        advance: what a loop calls each tick: `step`, or what else a scene needs.
        has_objects: whether the scene has objects in space.
        ports: what clients drive, in scene order: objects, couplings, forces.
        couplings: of these the ones that pull by themselves, couplings and forces.
        has_ports: whether there are such, or were.

    Raises:
        ConfigError: the scene or the way to find the velocity does not fit the device.
    """

    def __init__(
        self,
        scene: SceneConfig,
        velocity: VelocityConfig,
        guard: Guard,
        info: DeviceInfo,
        make_law: Callable[[], RunningLaw],
        period_s: float,
        ramp_s: float,
        make_port: MakePort | None = None,
    ) -> None:
        check_objects(scene.objects, info)
        axes = len(info.axes)
        self.info = info
        self.motion = Motion(velocity, info, period_s)
        self.guard = guard
        self.period_s = period_s
        self.ramp_s = ramp_s
        self.make_law = make_law
        self.contacts = [
            Contact(wall, make_law(), info.resolution_m) for wall in compile_walls(scene.walls, info, period_s)
        ]
        self.leaving: list[Contact] = []
        self.past = EnergyLedger()
        self.force_n = [0.0] * axes
        self.requested_n = [0.0] * axes
        self.fallback = self.has_objects = self.has_ports = False
        self.fault = 0
        self.fault_text = ""
        self._last_fault = 0
        self._axes = range(axes)
        self._simulated = info.simulated
        self._make_port = make_port
        self.couplings: list[OnePort] = [self._port(port) for port in port_limits(scene) if port.kind != "object"]
        self.leaving_ports: list[OnePort] = []
        self.past_ports = Totals()
        for port in self.couplings:
            port.join()
        self._gather()
        self._changing = any(contact.wall.changes_left for contact in self.contacts)
        self._blind = self._calibrated = True
        self._excused = False
        self._blind_gain = 0.0
        self._blind_from_n = [0.0] * axes
        self.motion.watch_speed(guard.max_speed_m_per_s < math.inf)
        self.ports: list[Port]
        self.advance: Callable[[Sample, float], list[float]] = self.step

    @property
    def ramp_ticks(self) -> int:
        """Ticks that a ramp takes where none is late."""
        return max(1, round(self.ramp_s / self.period_s))

    @property
    def flags(self) -> int:
        """State bits of the tick record."""
        guard = self.guard
        flags = _MODE_FLAGS[guard.mode]
        if guard.limited:
            flags |= _LIMITED
        if guard.latched:
            flags |= _LATCHED
        if self.fallback:
            flags |= _FALLBACK
        return flags

    def start(self, sample: Sample) -> None:
        """Begin at a sample, at rest and without force; one that makes no sense is a fault at the first step.

        Raises:
            PluginError: the law cannot start.
        """
        self._blind = not self.motion.start(sample)
        self._calibrated = sample.calibrated
        self._excused = not sample.calibrated
        if self._blind and sample.calibrated:
            self.fail(EventCode.SAMPLE_IMPOSSIBLE, _IMPOSSIBLE)
        self._stand()
        self._start_laws([(contact, contact.law) for contact in (*self._under_law(), *self._axes_under_law())])

    def arm(self) -> bool:
        """Let forces through; a wall that is already pressed comes in by a ramp. False while latched.

        Raises:
            PluginError: the law cannot start; nothing has changed then.
        """
        if self.guard.mode is Mode.ARMED:
            return True
        if self.guard.latched:
            return False
        fresh = [(contact, self.make_law()) for contact in self._under_law()]
        fresh += [(axis, axis.make_law()) for axis in self._axes_under_law()]
        laws = self._start_laws(fresh)
        self.guard.arm()
        self.fallback = False
        for contact, law in laws:
            self._take_law(contact, law)
        for contact in self._fading_out():
            self._blend(contact)
        return True

    def tare(self) -> bool:
        """Count positions from here on. False while forces are let through or it is not known where the device is."""
        if self._blind or not self._calibrated or self.guard.mode is not Mode.DISARMED:
            return False
        motion = self.motion
        self._move_origin([origin + at for origin, at in zip(motion.origin_m, motion.position_m, strict=True)])
        return True

    def forget_origin(self) -> None:
        """Count positions as the device does, for one that is disarmed."""
        self._move_origin([0.0 for _ in self._axes])

    def switch(
        self,
        scene: SceneConfig | None = None,
        safety: SafetyConfig | None = None,
        make_law: Callable[[], RunningLaw] | None = None,
    ) -> Generator[None, None, None]:
        """Take another scene, other limits, another law: all or nothing, and without a step in force.

        It is made ready a slice at a time, and ticks may go on in between; what comes after the last takes it.

        A wall that did not change keeps its clock, law and books; one that changed in place keeps law and books; one
        that is gone fades out. Another law is put on every wall, but not in the place of the fallback, and
        not on couplings and forces, which have a law of their own.

        Raises:
            ConfigError: the scene or the limits do not fit the device; nothing has changed then.
            PluginError: the law cannot start; nothing has changed then.
        """
        return self._switch(scene, safety, make_law, lambda: None)

    def _switch(
        self,
        scene: SceneConfig | None,
        safety: SafetyConfig | None,
        make_law: Callable[[], RunningLaw] | None,
        start_more: Callable[[], object],
    ) -> Generator[None, None, None]:
        """The same; laws of what is beside walls, couplings and forces start with theirs, in the tick that takes it."""
        if safety is not None:
            limits(safety, self.info)
        make = self.make_law if make_law is None else make_law
        there = Arrangement(self.contacts)
        ports = PortArrangement(self.couplings)
        if scene is not None:
            check_objects(scene.objects, self.info)
            walls = compile_walls(scene.walls, self.info, self.period_s)
            yield
            there = yield from arrange(walls, self.contacts, self.info, make)
            ports = yield from arrange_ports(scene, self.couplings, self._port)
        new: list[Contact] = [*there.new, *axes_of(ports.new)]
        laws = [(contact, contact.law) for contact in new]
        turned = axes_of(ports.turned)
        laws += [(axis, axis.make_law()) for axis in turned]
        if make_law is not None:
            for contact in there.contacts:
                if contact not in there.new:
                    laws.append((contact, make()))
                    yield
        gone = []
        for contact in [each for each in self.contacts if each not in there.contacts]:  # a blend takes their force
            gone.append((contact, RunningLaw(fallback, fallback.Params(damping_n_s_per_m=0.0))))
            yield
        for contact in there.new:
            contact.start(self.motion.position_m[contact.wall.axis])
        self._start_laws(laws)
        start_more()
        # From here on nothing can fail.
        self.make_law = make
        if safety is not None:
            self.guard.configure(safety, self.info, self.force_n)
            self.motion.watch_speed(self.guard.max_speed_m_per_s < math.inf)
            self.ramp_s = safety.ramp_s
        for contact, law in gone:
            contact.wall.let_go()
            self.leaving.append(contact)
            self._take_law(contact, law)
        for contact, wall in there.changed:
            contact.wall = wall
            self._blend(contact)
        self.contacts = there.contacts
        self._take_ports(ports)
        self._changing = any(contact.wall.changes_left for contact in self.contacts)
        if self.fallback:
            laws = self._start_laws([(contact, self._fallback_law()) for contact in (*new, *turned)])
        for contact, law in laws:
            self._take_law(contact, law)
        if self.guard.limited:  # who goes on would take a larger share of the limit at once
            for contact in self._active:
                self._blend(contact)

    def totals(self) -> Totals:
        """The books of all that there ever was."""
        totals = Totals()
        self.add_totals(totals)
        return totals

    def add_totals(self, totals: Totals) -> None:
        """Add the books of all walls, couplings and forces there ever were."""
        totals.ledger.absorb(self.past)
        for contact in (*self.contacts, *self.leaving):
            totals.ledger.absorb(contact.ledger)
        totals.add(self.past_ports)
        for port in (*self.couplings, *self.leaving_ports):
            totals.add_moving(port.books)

    def port_work_j(self) -> float:
        """What the clients of all couplings and forces there ever were have put in [J]."""
        ports = (*self.couplings, *self.leaving_ports)
        return self.past_ports.moved_j + sum([port.books.moved_j for port in ports])

    def release(self, ramp_s: float | None = None) -> None:
        """Ramp the force to zero and stay disarmed."""
        self.guard.release(self.ramp_s if ramp_s is None else ramp_s)

    def fail(self, code: EventCode, text: str) -> None:
        """Stop because of a fault: ramp the force to zero and latch. The same fault is reported once until cleared."""
        if not self.fault and not (self.guard.latched and code == self._last_fault):
            self.fault = self._last_fault = code
            self.fault_text = text
        self.guard.release(self.ramp_s, latch=True)

    def fail_law(self, code: EventCode, text: str) -> None:
        """Put the damping fallback in the place of every law, and stop."""
        if not self.fallback:
            self.fallback = True
            failing = (*self._under_law(), *self._axes_under_law())
            for contact, law in self._start_laws([(contact, self._fallback_law()) for contact in failing]):
                self._take_law(contact, law)
        self.fail(code, text)

    def step(self, sample: Sample, clock_dt_s: float) -> list[float]:
        """One tick.

        Ramps go by the time that has passed on this computer's clock, since a hand feels for how long a force is held
        and not in how many ticks; those of a simulated device go by one period a tick, so that a run can be repeated.

        Where the device has nothing new, laws and books wait; what they asked for last is held, and what the clients of
        couplings and forces change goes on.

        Args:
            sample: the newest state of the device.
            clock_dt_s: time since the last tick on this computer's clock [s].

        Returns:
            The force to write, one element an axis [N]; the same list every time.
        """
        motion = self.motion
        guard = self.guard
        passed_s, periods = self.period_s, 1.0
        if not self._simulated:
            passed_s = clock_dt_s if 0.0 <= clock_dt_s < math.inf else 0.0
            periods = passed_s / self.period_s
        seen = motion.see(sample, clock_dt_s, passed_s, self._blind)
        if self._changing:
            self._change_walls(periods)
        if guard.mode is not _DISARMED:
            if not sample.calibrated:
                seen = False
            elif motion.repeated:
                if motion.frozen and guard.mode is _ARMED:
                    silent_ms = motion.repeated_s * 1e3
                    self.fail(EventCode.DEVICE_FROZEN, f"the device had nothing new for {silent_ms:.3g} ms")
            elif seen and motion.watches_speed:
                self._check_speed()
        else:
            self._calibrated = sample.calibrated
        if not seen or self._blind:
            if not seen or self._blind_gain > 0.0:
                return self._step_blind(sample.calibrated, passed_s)
            self._see_again()
        position_m = motion.position_m
        velocity_m_per_s = motion.velocity_m_per_s
        requested_n = self.requested_n
        force_n = self.force_n
        dt_s = motion.dt_s
        for axis in self._axes:
            requested_n[axis] = force_n[axis] = 0.0
        if dt_s > 0.0:
            contacts = []
            for contact in self._active:
                wall = contact.wall
                axis = wall.axis
                x_m = wall.outward * (position_m[axis] - wall.position_m)
                if x_m < 0.0 or contact.awake:
                    contact.observe(x_m, velocity_m_per_s[axis], dt_s)
                    contacts.append(contact)
                else:
                    contact.x_m = x_m
            try:
                for contact in contacts:
                    contact.act(periods)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # noqa: BLE001 - a law is anybody's code, and a hand is in the device
                self._replace_laws(contact, error, periods)
        else:
            contacts = self._active
            for waiting in contacts:
                waiting.hold(periods)
        for contact in contacts:
            wall = contact.wall
            force_n[wall.axis] += wall.outward * contact.force_n
            requested_n[wall.axis] += wall.outward * contact.requested_n
        share = guard.reduce(force_n, passed_s)
        gain = guard.gain
        limit_n = guard.limit_n
        for contact in contacts:
            contact.settle(share, gain, limit_n, dt_s)
        if self.leaving:
            self._drop_gone()
        return force_n

    def _under_law(self) -> list[Contact]:
        return self.contacts  # all that have a law of [controller]

    def _fading_out(self) -> list[Contact]:
        return self.leaving  # all that hold what is left of a force

    def _axes_under_law(self) -> list[PortAxis]:
        return axes_of([*self.couplings, *self.leaving_ports])  # all that have a law of [remote]

    def _port(self, limits: PortLimits) -> OnePort:
        if self._make_port is None:
            raise ConfigError(f'"{limits.name}": this tick has no {limits.kind}s')
        return self._make_port(limits, self.motion, self.info.resolution_m, self.ramp_s)

    def _take_ports(self, arrangement: PortArrangement) -> None:
        """Go on with other ports; of those that were gone before, the ones that have let go leave the books."""
        arrangement.take()
        for port in [port for port in self.leaving_ports if port.asleep]:
            self.past_ports.add_moving(port.books)
            self.leaving_ports.remove(port)
            port.part()
        self.leaving_ports += arrangement.gone
        self.couplings = arrangement.ports
        for port in self.couplings:
            port.set_ramp(self.ramp_s)
        self._gather()

    def _gather(self) -> None:
        """Make the lists that the ticks go through."""
        self._active = [*self.contacts, *self.leaving, *axes_of(self.couplings), *axes_of(self.leaving_ports)]
        self.ports = list(self.couplings)
        self.has_ports = self.has_ports or bool(self.ports)  # and their books once they are gone

    def _move_origin(self, origin_m: list[float]) -> None:
        self.motion.move_origin(origin_m)
        self._stand()

    def _stand(self) -> None:
        """Be where the device is now, at rest and without force."""
        for contact in self._active:
            contact.start(self.motion.position_m[contact.wall.axis])

    def _fallback_law(self) -> RunningLaw:
        return RunningLaw(fallback, fallback.Params(damping_n_s_per_m=self.info.safe_damping_n_s_per_m))

    def _check_speed(self) -> None:
        limit = self.guard.max_speed_m_per_s
        if self.motion.speed_squared > limit * limit and self.guard.mode is _ARMED:
            speed = math.sqrt(self.motion.speed_squared)
            self.fail(EventCode.OVER_SPEED, f"{speed:.3g} m/s is above the limit of {limit:g} m/s")

    def _change_walls(self, periods: float) -> None:
        """Bring changes of walls into force whose time has come: on a real device by a ramp."""
        self._changing = False
        for contact in self.contacts:
            wall = contact.wall
            if wall.changes_left:
                if wall.pass_time(periods) and not self._simulated:
                    self._blend(contact)
                if wall.changes_left:
                    self._changing = True

    def _replace_laws(self, contact: Contact, error: BaseException, periods: float) -> None:
        """A law raised or returned nonsense: all are replaced, and asked again."""
        frames = {frame.f_globals.get("__name__") for frame, _ in walk_tb(error.__traceback__)}
        failed = next((each for each in self._active if each.law.module.__name__ in frames), contact)
        name = failed.law.module.__name__
        self.fail_law(EventCode.LAW_FAILED, f"law {name}: {in_words(error, name)}")
        for each in self._active:
            each.act(periods)

    def _step_blind(self, calibrated: bool, passed_s: float) -> list[float]:
        """Let the last force out quickly: without a position there is no wall.

        That a device which is not calibrated does not know where it is is no fault as long as it has no force.
        """
        force_n = self.force_n
        guard = self.guard
        if guard.mode is Mode.ARMED or (calibrated and (self._excused or not self._blind)):
            self.fail(EventCode.SAMPLE_IMPOSSIBLE, _IMPOSSIBLE if calibrated else _LOST)
        self._excused = not calibrated
        if not self._blind:
            self._blind = True
            self._blind_gain = 1.0
            self._blind_from_n = list(force_n)
        self._blind_gain = let_out(self._blind_gain, BLIND_RAMP_S, passed_s)
        if self._blind_gain == 0.0:
            guard.drop()
        for axis in self._axes:
            force_n[axis] = self._blind_gain * self._blind_from_n[axis]
            self.requested_n[axis] = 0.0
        return force_n

    def _see_again(self) -> None:
        """Positions make sense again: stand there, at rest and without force; if armed by then, come in by a ramp."""
        self._blind = False
        self._stand()
        for contact in self._active:
            self._blend(contact)

    def _start_laws(self, laws: list[tuple[Contact, RunningLaw]]) -> list[tuple[Contact, RunningLaw]]:
        """Start each law where its contact is now, and hand them back; nothing else has changed yet."""
        velocity_m_per_s = self.motion.velocity_m_per_s
        for contact, law in laws:
            law.start(contact.snapshot(velocity_m_per_s[contact.wall.axis]))
        return laws

    def _take_law(self, contact: Contact, law: RunningLaw) -> None:
        """Put a law that has been started on a contact: by a ramp."""
        motion = self.motion
        contact.take_law(law, motion.velocity_m_per_s[contact.wall.axis], motion.dt_s)
        self._blend(contact)

    def _blend(self, contact: Contact) -> None:
        contact.blend(self.ramp_ticks, self.guard.gain, self.guard.limit_n)

    def _drop_gone(self) -> None:
        """Close the books of walls whose force has faded out."""
        for contact in [each for each in self.leaving if not each.blending and each.applied_n == 0.0]:
            self.past.absorb(contact.ledger)
            self.leaving.remove(contact)
            self._active.remove(contact)

"""One tick, without clocks or devices: sample in, force out. The daemon and every offline run share it.

positions -> velocities -> contacts -> laws -> guard -> force; then the books

What may happen between two samples stands in one module, so that the order of it can be read from top to bottom: `step`
is the tick itself, and what it calls now and then follows below.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo, Sample
from hapticd.errors import in_words
from hapticd.tick import fallback
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.energy import EnergyLedger
from hapticd.tick.event import EventCode
from hapticd.tick.flags import Flag
from hapticd.tick.guard import Guard, Mode, begin_late, limits
from hapticd.tick.motion import Motion
from hapticd.tick.remote.port import Port
from hapticd.tick.remote.tick_ports import MakePort, TickPorts
from hapticd.tick.scene import check_objects, compile_walls
from hapticd.tick.sight import Sight
from hapticd.tick.space.books import Totals
from hapticd.tick.switch import Switch

if TYPE_CHECKING:  # what a scene without couplings and forces never loads
    from hapticd.tick.remote.one_port import OnePort

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
        sight: whether that is known.
        contacts: one a wall, in scene order.
        leaving: walls that are gone and whose force still fades out.
        past: books of the walls that are gone, so that the sums over all walls never jump.
        force_n: force applied by the last tick, one element an axis [N].
        requested_n: what the laws asked for [N].
        fault: code of a fault raised by the last tick, 0 when there was none; the loop takes and clears it.
        fault_text: what there is to say about it.
        just_armed: no tick has come since, and ramps begin with the next one.
        advance: what a loop calls each tick: `step`, or what else a scene needs.
        has_objects: whether the scene has objects in space.
        law_clock: reads the processor time of this thread [ns]; None: laws are not timed.
        law_ns: processor time of the laws of the last tick, where they are timed [ns].
        ports: what clients drive, in scene order: objects, couplings, forces.
        own_ports: of these the ones that pull by themselves, couplings and forces, and their books.
        has_ports: whether there are ports, or were.

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
        self.sight = Sight(axes)
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
        self.just_armed = False
        self.law_clock: Callable[[], int] | None = None
        self.law_ns = 0
        self._last_fault = 0
        self._axes = range(axes)
        self._simulated = info.simulated
        self.own_ports = TickPorts(scene, make_port, self.motion, info.resolution_m, ramp_s)
        self._gather()
        self._changing = any(contact.wall.changes_left for contact in self.contacts)
        self.motion.watch_speed(guard.max_speed_m_per_s < math.inf)
        self.ports: list[Port]
        self.advance: Callable[[Sample, float], list[float]] = self.step

    @property
    def ramp_ticks(self) -> int:
        """Ticks that a ramp takes where none is late."""
        return max(1, round(self.ramp_s / self.period_s))

    @property
    def couplings(self) -> list[OnePort]:
        """The couplings and forces of the scene, in its order."""
        return self.own_ports.couplings

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
        self.sight.start(self.motion.start(sample), sample.calibrated)
        if self.sight.blind and sample.calibrated:
            self.fail(EventCode.SAMPLE_IMPOSSIBLE, _IMPOSSIBLE)
        self._stand()
        self._start_laws([(contact, contact.law) for contact in (*self._under_law(), *self.own_ports.axes)])

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
        sight = self.sight
        passed_s = self.period_s if self._simulated else self._passed(clock_dt_s)
        periods = passed_s / self.period_s
        seen = motion.see(sample, clock_dt_s, passed_s, sight.blind)
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
            sight.calibrated = sample.calibrated
        if not seen or sight.blind:
            if not seen or sight.gain > 0.0:
                return self._step_blind(sample.calibrated, passed_s)
            self._see_again()
        position_m = motion.position_m
        velocity_m_per_s = motion.velocity_m_per_s
        requested_n = self.requested_n
        force_n = self.force_n
        dt_s = motion.dt_s
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
            law_clock = self.law_clock
            if law_clock is not None:
                self.law_ns = -law_clock()
            try:
                for contact in contacts:
                    contact.act(periods)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # noqa: BLE001 - a law is anybody's code, and a hand is in the device
                self._replace_laws(contact, error, periods, ())
            if law_clock is not None:
                self.law_ns += law_clock()
        else:
            contacts = self._active
            for waiting in contacts:
                waiting.hold(periods)
        for axis in self._axes:
            requested_n[axis] = force_n[axis] = 0.0
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
        fresh += [(axis, axis.make_law()) for axis in self.own_ports.axes]
        laws = self._start_laws(fresh)
        self.guard.arm()
        self.fallback = False
        self.just_armed = True
        self._arm_books()
        for contact, law in laws:
            self._take_law(contact, law)
        for contact in self._fading_out():
            self._blend(contact)
        return True

    def release(self, ramp_s: float | None = None) -> None:
        """Ramp the force to zero and stay disarmed."""
        self.guard.release(self.ramp_s if ramp_s is None else ramp_s)

    def begin_late(self, late_s: float) -> None:
        """Have the ramps that have been asked for since the last tick begin now, and not right after it.

        Else they would have come that far in their first tick, with a step of the force. A release counts all of it:
        the force that it lets out was held.

        Args:
            late_s: how long it took to make ready what they are for [s].
        """
        if self._simulated:
            return
        self.guard.begin_late(late_s)
        self._begin_late(late_s / self.period_s)

    def tare(self) -> bool:
        """Count positions from here on. False while forces are let through or it is not known where the device is."""
        if self.sight.blind or not self.sight.calibrated or self.guard.mode is not Mode.DISARMED:
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
            failing = (*self._under_law(), *self.own_ports.axes)
            for contact, law in self._start_laws([(contact, self._fallback_law()) for contact in failing]):
                self._take_law(contact, law)
        self.fail(code, text)

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
        if self.has_ports:
            self.own_ports.add_totals(totals)

    def _passed(self, clock_dt_s: float) -> float:
        """Time that a tick of a real device counts for [s]: the first one after an arm no more than a period."""
        passed_s = clock_dt_s if 0.0 <= clock_dt_s < math.inf else 0.0
        if self.just_armed:
            self.just_armed = False
            if passed_s > self.period_s:  # enabling the device took that, without force
                for port in self.ports:
                    port.miss_time(passed_s - self.period_s)
                return self.period_s
        return passed_s

    def _change_walls(self, periods: float) -> None:
        """Bring changes of walls into force whose time has come: on a real device by a ramp."""
        self._changing = changed = False
        for contact in self.contacts:
            wall = contact.wall
            if wall.changes_left:
                if wall.pass_time(periods) and not self._simulated:
                    self._blend(contact)
                    changed = True
                if wall.changes_left:
                    self._changing = True
        if changed:
            if self.guard.limited:  # the others would take a larger share of the limit at once
                self._blend_all()
            self._begin_late(math.inf)

    def _check_speed(self) -> None:
        most_m_per_s = self.guard.max_speed_m_per_s
        if self.motion.speed_squared > most_m_per_s * most_m_per_s and self.guard.mode is _ARMED:
            speed_m_per_s = math.sqrt(self.motion.speed_squared)
            self.fail(EventCode.OVER_SPEED, f"{speed_m_per_s:.3g} m/s is above the limit of {most_m_per_s:g} m/s")

    def _step_blind(self, calibrated: bool, passed_s: float, text: str = _IMPOSSIBLE) -> list[float]:
        """Let the last force out quickly, and be disarmed then; the text is of a fault of one that is calibrated."""
        sight = self.sight
        if self.guard.mode is Mode.ARMED or sight.is_fault(calibrated):
            self.fail(EventCode.SAMPLE_IMPOSSIBLE, text if calibrated else _LOST)
        seen = not sight.blind or sight.gain > 0.0
        sight.let_out(self.force_n, calibrated, passed_s)
        if sight.gain == 0.0:
            self.guard.drop()
            if seen:
                self._stand()
        for port in self.ports:
            port.pass_time(passed_s)
        for axis in self._axes:
            self.requested_n[axis] = 0.0
        return self.force_n

    def _see_again(self) -> None:
        """Positions make sense again: stand there, at rest and without force; if armed by then, come in by a ramp."""
        self.sight.blind = False
        self._stand()
        self._blend_all()

    def _replace_laws(
        self, contact: Contact, error: BaseException, periods: float, more: Iterable[Callable[[float], None]]
    ) -> None:
        """The law of a contact raised or returned nonsense: all are replaced, and asked again, those of `more` too."""
        name = contact.law.module.__name__
        self.fail_law(EventCode.LAW_FAILED, f"law {name}: {in_words(error, name)}")
        self._begin_late(math.inf)
        for act in (*(each.act for each in self._active), *more):
            with suppress(ArithmeticError):  # a spring that is no number keeps the force that it had, which fades out
                act(periods)

    def _drop_gone(self) -> None:
        """Close the books of walls whose force has faded out."""
        faded = [each for each in self.leaving if not each.blending and each.applied_n == each.applied_sum == 0.0]
        for contact in faded:
            self.past.absorb(contact.ledger)
            self.leaving.remove(contact)
            self._active.remove(contact)

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
        switch = Switch(self.contacts, self.own_ports)
        if scene is not None:
            yield from switch.to_scene(scene, self.info, self.period_s, self.ramp_s, make)
        if make_law is not None:
            yield from switch.to_law(make_law)
        for contact in switch.walls.new:
            contact.start(self.motion.position_m[contact.wall.axis])
        self._start_laws(switch.laws)
        start_more()
        self.make_law = make
        self._take(switch, safety)

    def _take(self, switch: Switch, safety: SafetyConfig | None) -> None:
        """Go on with what has been made ready and started; nothing can fail from here on."""
        if safety is not None:
            self.guard.configure(safety, self.info, self.force_n)
            self.motion.watch_speed(self.guard.max_speed_m_per_s < math.inf)
            self.ramp_s = safety.ramp_s
        for contact, law in switch.gone:
            contact.wall.let_go()
            self.leaving.append(contact)
            self._take_law(contact, law)
        for contact, wall in switch.walls.changed:
            contact.wall = wall
            self._blend(contact)
        self.contacts = switch.walls.contacts
        self.own_ports.take(switch.ports, self.ramp_s)
        self._gather()
        self._changing = any(contact.wall.changes_left for contact in self.contacts)
        laws = switch.laws
        if self.fallback:
            laws = self._start_laws([(contact, self._fallback_law()) for contact in switch.fresh])
        for contact, law in laws:
            self._take_law(contact, law)
        if self.guard.limited:  # who goes on would take a larger share of the limit at once
            self._blend_all()

    def _gather(self) -> None:
        """Make the lists that the ticks go through."""
        self._active = [*self.contacts, *self.leaving, *self.own_ports.axes]
        self.ports = list(self.couplings)
        self.has_ports = self.has_ports or bool(self.ports)  # and their books once they are gone

    def _arm_books(self) -> None:
        """Tell the books what springs hold that are pressed by now."""
        for contact in self.contacts:
            if contact.in_contact:
                contact.ledger.arm(contact.wall.stored_j(contact.x_m, self.guard.limit_n))

    def _under_law(self) -> list[Contact]:
        return self.contacts  # all that have a law of [controller]

    def _fading_out(self) -> list[Contact]:
        return self.leaving  # all that hold what is left of a force

    def _move_origin(self, origin_m: list[float]) -> None:
        self.motion.move_origin(origin_m)
        self._stand()

    def _stand(self) -> None:
        """Be where the device is now, at rest and without force."""
        for contact in self._active:
            contact.start(self.motion.position_m[contact.wall.axis])

    def _fallback_law(self) -> RunningLaw:
        return RunningLaw(fallback, fallback.Params(damping_n_s_per_m=self.info.safe_damping_n_s_per_m))

    def _start_laws(self, laws: list[tuple[Contact, RunningLaw]]) -> list[tuple[Contact, RunningLaw]]:
        """Start each law where its contact is now, and hand them back; nothing else has changed yet."""
        velocity_m_per_s = self.motion.velocity_m_per_s
        self.own_ports.share_debts()
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

    def _blend_all(self) -> None:
        """Have all that acts on the device go over from what it applies now."""
        for contact in self._active:
            self._blend(contact)

    def _begin_late(self, periods: float) -> None:
        """Delay ramps whose first tick is still to come by so many periods; inf: begin with that tick, however late."""
        for contact in (*self._under_law(), *self._fading_out(), *self.own_ports.axes):
            begin_late(contact, periods)

"""The tick of a device with three axes: walls as ever, and what a scene with objects runs beside them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from functools import partial
from typing import TYPE_CHECKING, cast

from hapticd.config.models import SceneConfig, VelocityConfig
from hapticd.config.ports import PortLimits, port_limits
from hapticd.config.safety import SafetyConfig
from hapticd.device import DeviceInfo, Sample
from hapticd.errors import ConfigError
from hapticd.shapes.pose import Vector
from hapticd.shapes.reach import Nearby
from hapticd.tick.contact import Contact, RunningLaw
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Guard, Mode
from hapticd.tick.remote.tick_ports import MakePort
from hapticd.tick.space.books import SpaceBooks, Totals
from hapticd.tick.space.channel import share_debt, stretched_m
from hapticd.tick.space.solid import Solid, astray, at_once, compile_objects
from hapticd.tick.space.solid_contact import SolidContact
from hapticd.tick.space.switch import SpaceSwitch, holding
from hapticd.tick.switch import no_law
from hapticd.tick.tick import ControlTick

if TYPE_CHECKING:  # what a scene without remote objects never loads
    from hapticd.tick.remote.remote_object import RemoteContact

MakeRemote = Callable[[Solid, Callable[[], RunningLaw], float, PortLimits, float, float], "RemoteContact"]
"""Makes the contact of an object that a client moves: the solid, a fresh law, the device's resolution [m], its limits,
the duration of its ramps and the nominal time between ticks [s]."""

Limits = dict[str, PortLimits]
"""What clients may do with the objects that they move, by name."""

_DISARMED, _ARMED = Mode.DISARMED, Mode.ARMED


class SpaceTick(ControlTick):
    """The state of the control loop on a device with three axes, between samples.

    A scene without objects runs the tick of walls and nothing else. What is out of the device's reach is not looked at.

    Attributes:
        solids: one a solid, in scene order.
        objects: how many objects the scene has.
        listing: counted up whenever one of them comes, goes or changes places.
        awake: those that the device may touch, and those that fade out.
        held: of those awake the ones whose force a tick without news holds.
        fading: those that are gone and whose force still fades out.
        moving: those that clients move.
        at_m: where the last sample was that had news [m].
        nearby: which solids are in reach.
        books: of all objects together.

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
        make_remote: MakeRemote | None = None,
    ) -> None:
        super().__init__(scene, velocity, guard, info, make_law, period_s, ramp_s, make_port)
        self._make_remote = make_remote
        limits = _object_limits(scene)
        solids = at_once(compile_objects(scene.objects, period_s))
        self.solids = [self._contact(solid, make_law, limits) for solid in solids]
        for each in self._moving():
            each.join()
        self.objects = len(scene.objects)
        self.listing = 0
        self.awake: list[SolidContact] = []
        self.books = SpaceBooks()
        self.fading: list[SolidContact] = []
        self.held: list[SolidContact] = []
        self.moving: list[RemoteContact] = []
        self.at_m: Vector = (0.0, 0.0, 0.0)
        self._take_solids()
        if info.start_m:
            x, y, z = info.start_m
            for solid in self.solids:
                solid.start(x, y, z)
                if solid.depth_m > 0.0:
                    raise ConfigError(
                        f"{solid.solid.place}: swallows the device, which starts {solid.depth_m * 1e3:.3g} mm inside it"
                    )

    def switch(
        self,
        scene: SceneConfig | None = None,
        safety: SafetyConfig | None = None,
        make_law: Callable[[], RunningLaw] | None = None,
    ) -> Generator[None, None, None]:
        """Take another scene, other limits, another law: all or nothing, and without a step in force.

        An object goes on under its name: with its laws and its books, whatever about it is another. One that changed
        comes in by a ramp, as what it held fades out; one that is gone fades out.

        Raises:
            ConfigError: the scene or the limits do not fit the device; nothing has changed then.
            PluginError: the law cannot start; nothing has changed then.
        """
        make = self.make_law if make_law is None else make_law
        limits = {} if scene is None else _object_limits(scene)
        switch = SpaceSwitch(self.solids)
        if scene is not None:
            contact_of = partial(self._contact, make_law=make, limits=limits)
            yield from switch.to_scene(scene.objects, self.period_s, contact_of, make)
        if make_law is not None:
            yield from switch.to_law(make_law)

        def start() -> None:
            if not self.has_objects:  # it is kept up only while there are objects
                x, y, z = self.motion.position_m
                self.at_m = (x, y, z)
            holders = self._holders()
            for contact in switch.new:
                contact.start(*self.at_m)
                if contact.in_contact:
                    contact.take_side(holding(holders, contact.solid), *self.at_m)
            self._start_laws(switch.laws)

        yield from self._switch(scene, safety, make_law, start)
        self._take_objects(switch)
        if scene is not None:
            self.objects = len(scene.objects)
            self._join(limits)
        self._take_object_laws(switch)
        self._take_solids()

    def totals(self) -> Totals:
        """The books of all walls, objects, couplings and forces there ever were."""
        totals = self.books.totals(self.awake)
        self.add_totals(totals)
        return totals

    def step_in_space(self, sample: Sample, clock_dt_s: float) -> list[float]:
        """One tick of a scene with objects: `step`, with objects beside the walls.

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
            before_x, before_y, before_z = self.at_m
            x, y, z = position_m
            self.at_m = at = (x, y, z)
            way = (x - before_x, y - before_y, z - before_z)
            vx, vy, vz = velocity_m_per_s
            if self.nearby.moved_out(x, y, z):
                self._look_around((before_x, before_y, before_z))
            try:
                self.held = held = [solid for solid in self.awake if solid.observe(at, (vx, vy, vz), way, dt_s)]
            except ArithmeticError:
                return self._step_blind(sample.calibrated, passed_s, astray(each.solid for each in self.awake))
            law_clock = self.law_clock
            if law_clock is not None:
                self.law_ns = -law_clock()
            solid: SolidContact | None = None
            try:
                for contact in contacts:
                    contact.act(periods)
                for solid in held:
                    solid.act(periods)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # noqa: BLE001 - a law is anybody's code, and a hand is in the device
                self._replace_laws(solid.normal if solid else contact, error, periods, [each.act for each in held])
            if law_clock is not None:
                self.law_ns += law_clock()
        else:
            contacts = self._active
            held = self.held
            for waiting in contacts:
                waiting.hold(periods)
            for solid in held:
                solid.hold(periods)
            for moving in self.moving:
                moving.wait(passed_s)
        for axis in self._axes:
            requested_n[axis] = force_n[axis] = 0.0
        for contact in contacts:
            wall = contact.wall
            force_n[wall.axis] += wall.outward * contact.force_n
            requested_n[wall.axis] += wall.outward * contact.requested_n
        same = force_n == requested_n
        for solid in held:
            if solid.add(force_n):
                same = False
        if same:
            requested_n[:] = force_n
        else:
            for solid in held:
                solid.add_requested(requested_n)
        share = guard.reduce(force_n, passed_s)
        gain = guard.gain
        limit_n = guard.limit_n
        for contact in contacts:
            contact.settle(share, gain, limit_n, dt_s)
        for solid in held:
            solid.settle(share, gain, limit_n, dt_s)
        if self.leaving:
            self._drop_gone()
        if self.fading:
            self._drop_faded()
        return force_n

    def _arm_books(self) -> None:
        super()._arm_books()
        for contact in [each for each in self.solids if each.depth_m > 0.0]:
            contact.ledger.arm(contact.solid.stored_j(stretched_m(contact.solid.proxy), self.guard.limit_n))

    def _under_law(self) -> list[Contact]:
        return [*self.contacts, *(channel for contact in self.solids for channel in contact.channels)]

    def _fading_out(self) -> list[Contact]:
        return [*self.leaving, *(channel for contact in self.fading for channel in contact.channels)]

    def _start_laws(self, laws: list[tuple[Contact, RunningLaw]]) -> list[tuple[Contact, RunningLaw]]:
        for contact in self.solids:
            share_debt(contact.channels, contact.ledger.debt_j)
        return super()._start_laws(laws)

    def _stand(self) -> None:
        super()._stand()
        x, y, z = self.motion.position_m
        self.at_m = (x, y, z)
        for contact in (*self.solids, *self.fading):
            contact.start(x, y, z)
        self._take_solids()

    def _blend_all(self) -> None:
        super()._blend_all()
        for channel in [each for contact in (*self.solids, *self.fading) for each in contact.channels]:
            self._blend(channel)

    def _contact(self, solid: Solid, make_law: Callable[[], RunningLaw], limits: Limits) -> SolidContact:
        if solid.remote:
            if self._make_remote is None:
                raise ConfigError(f'"{solid.name}": this tick has no remote objects')
            times_s = self.ramp_s, self.period_s
            return self._make_remote(solid, make_law, self.info.resolution_m, limits[solid.name], *times_s)
        return SolidContact(solid, make_law, self.info.resolution_m)

    def _take_objects(self, switch: SpaceSwitch) -> None:
        """Go on with the objects that have been made ready; nothing can fail from here on."""
        limit_n, gain = self.guard.limit_n, self.guard.gain
        before = _places(self.solids)
        holders = self._holders()
        held = [holding(holders, solid) for _, solid, _ in switch.changed]  # before the first of them is another
        for contact, solid in switch.kept:
            contact.solid.index, contact.solid.members = solid.index, solid.members
        for contact, still in switch.gone:
            contact.let_go(limit_n, gain)
            self.fading.append(contact)
            for channel, law in still:
                self._take_law(channel, law)
        for (contact, solid, channels), proxies in zip(switch.changed, held, strict=True):
            if any(contact.force):
                self._fade(contact)
            contact.change(solid, channels, proxies, limit_n, gain, self.at_m)
        self.solids = switch.solids
        self.listing += _places(self.solids) != before

    def _holders(self) -> list[SolidContact]:
        """What may hold the device: the objects there are, and those that fade out as long as that is felt."""
        return [*self.solids, *(contact for contact in self.fading if any(contact.force))]

    def _take_object_laws(self, switch: SpaceSwitch) -> None:
        """Put on the laws that have been started, and let come in by a ramp what is another than it was."""
        laws = switch.laws
        if self.fallback:
            laws = self._start_laws([(channel, self._fallback_law()) for channel in switch.fresh])
        for channel, law in laws:
            self._take_law(channel, law)
        for contact, _, _ in switch.changed:
            for channel in contact.channels:
                self._blend(channel)
        if self.guard.limited:  # who goes on would take a larger share of the limit at once
            self._blend_all()

    def _join(self, limits: Limits) -> None:
        """Have clients move the objects that are theirs, within the limits that the scene sets them."""
        for each in self._moving():
            each.join()
            each.ramp_s = self.ramp_s
            each.port.change(limits[each.port.name])

    def _moving(self) -> list[RemoteContact]:
        return [cast("RemoteContact", contact) for contact in self.solids if contact.moves]

    def _take_solids(self) -> None:
        """Run what the scene needs from now on."""
        self.nearby = Nearby([contact.reach() for contact in self.solids])
        self.moving = self._moving()
        self.ports = [*(contact.port for contact in self.moving), *self.couplings]
        self.has_ports = self.has_ports or bool(self.ports)
        self.has_objects = self.has_objects or bool(self.solids)  # and their books once they are gone
        self.advance = self.step_in_space if self.has_objects else self.step
        self._look_around(self.at_m)

    def _look_around(self, since: Vector) -> None:
        """Find out which solids are in reach; one that comes into reach is begun with.

        Args:
            since: where the device was when it was out of their reach [m].
        """
        near = set(self.nearby.look(*self.at_m))
        before = set(map(id, self.awake))
        self.awake = list(self.fading)
        self.held = [contact for contact in self.held if contact in self.fading or contact in self.solids]
        resting = []
        for at, contact in enumerate(self.solids):
            if at in near or not contact.quiet:
                if id(contact) not in before and contact.quiet:
                    contact.start(*since)
                self.awake.append(contact)
            else:
                resting.append(contact)
        self.books.rest(resting)

    def _fade(self, contact: SolidContact) -> None:
        """Have what a contact applies fade out beside it."""
        shade = contact.shade(no_law)
        self.fading.append(shade)
        self.held.append(shade)  # also at a tick without a new sample
        for channel in shade.channels:
            self._blend(channel)

    def _drop_faded(self) -> None:
        """Close the books of what has faded out."""
        gone = [contact for contact in self.fading if contact.faded]
        if gone:
            for contact in gone:
                self.books.close(contact)
                if contact.moves:  # its port knows it, and in the loop no collector looks for circles
                    del cast("RemoteContact", contact).port
            self.fading = [contact for contact in self.fading if contact not in gone]
            self._take_solids()


def _object_limits(scene: SceneConfig) -> Limits:
    return {limits.name: limits for limits in port_limits(scene) if limits.kind == "object"}


def _places(solids: Iterable[SolidContact]) -> list[tuple[object, ...]]:
    """Who stands where in the list of objects."""
    return [(contact.solid.name, contact.moves, contact.solid.members) for contact in solids]

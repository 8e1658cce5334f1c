"""What the supervisor may ask of the running loop, worked off in slices between ticks.

A new law or scene is built a slice a tick, in the time left before the next deadline, and taken at a tick boundary.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from hapticd import plugins
from hapticd.config.models import SceneConfig
from hapticd.config.objects import OBJECT, MeshObject
from hapticd.config.safety import SafetyConfig
from hapticd.config.walls import WallConfig
from hapticd.driver import DriverState
from hapticd.errors import HapticdError
from hapticd.loop.memory import DISARM, DISARMED_SINCE, FIELDS, LAW_CODE
from hapticd.loop.session import Session
from hapticd.loop.worker import Worker
from hapticd.tick.contact import RunningLaw
from hapticd.tick.event import EventCode
from hapticd.tick.guard import Mode
from hapticd.tick.space.solid import field_of, fields_of

_SWITCH_INTERVAL_S = 5e-5
"""How soon an import that runs beside the loop gives the interpreter back to it [s]."""


class RequestHandler:
    """Answers the supervisor's requests.

    Args:
        session: the loop that they are for.

    Attributes:
        worker: does what takes longer than a slice; started before the first request.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._work: Generator[None, None, None] | None = None
        self._laws: dict[str, ModuleType] = {}
        self._disarms = 0  # how often disarming had been asked for when the request was sent
        self.worker = Worker()

    def know(self, name: str, law: ModuleType) -> None:
        """Remember an imported law, so that a switch to it imports nothing."""
        self._laws[name] = law

    def work(self) -> None:
        """Do the next slice of the request that waits; answer it when it is done.

        One that would put forces on is refused when disarming was asked for after it was sent.
        """
        shared = self._session.shared
        try:
            if self._work is None:
                request = shared.request()
                do = request.pop("do")
                self._disarms = request.pop("disarm")
                if self._withdrawn and do in ("arm", "calibrate"):
                    raise HapticdError(DISARMED_SINCE)
                self._work = getattr(self, f"_do_{do}")(**request)
            next(self._work)
        except StopIteration:
            self._work = None
            shared.answer("")
        except Exception as error:  # noqa: BLE001 - the loop goes on whatever the supervisor asks for
            self._work = None
            text = str(error) if isinstance(error, HapticdError) else f"{type(error).__name__}: {error}"
            shared.answer(text or type(error).__name__)

    @property
    def _withdrawn(self) -> bool:
        """Whether disarming was asked for after the request was sent."""
        return self._session.shared.words[DISARM] != self._disarms

    def _do_arm(self) -> Generator[None, None, None]:
        session = self._session
        session.arm()
        while session.arming:
            yield
        if session.refusal:
            raise HapticdError(session.refusal)
        yield

    def _do_clear(self) -> Generator[None, None, None]:
        guard = self._session.tick.guard
        latched = guard.latched
        guard.clear()
        said = "fault cleared; the device stays disarmed" if latched else "nothing to clear: no fault has stopped it"
        self._session.event(EventCode.CLEARED, said)
        yield

    def _do_calibrate(self) -> Generator[None, None, None]:
        """Calibrate beside the loop, which goes on reading; nothing arms until it is done, since requests wait in line.

        To ask for disarming is to call it off.
        """
        session = self._session
        yield from self._until_released()
        if self._withdrawn:  # while it waited
            raise HapticdError(DISARMED_SINCE)
        if session.driver.state is not DriverState.OPEN:
            raise HapticdError("calibration moves the arm by itself: `hapticd disarm` first")
        session.event(EventCode.CALIBRATING, "calibrating: the arm moves by itself")
        ended: list[Exception | None] = []

        def calibrate() -> None:
            try:
                session.driver.calibrate()
                ended.append(None)
            except Exception as error:  # noqa: BLE001 - handed over to who asked
                ended.append(error)

        self.worker.do(calibrate)
        while not ended:
            if self._withdrawn:
                session.driver.call_off()
            yield
        if ended[0] is not None:
            session.event(EventCode.CALIBRATION_ENDED, f"the calibration ended early: {ended[0]}")
        _raise(ended)
        session.tick.forget_origin()
        session.event(EventCode.CALIBRATED, "calibrated")

    def _do_tare(self) -> Generator[None, None, None]:
        tick = self._session.tick
        yield from self._until_released()
        if not tick.tare():
            raise HapticdError("tare moves the walls: `hapticd disarm` first, and the device must know where it is")
        axes = zip(tick.info.axes, tick.motion.origin_m, strict=True)
        origin_m: dict[str, float | int | str] = {f"origin_{axis}_m": origin for axis, origin in axes}
        self._session.event(EventCode.TARED, "tared: positions count from here", **origin_m)
        yield

    def _until_released(self) -> Generator[None, None, None]:
        """Wait for the ramp of a disarming that was asked for just before: disarmed is what comes of it."""
        session = self._session
        while session.tick.guard.mode is not Mode.ARMED and session.driver.state is DriverState.ENABLED:
            yield

    def _do_switch(
        self,
        law: str,
        params: dict[str, Any],
        scene: dict[str, Any],
        safety: dict[str, Any],
        keep_law: bool,
        was: str,
        config: str,
    ) -> Generator[None, None, None]:
        """Take another law, scene and limits; all or nothing. A law that did not change keeps what it has learnt."""
        session = self._session
        tick = session.tick
        if law not in self._laws:
            yield from self._import(law)
        module = self._laws[law]
        yield
        new_params = module.Params.model_validate(params)
        yield
        pattern = RunningLaw(module, new_params)
        yield
        new_safety = SafetyConfig.model_validate(safety)
        yield
        walls = []
        for wall in scene["walls"]:
            walls.append(WallConfig.model_validate(wall))
            yield
        objects = []
        for each in scene["objects"]:
            objects.append(OBJECT.validate_python(each))
            yield
        new_scene = SceneConfig.model_validate({**scene, "walls": walls, "objects": objects})
        yield
        for each in objects:
            if isinstance(each, MeshObject):
                yield from self._beside(partial(field_of, Path(each.file)))
        fields = fields_of(objects)
        yield from tick.switch(new_scene, new_safety, None if keep_law else pattern.another)
        session.shared.words[LAW_CODE] = plugins.code_of(module)
        session.shared.words[FIELDS] = fields
        session.shared.layout.serve(tick)
        session.said.serve(tick.ports, session.deadline_ns)
        session.stall_ns = int(new_safety.supervisor_stall_s * 1e9)
        if not keep_law:
            session.law_count += 1
        change = f"law {law} goes on" if keep_law else f"law {was} -> {law}"
        session.event(EventCode.SWITCHED, f"configuration {config}: {change}", law_before=was, law=law, config=config)

    def _import(self, name: str) -> Generator[None, None, None]:
        """Import a law beside the loop; its ticks go on, late by the switch interval.

        What holds the interpreter for longer makes them later, as the compiler does for a large law without bytecode.
        """

        def load() -> None:
            self._laws[name] = plugins.law(name)

        yield from self._beside(load)

    def _beside(self, work: Callable[[], object]) -> Generator[None, None, None]:
        """Do what takes long beside the loop.

        Raises:
            Exception: what the work raised.
        """
        ended: list[Exception | None] = []

        def load() -> None:
            try:
                work()
                ended.append(None)
            except Exception as error:  # noqa: BLE001 - without an end of this one no other request would be begun
                ended.append(error)

        before_s = sys.getswitchinterval()
        sys.setswitchinterval(_SWITCH_INTERVAL_S)
        self.worker.do(load)
        while not ended:
            yield
        sys.setswitchinterval(before_s)
        _raise(ended)


def _raise(ended: list[Exception | None]) -> None:
    """Raise what a thread has handed over, if anything.

    It is not kept: an error knows the frames that it went through, and in this process no collector breaks cycles.
    """
    if ended[0] is not None:
        raise cast(Exception, ended.pop())

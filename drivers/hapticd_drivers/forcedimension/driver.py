"""Driver `omega7`: an omega.7, or any other device of Force Dimension, through the vendor's SDK.

Nothing of this has been tried on hardware; what it has been tried on is a fake library with the same ABI.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import math
from collections.abc import Callable, Sequence

from hapticd.device import DeviceInfo, Diagnosis, FoundDevice, Metric, Sample
from hapticd.driver import Driver, DriverState
from hapticd.errors import ConfigError, DeviceFaultError, DriverError, DriverStateError
from hapticd.trace import DriverTrace
from hapticd_drivers.forcedimension import diagnosis, discovery, presence, settings
from hapticd_drivers.forcedimension.failures import NOT_AVAILABLE, TIMEOUT, cause_of
from hapticd_drivers.forcedimension.models import MODELS, NOMINAL_RATE_HZ, Model, unknown
from hapticd_drivers.forcedimension.options import WATCHDOG_UNIT_MS, ForceDimensionOptions
from hapticd_drivers.forcedimension.processors import on_every_processor
from hapticd_drivers.forcedimension.prototypes import (
    SATURATED,
    STATUS_ERROR,
    STATUS_FORCE,
    STATUS_FORCE_OFF_CAUSE,
    STATUS_WORDS,
)
from hapticd_drivers.forcedimension.sdk import Sdk

SETTLE_S = 0.1
"""How long after being enabled the device may still say that forces are off: known programs wait as long [s]."""

STOP_ATTEMPTS = 5
"""How often `dhdStop` is tried before forces are switched off another way."""

_CACHED_SAMPLES, _SATURATED_FORCES, _VELOCITY_ERRORS = range(3)
"""Places in `ForceDimension.METRICS`."""


class ForceDimension(Driver[ForceDimensionOptions]):
    """Omega.7 and the other Force Dimension devices, through the vendor's SDK."""

    Options = ForceDimensionOptions
    ABSENT = presence.PLUG_IT_IN
    METRICS = (
        Metric("cached_samples", "samples that the SDK's TimeGuard gave a second time"),
        Metric("saturated_forces", "forces that the motors could not give in full and that were scaled down", True),
        Metric("velocity_errors", "times that the SDK could not give its velocity and said no usual reason", True),
    )

    def __init__(self, options: ForceDimensionOptions, period_s: float) -> None:
        super().__init__(options, period_s)
        self.trace = DriverTrace(options.trace)
        self._sdk: Sdk | None = None
        self._id = -1
        self._left = False
        self._to_calibrate = True
        self._watchdog_steps: int | None = None
        self._sample = Sample(3)
        self._position = [ctypes.c_double() for _ in range(3)]
        self._velocity = [ctypes.c_double() for _ in range(3)]
        self._frame = (ctypes.c_double * 9)()
        self._gap = ctypes.c_double()
        self._status = (ctypes.c_int * STATUS_WORDS)()
        self._has_wrist = False
        self._button_bits = 0
        self._until_status = 0
        self._settling = 0
        self._get_pose: Callable[[], int] = _nothing
        self._get_velocity: Callable[[], int] = _nothing
        self._get_gap: Callable[[], int] | None = None
        self._get_buttons: Callable[[], int] = _nothing
        self._get_status: Callable[[], int] = _nothing
        self._set_force: Callable[..., int] = _nothing

    @classmethod
    def find(cls, options: ForceDimensionOptions | None = None) -> list[FoundDevice]:
        """Every device that is there, whether it can be used or not; none is moved, each is opened for a moment.

        Args:
            options: where the SDK is.
        """
        return discovery.find_devices(None if options is None else options.library)

    @classmethod
    def diagnose(cls, options: ForceDimensionOptions | None = None) -> list[Diagnosis]:
        """Which SDK there is, whether it will do, and how many devices it counts; opens none.

        Args:
            options: where the SDK is.
        """
        return diagnosis.diagnose(options or ForceDimensionOptions())

    def _open(self) -> DeviceInfo:
        options = self.options
        self._sdk = sdk = Sdk(options.library, self.trace if options.trace else None)
        found = discovery.open_device(sdk, options.serial, unknown=options.max_force_n is not None)
        self._id = device = found.id
        model = MODELS.get(found.type) or _asked(sdk, found, options)
        self._to_calibrate = model.to_calibrate
        self._left = sdk.dhdIsLeftHanded(device)
        buttons = 1 if options.gripper_button else model.buttons
        self._prepare(sdk, model.wrist, model.gripper, buttons)
        self._stop_what_was_left_on()
        max_force_n = model.max_force_n if options.max_force_n is None else options.max_force_n
        if max_force_n > model.max_force_n:
            raise ConfigError(
                f"device.options.max_force_n = {max_force_n:g}: a {model.name} takes at most {model.max_force_n:g} N"
            )
        if options.gripper_button and not model.gripper:
            raise ConfigError(f"device.options.gripper_button = true: a {model.name} has no gripper")
        settings.configure(sdk, device, options)
        self._watchdog_steps = steps = settings.watchdog_steps(sdk, device, options.watchdog_ms, self.period_s)
        return DeviceInfo(
            model=f"{model.name}, left-handed" if self._left else model.name,
            serial=str(found.serial),
            axes=("x", "y", "z"),
            max_force_n=max_force_n,
            resolution_m=model.resolution_m,
            workspace_m=model.spans_m,
            nominal_rate_hz=NOMINAL_RATE_HZ,
            safe_damping_n_s_per_m=model.safe_damping_n_s_per_m(self.period_s),
            host_silence_ms=steps * WATCHDOG_UNIT_MS if steps else None,
            buttons=buttons,
            has_gripper=model.gripper,
            has_orientation=model.wrist,
            has_velocity=True,
            has_sequence=True,
        )

    def _calibrate(self) -> None:
        sdk = self._opened()
        if sdk.has("drdIsSupported") and not sdk.drdIsSupported(self._id):
            raise DriverStateError("omega7: this device cannot calibrate itself: put its pole into the pit by hand")
        try:
            if self._watchdog_steps is not None:  # only force commands feed it, and here hapticd sends none
                settings.set_watchdog(sdk, self._id, 0)
            with on_every_processor():
                sdk.call("drdAutoInit", self._id)
            sdk.call("drdStop", True, self._id)
        finally:
            self._disable()  # drdStop(true) leaves forces on, with nothing that regulates them
        if not sdk.drdIsInitialized(self._id):
            raise DeviceFaultError("omega7: the device is still not calibrated; switch it off and on and try again")

    def _call_off(self) -> None:
        self._opened().drdStop(False, self._id)  # ends the regulation that moves the arm, and its force

    def _enable(self) -> None:
        sdk = self._opened()
        device = self._id
        if not self._is_calibrated():
            raise DriverStateError(
                "omega7: the device has not been calibrated since it was switched on: clear its workspace, then "
                "`hapticd calibrate`, which moves the arm"
            )
        self._sample.calibrated = True
        self._until_status = 1
        self._settling = math.ceil(SETTLE_S / self.period_s)
        self.forces_flow = False
        try:
            sdk.call("dhdSetMaxForce", self.info.max_force_n, device)
            self._where_there_is("dhdSetBrakes", 0)
            if self._watchdog_steps is not None:
                settings.set_watchdog(sdk, device, self._watchdog_steps)
            sdk.call("dhdEnableForce", 1, device)
            self._where_there_is("dhdSetGravityCompensation", int(self.options.gravity_compensation))
            if self.options.gripper_button:
                sdk.call("dhdEmulateButton", 1, device)
            sdk.call("dhdSetForceAndTorqueAndGripperForce", *[0.0] * 7, device)
        except BaseException:
            with contextlib.suppress(DriverError):  # the first error says more
                self._disable()
            raise

    def _read(self) -> Sample:
        result = self._get_pose()
        if result:
            if result < 0:
                raise self._opened().failure("reading the position")
            self.metrics[_CACHED_SAMPLES] += 1.0
        sample = self._sample
        if not result:
            sample.sequence += 1
        position_m = sample.position_m
        x, y, z = self._position
        position_m[0] = x.value
        position_m[1] = y.value
        position_m[2] = z.value
        velocity_m_per_s = sample.velocity_m_per_s
        if self._get_velocity() >= 0:
            x, y, z = self._velocity
            velocity_m_per_s[0] = x.value
            velocity_m_per_s[1] = y.value
            velocity_m_per_s[2] = z.value
        else:
            self._no_velocity()
        if self._has_wrist:
            sample.orientation[:] = self._frame
        if self._get_gap is not None:
            if self._get_gap() < 0:
                raise self._opened().failure("dhdGetGripperGap")
            # CHAI3D turns the sign of a left-handed gripper's angle; of its gap nobody says, and an opening has none.
            sample.gripper_m = abs(self._gap.value) if self._left else self._gap.value
        if self._button_bits:
            sample.buttons = self._get_buttons() & self._button_bits
        self._until_status -= 1
        if self._until_status <= 0:
            self._look_at_status()
        return sample

    def _write(self, force_n: Sequence[float]) -> None:
        result = self._set_force(force_n[0], force_n[1], force_n[2], 0.0, 0.0, 0.0, 0.0, self._id)
        if result:
            if result < 0:
                raise self._opened().failure("setting the force")
            if result == SATURATED:
                self.metrics[_SATURATED_FORCES] += 1.0

    def _disable(self) -> None:
        sdk = self._sdk
        if sdk is None or self._id < 0:
            return
        for _ in range(STOP_ATTEMPTS):
            if sdk.dhdStop(self._id) >= 0:
                return
        sdk.call("dhdEnableForce", 0, self._id)

    def _close(self) -> None:
        if self._sdk is not None and self._id >= 0:
            discovery.close_device(self._sdk, self._id)
        self._id = -1
        self._sdk = None

    def _opened(self) -> Sdk:
        assert self._sdk is not None
        return self._sdk

    def _is_calibrated(self) -> bool:
        return not self._to_calibrate or bool(self._opened().drdIsInitialized(self._id))

    def _where_there_is(self, name: str, value: int) -> None:
        """Set what not every device has: a Falcon has neither brakes nor compensation."""
        sdk = self._opened()
        if getattr(sdk, name)(value, self._id) < 0 and sdk.last_error() not in NOT_AVAILABLE:
            raise sdk.failure(name)

    def _prepare(self, sdk: Sdk, wrist: bool, gripper: bool, buttons: int) -> None:
        """Every call of a tick with its buffers, made once: the tick allocates nothing but the calls."""
        device = self._id
        self._sample = Sample(3)
        self._sample.calibrated = self._is_calibrated()
        self._has_wrist = wrist
        self._button_bits = (1 << buttons) - 1
        position = [ctypes.byref(number) for number in self._position]
        velocity = [ctypes.byref(number) for number in self._velocity]
        if wrist:
            self._get_pose = functools.partial(sdk.dhdGetPositionAndOrientationFrame, *position, self._frame, device)
        else:
            self._get_pose = functools.partial(sdk.dhdGetPosition, *position, device)
        self._get_velocity = functools.partial(sdk.dhdGetLinearVelocity, *velocity, device)
        gap = ctypes.byref(self._gap)
        self._get_gap = functools.partial(sdk.dhdGetGripperGap, gap, device) if gripper else None
        self._get_buttons = functools.partial(sdk.dhdGetButtonMask, device)
        self._get_status = functools.partial(sdk.dhdGetStatus, self._status, device)
        self._set_force = sdk.dhdSetForceAndTorqueAndGripperForce

    def _stop_what_was_left_on(self) -> None:
        """A program that died, or a cable that was pulled, may have left forces on; no other mode is touched."""
        if self._get_status() < 0:
            raise self._opened().failure("dhdGetStatus")
        if self._status[STATUS_FORCE]:
            self._disable()

    def _no_velocity(self) -> None:
        """The SDK has no velocity until two samples lie in its window; for any other reason it is none.

        A velocity that is no number ends the loop where the estimator is the device's own, and disturbs no other.
        """
        if self._opened().last_error() == TIMEOUT:
            self._sample.velocity_m_per_s[:] = (0.0, 0.0, 0.0)
        else:
            self.metrics[_VELOCITY_ERRORS] += 1.0
            self._sample.velocity_m_per_s[:] = (math.nan, math.nan, math.nan)

    def _look_at_status(self) -> None:
        """Notice that the device has taken the force away by itself, and say why; without force, whether it may."""
        self._until_status = self.options.status_every_ticks
        if self.state is not DriverState.ENABLED:
            self._sample.calibrated = self._is_calibrated()
            return
        if self._get_status() < 0:
            raise self._opened().failure("dhdGetStatus")
        status = self._status
        if status[STATUS_ERROR]:
            raise DeviceFaultError(f"omega7: the device reports an error of its own ({status[STATUS_ERROR]})")
        if status[STATUS_FORCE]:
            self.forces_flow = True
            return
        cause = status[STATUS_FORCE_OFF_CAUSE]
        if self.forces_flow:
            raise DeviceFaultError(f"omega7: the device took the force away: {cause_of(cause)}")
        self._until_status = 1  # no force comes in before it says that they are on
        self._settling -= 1
        if self._settling <= 0:
            why = f" ({cause_of(cause)})" if cause else ""
            raise DeviceFaultError(
                f"omega7: the device lets no forces through{why}: press the FORCE button on it, then arm again"
            )


def _asked(sdk: Sdk, found: discovery.OpenDevice, options: ForceDimensionOptions) -> Model:
    """A device that is in no table, as far as the SDK and the configuration know it."""
    assert options.max_force_n is not None  # or it would not have been opened
    has = [sdk.has(name) and bool(getattr(sdk, name)(found.id)) for name in ("dhdHasWrist", "dhdHasGripper")]
    return unknown(found.name, options.max_force_n, *has)


def _nothing(*_: object) -> int:
    return 0

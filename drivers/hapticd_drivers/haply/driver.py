"""Driver `inverse3`: Haply's Inverse3 with a Verse Grip, through the maker's Inverse service."""

from __future__ import annotations

import time
from collections.abc import Sequence
from urllib.parse import urlsplit

from pydantic import Field

from hapticd.device import DeviceInfo, Diagnosis, FoundDevice, Metric, Sample
from hapticd.driver import Driver, DriverState
from hapticd.errors import DeviceDisconnectedError, DeviceNotFoundError, DeviceProtocolError, DeviceTimeoutError
from hapticd.trace import DriverTrace
from hapticd_drivers.claims import Claims
from hapticd_drivers.haply import messages
from hapticd_drivers.haply.courier import Courier
from hapticd_drivers.haply.traced_courier import TracedCourier
from hapticd_drivers.trace import TraceOptions

AUTO = "auto"
URL = "ws://127.0.0.1:10001"
INSTALL = "# install and start the Haply Inverse service, version 3: docs/inverse3.md"

PATIENCE = 0.25
"""Share of the period for which a tick waits for a state that is late."""

SILENCE_S = 0.5
SILENT_TICKS = 20
"""After this time and this many ticks in a row without a state the service counts as lost [s]."""

URGENT_S = 0.04
"""How long a zero force may take to be answered, since a loop waits for it [s]."""

RESOLUTION_M = 1e-5
METRICS = (
    Metric("exchange_us", "from sending a message to the service to having its state [us]"),
    Metric("longest_exchange_us", "the longest of these since the device was opened [us]"),
    Metric("ticks_without_state", "ticks for which no new state came in time"),
    Metric("dropped_forces", "forces that a newer one replaced before the service could take them"),
    Metric("bad_messages", "messages of the service that make no sense", warns=True),
)
EXCHANGE_US, LONGEST_EXCHANGE_US, TICKS_WITHOUT_STATE, DROPPED, BAD = range(len(METRICS))


class Inverse3Options(TraceOptions):
    """Which service, which device, and what its forces are bounded by."""

    url: str = Field(URL, pattern=r"^ws://[^/\s]+(/\S*)?$", description="of the Inverse service, version 3")
    device: str = Field(AUTO, min_length=1, description='name of the Inverse3, "049D"; "auto": the only one')
    force_key: str = Field(
        "vector", pattern="^(vector|values)$", description="how this service calls a force: 3.5 says vector, 3.1 values"
    )
    max_force_n: float = Field(2.0, gt=0.0, le=10.0, description="largest force, magnitude over all axes [N]")
    reach_m: float = Field(
        0.3, gt=0.0, le=1.0, description="farthest that the handle gets from the origin, each axis [m]"
    )
    moving_mass_kg: float = Field(
        0.1, gt=0.0, le=10.0, description="mass that moves, or less [kg]; the damping of the fallback follows it"
    )


class Inverse3(Driver[Inverse3Options]):
    """Haply's Inverse3, through the maker's service."""

    Options = Inverse3Options
    METRICS = METRICS
    ABSENT = "start the Haply Inverse service (docs/inverse3.md)"

    def __init__(self, options: Inverse3Options, period_s: float) -> None:
        super().__init__(options, period_s)
        self.trace = DriverTrace(options.trace)
        self._courier: Courier | None = None
        self._claims = Claims()
        self._device = ""
        self._sample = Sample(len(messages.AXES))
        self._state_wait_s = PATIENCE * period_s
        self._most_silent = max(SILENT_TICKS, round(SILENCE_S / period_s))
        self._silent = 0
        self._seen = 0
        self._nonsense = ""  # of the last message that made none

    @classmethod
    def find(cls, options: Inverse3Options | None = None) -> list[FoundDevice]:
        """Every Inverse3 that the service lists; none is moved.

        Args:
            options: which service; None: the one of this computer.
        """
        url = URL if options is None else options.url
        try:
            courier = Courier(url)
        except DeviceNotFoundError:
            return []
        try:
            return [FoundDevice("Inverse3", name, url) for name in messages.devices(courier.first)]
        finally:
            courier.end()

    @classmethod
    def diagnose(cls, options: Inverse3Options | None = None) -> list[Diagnosis]:
        """Whether the service is there and speaks as this driver does, and whether it is clear which device is meant.

        Args:
            options: those of the configuration.
        """
        url, wanted = (URL, AUTO) if options is None else (options.url, options.device)
        try:
            courier = Courier(url)
        except DeviceNotFoundError as error:
            return [Diagnosis("problem", str(error).removeprefix("inverse3: "), (INSTALL,))]
        try:
            there = messages.devices(courier.first)
        except ValueError as error:
            text = f"what answers at {url} is no Inverse service of version 3 ({error})"
            return [Diagnosis("problem", text, (INSTALL,))]
        finally:
            courier.end()
        found = [Diagnosis("ok", f"the Inverse service at {url} lists {', '.join(there) or 'no Inverse3'}")]
        if wanted == AUTO and len(there) > 1:
            which = "# in the configuration, [device.options]: device = ...; hapticd devices inverse3 lists them"
            found.append(Diagnosis("problem", "which of them is meant is not clear", (which,)))
        return found

    def _open(self) -> DeviceInfo:
        options = self.options
        self._courier = courier = TracedCourier(options.url, self.trace) if options.trace else Courier(options.url)
        try:
            there = messages.devices(courier.first)
        except ValueError as error:
            raise DeviceProtocolError(
                f"inverse3: what answers at {options.url} is no Inverse service of version 3 ({error})"
            ) from error
        wanted = there if options.device == AUTO else [name for name in there if name == options.device]
        if len(wanted) != 1:
            listed = ", ".join(there) or "none"
            raise DeviceNotFoundError(
                f"inverse3: device.options.device = {options.device!r}: the service lists {listed}: plug it in, wake "
                "it up, or say which one"
            )
        self._device = wanted[0]
        # This computer's service has many names: localhost, 127.0.0.1, ::1, the computer's own.
        self._claims.take("inverse3", f"{self._device} of the service at port {urlsplit(options.url).port or 80}")
        self._silent = 0
        self._seen = courier.exchanges
        self._sample.sequence = 0
        self._exchange(messages.question(self._device), SILENCE_S)
        return DeviceInfo(
            model="Haply Inverse3",
            serial=self._device,
            axes=messages.AXES,
            max_force_n=options.max_force_n,
            resolution_m=RESOLUTION_M,
            workspace_m=((-options.reach_m, options.reach_m),) * len(messages.AXES),
            nominal_rate_hz=1.0 / self.period_s,
            safe_damping_n_s_per_m=0.1 * options.moving_mass_kg / self.period_s,
            host_silence_ms=None,  # what the service does when its client is silent is not documented
            buttons=messages.MOST_BUTTONS,
            has_orientation=True,
            has_velocity=True,
            has_sequence=True,
        )

    def _enable(self) -> None:
        self._let_go()

    def _read(self) -> Sample:
        courier = self._opened()
        if not self._take(courier):
            courier.wait(self._seen, self._state_wait_s)
            if not self._take(courier):
                self._bear_silence(courier)
        if self.state is not _ENABLED:
            courier.send(messages.question(self._device))
        return self._sample

    def _write(self, force_n: Sequence[float]) -> None:
        x, y, z = force_n
        courier = self._opened()
        courier.send(messages.force(self._device, self.options.force_key, (x, y, z)))
        self.metrics[DROPPED] = float(courier.dropped)

    def _disable(self) -> None:
        if self._courier is None:
            return
        if self._courier.failed is not None:
            raise self._courier.failed
        self._let_go()

    def _close(self) -> None:
        courier, self._courier = self._courier, None
        if courier is not None:
            courier.end()
        self._claims.release()

    def _let_go(self) -> None:
        """A force of 0, and a state after it."""
        self._exchange(messages.force(self._device, self.options.force_key, (0.0, 0.0, 0.0)), URGENT_S)

    def _exchange(self, message: str, patience_s: float) -> None:
        """Send a message, and wait for the state that answers it or a later one."""
        courier = self._opened()
        end_s = time.monotonic() + patience_s
        courier.send(message)
        while courier.waiting and courier.failed is None and time.monotonic() < end_s:
            courier.wait(courier.exchanges, min(0.005, patience_s))
        # A new state may answer the message before, with the force that it set.
        if courier.waiting and courier.failed is None:
            raise DeviceTimeoutError(
                f"inverse3: the service at {self.options.url} did not answer within {patience_s:g} s: is it overloaded?"
            )
        if not self._take(courier):
            raise DeviceProtocolError(
                f"inverse3: what the service at {self.options.url} answers makes no sense: {self._nonsense}"
            )

    def _take(self, courier: Courier) -> bool:
        """Take in the newest state, if it is new and makes sense."""
        if courier.failed is not None:
            raise courier.failed
        count = courier.exchanges
        if count == self._seen:
            return False
        self._seen = count
        try:
            state = messages.state(courier.newest, self._device)
        except ValueError as error:
            self.metrics[BAD] += 1.0
            self._nonsense = str(error)
            return False
        if state is None:
            raise DeviceDisconnectedError(
                f"inverse3: the service lists {self._device} no more: is it unplugged, or has it gone to sleep?"
            )
        sample = self._sample
        sample.position_m[:] = state.position_m
        sample.velocity_m_per_s[:] = state.velocity_m_per_s
        sample.orientation[:] = state.orientation
        sample.buttons = state.buttons
        sample.sequence += 1
        self._silent = 0
        exchange_us = courier.exchange_ns * 1e-3
        self.metrics[EXCHANGE_US] = exchange_us
        if exchange_us > self.metrics[LONGEST_EXCHANGE_US]:
            self.metrics[LONGEST_EXCHANGE_US] = exchange_us
        return True

    def _bear_silence(self, courier: Courier) -> None:
        self.metrics[TICKS_WITHOUT_STATE] += 1.0
        self._silent += 1
        if self._silent >= self._most_silent:
            raise DeviceTimeoutError(
                f"inverse3: the service at {self.options.url} has said nothing for {self._silent} ticks: start it again"
            )

    def _opened(self) -> Courier:
        assert self._courier is not None
        return self._courier


_ENABLED = DriverState.ENABLED  # Python 3.11 takes 0.1 us to look a member up, each time

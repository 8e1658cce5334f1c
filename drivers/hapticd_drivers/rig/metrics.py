"""The numbers that every rig's driver keeps of its link, and their places in `Driver.metrics`."""

from __future__ import annotations

from hapticd.device import Metric

METRICS = (
    Metric("echo_us", "from sending the newest command that was echoed to reading the echo [us]"),
    Metric("longest_echo_us", "the longest of these since the device was opened [us]"),
    Metric("round_trip_us", "a question that is answered at once, median when the device was opened [us]"),
    Metric("ticks_without_state", "ticks for which no new state came in time"),
    Metric("lost_frames", "frames of the device that are missing in its count", warns=True),
    Metric("damaged_frames", "what came and was no frame, or had a wrong checksum", warns=True),
    Metric("late_frames", "frames of the device that came after a newer one", warns=True),
    Metric("repeated_frames", "frames of the device that came twice", warns=True),
    Metric("unknown_frames", "intact frames of no known version, type or length, and refusals", warns=True),
    Metric("unsent_commands", "commands that were dropped since the link took no more", warns=True),
    Metric("commands_lost", "commands that the device is missing in this computer's count", warns=True),
    Metric("commands_damaged", "what reached the device and was no frame, or had a wrong checksum", warns=True),
    Metric("commands_stale", "commands that reached the device twice, or after a newer one", warns=True),
)

(
    ECHO_US,
    LONGEST_ECHO_US,
    ROUND_TRIP_US,
    TICKS_WITHOUT_STATE,
    LOST,
    DAMAGED,
    LATE,
    REPEATED,
    UNKNOWN,
    UNSENT,
    COMMANDS_LOST,
    COMMANDS_DAMAGED,
    COMMANDS_STALE,
) = range(len(METRICS))

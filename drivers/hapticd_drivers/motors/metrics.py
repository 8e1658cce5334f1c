"""The numbers that the drivers of motor controllers keep, and their places in `Driver.metrics`."""

from __future__ import annotations

from hapticd.device import Metric

METRICS = (
    Metric("answer_us", "from sending the newest command to having read the last motor's state after it [us]"),
    Metric("longest_answer_us", "the longest of these since the device was opened [us]"),
    Metric("ticks_without_state", "ticks for which not every motor's state came in time"),
    Metric("damaged_frames", "what came from the adapter and was no frame", warns=True),
    Metric("unknown_frames", "frames that no motor of this configuration sends, or that make no sense", warns=True),
    Metric("unsent_commands", "commands that were dropped since the adapter took no more", warns=True),
    Metric("hottest_c", "temperature of the hottest controller [C]"),
    Metric("lowest_v", "supply of the controller that has least of it [V]"),
)

(
    ANSWER_US,
    LONGEST_ANSWER_US,
    TICKS_WITHOUT_STATE,
    DAMAGED,
    UNKNOWN,
    UNSENT,
    HOTTEST_C,
    LOWEST_V,
) = range(len(METRICS))

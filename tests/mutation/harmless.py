"""Slips that change nothing, and why."""

from __future__ import annotations

EQUAL: dict[str, tuple[str, ...]] = {
    "at the very bound both give the same number": (
        "hapticd/tick/guard.py: blended: if weight >= 2.0 or -reach_n <= force_n <= reach_n:  [LtE 0 is Lt]",
        "hapticd/shapes/distance.py: cylinder_distance: if h <= 0.0:  [LtE 0 is Lt]",
        "controllers/hapticd_controllers/energy_cycle.py: _end_cycle: if change < 0.0 and params.rule == "
        "RULE_NON_DECREASING:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/energy_cycle.py: _count_energy: if x_m < state.lowest_m:  [Lt 0 is LtE]",
        "hapticd/tick/guard.py: blended: if weight >= 2.0 or -reach_n <= force_n <= reach_n:  [LtE 1 is Lt]",
        "hapticd/tick/guard.py: let_out: return gain if gain * ramp_s >= dt_s * (1.0 - 1e-06) else 0.0  [GtE 0 is Gt]",
        "hapticd/tick/guard.py: Guard.reduce: if newton > max_axis_n or newton < -max_axis_n:  [Gt 0 is GtE]",
        "hapticd/tick/guard.py: Guard.reduce: if newton > max_axis_n or newton < -max_axis_n:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/input_to_state.py: step: if contact_m < 0.0:  [Lt 0 is LtE]",
        "hapticd/tick/scene.py: Wall.stored_j: if x_m >= 0.0:  [GtE 0 is Gt]",
        "controllers/hapticd_controllers/virtual_coupling.py: step: if proxy_m < 0.0:  [Lt 0 is LtE]",
        "hapticd/tick/guard.py: blended: if weight >= 1.0:  [GtE 0 is Gt]",
        "hapticd/tick/contact.py: Contact.settle: self._applied_spring_n = gain * (spring_n if spring_n <= limit_n "
        "else limit_n)  [LtE 0 is Lt]",
        "hapticd/tick/guard.py: blended: weight: float = done / state.blend_ticks if done > 0.0 else 0.0  "
        "[Gt 0 is GtE]",
        "controllers/hapticd_controllers/tdpa.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/tdpa.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 1 is LtE]",
        "controllers/hapticd_controllers/energy_cycle.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/energy_cycle.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 1 is LtE]",
        "controllers/hapticd_controllers/felt_mass.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/felt_mass.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 1 is LtE]",
        "controllers/hapticd_controllers/late_cycle.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/late_cycle.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 1 is LtE]",
        "controllers/hapticd_controllers/ring_damping.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/ring_damping.py: _bounded: if -LIMIT < value < LIMIT:  [Lt 1 is LtE]",
        "controllers/hapticd_controllers/tdpa.py: step: if not params.carry_debt and state.energy_j < "
        "state.reference_j:  [Lt 0 is LtE]",
        "controllers/hapticd_controllers/tdpa.py: step: if params.damping_cap_n_s_per_m > 0.0 and damping > "
        "params.damping_cap_n_s_per_m:  [Gt 0 is GtE]",
        "controllers/hapticd_controllers/set_position.py: step: if budget_j >= asked_j:  [GtE 0 is Gt]",
        "controllers/hapticd_controllers/tdpa.py: step: if params.reset == RESET_CONTACT and state.energy_j > 0.0:  "
        "[Gt 0 is GtE]",
        "hapticd/tick/velocity.py: AdaptiveWindow.update: if not lowest <= slope <= highest:  [LtE 0 is Lt]",
        "hapticd/tick/velocity.py: AdaptiveWindow.update: if not lowest <= slope <= highest:  [LtE 1 is Lt]",
    ),
    "where things lie in the shared memory both sides read from the same number": (
        "hapticd/loop/memory.py: : _REQUEST = 8192  [8192 is 8193]",
    ),
    "numbers that no shape of that kind reads": (
        "hapticd/shapes/solid.py: Placed.fields: a = b = c = 0.0  [0.0 is 1.0]",
    ),
    "a thousand or two connections wait, as ZeroMQ's own pipes have it": (
        "hapticd/keys/connections.py: : _UNREAD = 1000  [1000 is 1001]",
    ),
    "a longer frame is no intact message either, and less than a microsecond is none": (
        "drivers/hapticd_drivers/rig/frames.py: _decoded: if len(frame) > LONGEST_FRAME:  [without return None]",
        "drivers/hapticd_drivers/rig/conversation.py: Conversation.await_state: if left_ns <= 0:  [0 is 1]",
    ),
    "how far the old one is from the new one is the same either way round": (
        "hapticd/tick/guard.py: Guard._aim: self._axis_rate = _rate(self.max_axis_n, goal_axis_n, ramp_s)  "
        "[self.max_axis_n one later]",
    ),
    "what counts rises is reset by the first fall, and none counts before it": (
        "hapticd/tick/energy.py: EnergyLedger.__init__: self.window_rises = 0  [0 is 1]",
    ),
    "the bound lies half a sample off what any clock comes to": (
        "hapticd/tick/motion.py: Motion.frozen: return self.repeated >= LEAST_REPEATS and self.repeated_s >= "
        "self._frozen_s  [GtE 0 is Gt]",
    ),
    "no clock and no sum of measured places comes to it exactly": (
        "hapticd/loop/loop.py: ControlLoop._run: if behind >= BURST_TICKS and now_ns >= self._burst_due_ns:  [GtE 0 is Gt]",
        "hapticd/loop/loop.py: ControlLoop._run: over = now_ns - woke_ns > budget_ns  [Gt 0 is GtE]",
        "drivers/hapticd_drivers/rig/conversation.py: Conversation.await_state: if left_ns <= 0:  [LtE 0 is Lt]",
        "drivers/hapticd_drivers/rig/motion.py: _go: if now.time_s - start.time_s > longest_s:  [Gt 0 is GtE]",
        "drivers/hapticd_drivers/rig/motion.py: _nudge: if abs(now.position_m - start.position_m) >= enough_m:  "
        "[GtE 0 is Gt]",
        "drivers/hapticd_drivers/rig/motion.py: _go: if gone_m > best_m + 2.0 * drive.count_m:  [Gt 0 is GtE]",
        "drivers/hapticd_drivers/rig/motion.py: _settled: if abs(now.position_m - since.position_m) > still_m:  "
        "[Gt 0 is GtE]",
        "hapticd/supervisor/recovery.py: HotplugWatch.news: if now_s < self._due_s:  [Lt 0 is LtE]",
        "hapticd/supervisor/recovery.py: Recovery.begin: if now_s - self._found_s > STEADY_S:  [Gt 0 is GtE]",
        "drivers/hapticd_drivers/rig/motion.py: find_stop: if abs(end.position_m - first.position_m) > max(AGREE_M, "
        "AGREE_COUNTS * drive.count_m):  [Gt 0 is GtE]",
    ),
    "all times of a history may move together": (
        "hapticd/tick/velocity.py: push: if last_s > 10.0:  [Gt 0 is GtE]",
        "hapticd/tick/velocity.py: _History.start: self.time_s[0] = 0.0  [0.0 is 1.0]",
    ),
    "the act of the same tick has read it and reset it": (
        "hapticd/tick/space/solid_contact.py: SolidContact._face: def _face  [without self.turned = False]",
    ),
    "it is said anew before a law is asked": (
        "hapticd/tick/space/channel.py: Channel.see: tick.moved_m = self._moved_m = self.way_m = moved_m  "
        "[without self._moved_m]",
        "hapticd/tick/space/channel.py: Channel.rest: def rest  [without self.in_contact = False]",
    ),
    "it is placed once more, where it has just been placed": (
        "hapticd/tick/space/solid_contact.py: SolidContact._stand: def _stand  [without self._away = False]",
    ),
    "whatever is large enough to be no number of a contact will do": (
        "controllers/hapticd_controllers/energy_bounding.py: : LIMIT = 1000000000000.0  [1000000000000.0 is "
        "2000000000000.0]",
        "controllers/hapticd_controllers/virtual_coupling.py: : LIMIT = 1000000000000.0  [1000000000000.0 is "
        "2000000000000.0]",
        "controllers/hapticd_controllers/set_position.py: : LIMIT = 1000000000000.0  [1000000000000.0 is "
        "2000000000000.0]",
    ),
    "only what is larger than any bound comes so far": (
        "controllers/hapticd_controllers/energy_cycle.py: _bounded: return LIMIT if value > 0.0 else -LIMIT  [Gt 0 is GtE]",
        "controllers/hapticd_controllers/tdpa.py: _bounded: return LIMIT if value > 0.0 else -LIMIT  [0.0 is 1.0]",
        "controllers/hapticd_controllers/tdpa.py: _bounded: return LIMIT if value > 0.0 else -LIMIT  [Gt 0 is GtE]",
    ),
    "whatever is small enough to be no length and no motion will do": (
        "controllers/hapticd_controllers/energy_cycle.py: : TINY_MOTION = 1e-24  [1e-24 is 2e-24]",
        "hapticd/tick/space/channel.py: slip_along: if -LEAST_M < x_m < LEAST_M:  [Lt 1 is LtE]",
        "hapticd/tick/space/channel.py: : LEAST_M = 1e-15  [1e-15 is 2e-15]",
    ),
    "it is set before it is read": (
        "hapticd/tick/space/channel.py: Channel.__init__: def __init__  [without self.dz = 1.0]",
        "hapticd/tick/contact.py: Contact.__init__: def __init__  [without self.x_m = 0.0]",
        "hapticd/tick/space/solid_contact.py: SolidContact.__init__: self.quiet = True  [True is False]",
        "hapticd/supervisor/recovery.py: Recovery.__init__: self.lost_s = 0.0  [0.0 is 1.0]",
        "hapticd/tick/guard.py: Guard.__init__: def __init__  [without self._ramp_s = safety.ramp_s]",
        "hapticd/tick/tick.py: ControlTick.__init__: def __init__  [without self._excused = False]",
        "hapticd/tick/energy.py: EnergyLedger.__init__: self.window_minimum_j = 0.0  [0.0 is 1.0]",
        "hapticd/tick/energy.py: EnergyLedger.__init__: def __init__  [without self.window_minimum_j = 0.0]",
        "hapticd/supervisor/recovery.py: Recovery.__init__: def __init__  [without self.lost_s = 0.0]",
        "hapticd/supervisor/recovery.py: Recovery.__init__: def __init__  [without self._arrivals = HotplugWatch()]",
        "hapticd/tick/contact.py: Contact.__init__: self.force_n = 0.0  [0.0 is 1.0]",
        "hapticd/tick/velocity.py: _History.__init__: self.position_m = [0.0] * self.size  [0.0 is 1.0]",
        "hapticd/tick/velocity.py: LowPass.__init__: def __init__  [without self._weight = 0.0]",
    ),
}
"""Each as `str` of a `Slip` says it."""

HARMLESS = frozenset(slip for slips in EQUAL.values() for slip in slips)

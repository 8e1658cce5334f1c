// As on an oscilloscope: wait for something to happen, then hold what was before it and what came after.

import { clock } from "./clock.js";

export const KINDS = [["off", "Live"], ["contact", "Contact"], ["cycle", "Cycle"], ["fault", "Fault"], ["late", "Late tick"]];

export class Trigger {
  constructor() {
    this.kind = "off";
    this.thresholdUs = 500;
    this.rest();
  }

  /** Wait for the next one; what happened up to `now` does not count. */
  arm(kind, now) {
    this.kind = kind;
    this.state = kind === "off" ? "off" : "waiting"; // then "filling", then "held"
    this.after = Number.isFinite(now) ? now : -Infinity;
    this.at = NaN;
    this.seq = NaN;
  }

  rest() {
    this.arm("off", NaN);
  }

  /** Look through new ticks. */
  lookAtTicks(ring, from) {
    if (this.state !== "waiting" || (this.kind !== "contact" && this.kind !== "late")) return;
    for (let row = Math.max(from, ring.begin + 1); row < ring.end; row++) {
      const happens = this.kind === "late"
        ? ring.value("late", row) >= this.thresholdUs
        : ring.value("contacts", row) > 0 && ring.value("contacts", row - 1) === 0;
      if (happens && this.#fire(ring.time(row), ring.seq[row % ring.capacity])) return;
    }
  }

  /** Look through new cycles and events. */
  lookAtNotes({ cycles, events }) {
    if (this.state !== "waiting") return;
    const found = this.kind === "cycle" ? cycles
      : this.kind === "fault" ? events.filter(({ code }) => code >= 200 && code < 300) : [];
    found.some(({ timestamp, seq }) => this.#fire(timestamp, seq));
  }

  /** Whether all that comes after has come, once. */
  isFilled(now, span) {
    if (this.state !== "filling" || now < this.at + span / 2) return false;
    this.state = "held";
    return true;
  }

  describe() {
    const name = KINDS.find(([kind]) => kind === this.kind)[1];
    if (this.state === "off") return "";
    if (this.state === "waiting") return `Waiting for: ${name.toLowerCase()}`;
    return `${name} at ${clock(this.at, true)}, tick ${this.seq}${this.state === "filling" ? ": recording what follows" : ""}`;
  }

  #fire(at, seq) {
    if (!(at > this.after)) return false;
    this.at = at;
    this.seq = seq;
    this.state = "filling";
    return true;
  }
}

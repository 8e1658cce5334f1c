// What the page knows: ticks, gaps in them, cycles, events, the daemon's status.

import { frames } from "./frames.js";
import { Ring } from "./ring.js";

const SPARE = 1.05; // of the ring: a daemon may run a little fast
const MOST_NOTES = 10000;
export const LATE_US = 160; // hapticd's own threshold

export class Store {
  constructor() {
    this.keepS = 60;
    this.status = null;
    this.ring = new Ring(1, this.keepS * 1000 * SPARE);
    this.restart();
  }

  /** Forget all: the server is going to send the last minute again. */
  restart() {
    this.ring = new Ring(this.ring.axes, this.ring.capacity);
    this.gaps = []; // { t, missing }
    this.cycles = [];
    this.events = [];
    this.lastSeq = this.lastStep = null;
  }

  /** There is room for every tick, also where few are published now: those before were perhaps all published. */
  setStatus(status) {
    this.status = status;
    const capacity = Math.ceil(this.keepS * (status.rate_hz || 1000) * SPARE);
    if (capacity !== this.ring.capacity) this.ring = this.ring.resized(capacity);
  }

  /** Ticks of a message; returns the first new row. */
  addTicks(buffer) {
    const first = this.ring.end;
    for (const frame of frames(buffer)) {
      if (frame.axes !== this.ring.axes) {
        this.ring = new Ring(frame.axes, this.ring.capacity);
        this.lastSeq = this.lastStep = null;
      }
      this.#addFrame(frame);
    }
    const oldest = this.ring.latest - this.keepS;
    while (this.gaps.length && this.gaps[0].t < oldest) this.gaps.shift();
    return Math.min(first, this.ring.end);
  }

  addNotes(notes) {
    for (const kind of ["cycles", "events"]) {
      this[kind].push(...notes[kind]);
      if (this[kind].length > MOST_NOTES) this[kind].splice(0, this[kind].length - MOST_NOTES);
    }
  }

  /** Share of the last minute's ticks that began late, and how many did not arrive. */
  punctuality() {
    const late = this.ring.columns.late;
    let count = 0, behind = 0;
    for (let row = this.ring.rowAt(this.ring.latest - this.keepS); row < this.ring.end; row++) {
      const us = late[row % this.ring.capacity];
      if (us >= 0) count++;
      if (us >= LATE_US) behind++;
    }
    return { share: count ? behind / count : NaN, lost: this.gaps.reduce((sum, gap) => sum + gap.missing, 0) };
  }

  #addFrame(frame) {
    const values = new Array(frame.columns.length);
    for (let i = 0; i < frame.count; i++) {
      const t = frame.t0 + frame.t[i], seq = frame.seq0 + frame.seq[i];
      const missing = this.#missing(seq, frame.step);
      if (missing) this.gaps.push({ t, missing });
      // A row of nothing parts the curves; a daemon that was started anew counts from 0 and lost nothing.
      if (missing || (this.lastSeq !== null && seq <= this.lastSeq)) this.ring.push(t, seq, null);
      this.lastSeq = seq;
      this.lastStep = frame.step;
      for (let c = 0; c < values.length; c++) values[c] = frame.columns[c][i];
      this.ring.push(t, seq, values);
    }
  }

  /** Ticks lost before this one. Between two steps that is not known: a reload changed the step somewhere in between. */
  #missing(seq, step) {
    if (this.lastSeq === null || step !== this.lastStep) return 0;
    return Math.max(0, Math.round((seq - this.lastSeq) / step) - 1);
  }
}

// Which ticks are in the picture: the latest, or a stretch that is held.

export class View {
  /** @param onZoom called when another part is to be drawn */
  constructor(store, span, onZoom) {
    this.store = store;
    this.onZoom = onZoom;
    this.span = span; // seconds across
    this.held = null; // { ring, t0, t1, origin }
    this.zoomed = null; // [x0, x1] within what is held
    this.isTriggered = false;
  }

  get ring() {
    return this.held?.ring ?? this.store.ring;
  }

  /** From when to when, and which time is called 0. */
  range() {
    if (!this.held) {
      const latest = this.store.ring.latest;
      return { t0: latest - this.span, t1: latest, origin: latest };
    }
    const { t0, t1, origin } = this.held;
    return this.zoomed ? { t0: origin + this.zoomed[0], t1: origin + this.zoomed[1], origin } : { t0, t1, origin };
  }

  /** Hold the picture as it is. */
  pause() {
    const { t0, t1, origin } = this.range();
    this.held = { ring: this.store.ring.slice(t0, Infinity), t0, t1, origin };
    this.zoomed = null;
    this.isTriggered = false;
  }

  /** Hold the ticks around a moment, half of the span before it and half after. */
  holdAround(moment) {
    const t0 = moment - this.span / 2, t1 = moment + this.span / 2;
    this.held = { ring: this.store.ring.slice(t0, t1), t0, t1, origin: moment };
    this.zoomed = null;
    this.isTriggered = true;
  }

  release() {
    this.held = null;
    this.zoomed = null;
    this.isTriggered = false;
  }

  /** Look closer at a part of what is held, in seconds from its 0; null for all of it. */
  zoom(x0, x1) {
    if (!this.held) return;
    this.zoomed = x0 === null ? null : [x0, x1];
    this.onZoom();
  }
}

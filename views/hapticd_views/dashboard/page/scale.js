// The range of a chart's values: round, at once wide enough, and slow to become narrow, so that nothing jumps about.

const NARROW_BELOW = 0.4; // of the range in use
const NARROW_AFTER_MS = 1500;
const STEPS = [1, 1.5, 2, 3, 4, 5, 6, 8, 10];

export class CalmRange {
  /** @param least span that the range always has */
  constructor(least) {
    this.least = least;
    this.range = null;
    this.narrowSince = null;
  }

  /** The range for values from `low` to `high`, at time `now` in milliseconds. */
  fit(low, high, now) {
    if (!(low <= high)) return this.range ?? [-this.least / 2, this.least / 2];
    const wanted = rounded(low, high, this.least);
    const held = this.range;
    const inside = held && low >= held[0] && high <= held[1];
    const narrow = inside && wanted[1] - wanted[0] < NARROW_BELOW * (held[1] - held[0]);
    if (!narrow) this.narrowSince = null;
    if (inside && !narrow) return held;
    if (narrow) {
      this.narrowSince ??= now;
      if (now - this.narrowSince < NARROW_AFTER_MS) return held;
      this.narrowSince = null;
    }
    this.range = wanted;
    return wanted;
  }
}

/** Bounds a little outside of the values, at multiples of a round step. */
function rounded(low, high, least) {
  const span = Math.max((high - low) * 1.12, least);
  const power = 10 ** Math.floor(Math.log10(span));
  const round = STEPS.find((step) => step * power >= span) * power;
  const step = round / 10;
  const middle = (low + high) / 2;
  let bottom = Math.floor((middle - round / 2) / step) * step, top = bottom + round + step;
  if (low >= 0 && bottom < 0) { bottom = -0.06 * (top - bottom); }
  if (high <= 0 && top > 0) { top = 0.06 * (top - bottom); }
  return [Math.min(bottom, low), Math.max(top, high)];
}

/** A number of an axis, without the dust that sums of steps leave, and with a real minus. */
export function plain(value) {
  return String(Number(value.toPrecision(6))).replace("-", "−");
}

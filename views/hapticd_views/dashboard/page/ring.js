// The last minute of ticks, at full rate: a ring of typed columns that grows to what the daemon's rate takes.

const PER_AXIS = ["x", "f", "r"]; // position, force applied, force requested
const SHARED = ["energy", "generated", "dissipated", "damping", "contacts", "late", "busy"];

export function columnNames(axes) {
  const names = [];
  for (const kind of PER_AXIS) for (let axis = 0; axis < axes; axis++) names.push(kind + axis);
  return names.concat(SHARED);
}

export class Ring {
  constructor(axes, capacity) {
    this.axes = axes;
    this.capacity = Math.max(2, Math.ceil(capacity));
    this.names = columnNames(axes);
    this.t = new Float64Array(this.capacity);
    this.seq = new Float64Array(this.capacity);
    this.columns = Object.fromEntries(this.names.map((name) => [name, new Float32Array(this.capacity)]));
    this.end = 0; // rows ever put in; row i lies at i % capacity
  }

  get begin() {
    return Math.max(0, this.end - this.capacity);
  }

  get latest() {
    return this.end ? this.t[(this.end - 1) % this.capacity] : NaN;
  }

  time(row) {
    return this.t[row % this.capacity];
  }

  value(name, row) {
    return this.columns[name][row % this.capacity];
  }

  /** One row; `values` in the order of `names`. */
  push(t, seq, values) {
    const at = this.end++ % this.capacity;
    this.t[at] = t;
    this.seq[at] = seq;
    this.names.forEach((name, index) => { this.columns[name][at] = values ? values[index] : NaN; });
  }

  /** The first row at this time or after it. */
  rowAt(t) {
    let low = this.begin, high = this.end;
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.time(middle) < t) low = middle + 1; else high = middle;
    }
    return low;
  }

  /** The rows of a stretch of time and one on either side, as a ring of their own. */
  slice(t0, t1) {
    const from = Math.max(this.begin, this.rowAt(t0) - 1), to = Math.min(this.end, this.rowAt(t1) + 1);
    return this.copy(from, to, to - from);
  }

  /** The same rows in a ring of another size. */
  resized(capacity) {
    return this.copy(Math.max(this.begin, this.end - Math.ceil(capacity)), this.end, capacity);
  }

  copy(from, to, capacity) {
    const copy = new Ring(this.axes, capacity);
    for (let row = from; row < to; row++) {
      const at = row % this.capacity, put = copy.end++;
      copy.t[put] = this.t[at];
      copy.seq[put] = this.seq[at];
      for (const name of this.names) copy.columns[name][put] = this.columns[name][at];
    }
    return copy;
  }
}

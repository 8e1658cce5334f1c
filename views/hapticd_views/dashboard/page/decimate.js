// As many points as there are pixels, none of them an average: of each bin its least and its greatest value.

/**
 * Points of some columns between two times.
 *
 * Where there are more than two ticks a pixel, ticks are taken together in bins of a power of two, which begin at
 * multiples of their size, so that a bin holds the same ticks at every frame: a spike of one tick is in every picture.
 *
 * @param ring the ticks
 * @param t0 from, seconds
 * @param t1 to, seconds
 * @param names columns wanted
 * @param pixels width of the plot
 * @returns { t, columns }: plain arrays; null where nothing is known
 */
export function decimated(ring, t0, t1, names, pixels) {
  const from = Math.max(ring.begin, ring.rowAt(t0) - 1), to = Math.min(ring.end, ring.rowAt(t1) + 1);
  const size = 2 ** Math.max(0, Math.ceil(Math.log2((to - from) / Math.max(1, pixels))));
  return size <= 2 ? whole(ring, from, to, names) : binned(ring, from, to, names, size);
}

function whole(ring, from, to, names) {
  const t = new Array(to - from);
  const columns = Object.fromEntries(names.map((name) => [name, new Array(to - from)]));
  for (let row = from; row < to; row++) t[row - from] = ring.time(row);
  for (const name of names) {
    const source = ring.columns[name], target = columns[name];
    for (let row = from; row < to; row++) {
      const value = source[row % ring.capacity];
      target[row - from] = Number.isNaN(value) ? null : value;
    }
  }
  return { t, columns };
}

function binned(ring, from, to, names, size) {
  const bins = [];
  for (let start = Math.floor(from / size) * size; start < to; start += size) {
    bins.push([Math.max(start, from), Math.min(start + size, to)]);
  }
  const t = [];
  for (const [begin, end] of bins) t.push(ring.time(begin), ring.time(Math.floor((begin + end) / 2)));
  const columns = {};
  for (const name of names) {
    const source = ring.columns[name], target = [];
    for (const [begin, end] of bins) {
      let least = Infinity, most = -Infinity, rises = true; // whether the least comes before the greatest
      for (let row = begin, at = begin % ring.capacity; row < end; row++) {
        const value = source[at];
        if (value < least) { least = value; rises = false; }
        if (value > most) { most = value; rises = true; }
        if (++at === ring.capacity) at = 0;
      }
      if (least > most) target.push(null, null);
      else if (rises) target.push(least, most);
      else target.push(most, least);
    }
    columns[name] = target;
  }
  return { t, columns };
}

// Ticks as the server packs them: a header, then columns of 32-bit floats; frames follow each other in a message.

import { columnNames } from "./ring.js";

const HEADER_BYTES = 32;

/** Every frame of a message: { axes, count, t0, seq0, step, t, seq, columns }; columns in the order of `columnNames`. */
export function* frames(buffer) {
  const view = new DataView(buffer);
  let at = 0;
  while (at < buffer.byteLength) {
    const count = view.getUint32(at, true), axes = view.getUint32(at + 4, true);
    const t0 = view.getFloat64(at + 8, true), seq0 = view.getFloat64(at + 16, true);
    const step = view.getFloat64(at + 24, true); // of `seq`, where no tick is lost
    at += HEADER_BYTES;
    const column = () => {
      const values = new Float32Array(buffer, at, count);
      at += 4 * count;
      return values;
    };
    const t = column(), seq = column();
    yield { axes, count, t0, seq0, step, t, seq, columns: columnNames(axes).map(column) };
  }
}

// Swing the target of the coupling "tool" by 5 mm at 1 Hz on the first axis, and say twice a second what came of it.
// Once: npm ci     Then: node drive.mjs [RUNTIME_DIRECTORY]
import { decode, encode } from "@msgpack/msgpack";
import { Dealer, Subscriber } from "zeromq";

const directory = process.argv[2] ?? "/run/hapticd/default";
const scene = new Dealer({ conflate: true }); // of what waits, the latest counts
const state = new Subscriber({ conflate: true });
scene.connect(`ipc://${directory}/scene`);
state.connect(`ipc://${directory}/state`);
state.subscribe();

(async () => {
  for await (const [refusal] of scene) console.log("refused:", decode(refusal).text);
})();

let seq = 0;
for await (const [newest] of state) {
  const now = decode(newest);
  const turn = 2 * Math.PI * now.timestamp;
  const [first, ...others] = [0.005 * Math.sin(turn), ...now.position_m.slice(1).fill(0)];
  const message = {
    name: "tool",
    seq: ++seq,
    sent_ns: process.hrtime.bigint(),
    state_seq: now.seq,
    position_m: [first, ...others],
    velocity_m_per_s: [0.005 * 2 * Math.PI * Math.cos(turn), ...others],
  };
  await scene.send(encode(message, { useBigInt64: true }));
  const tool = now.ports.tool;
  if (seq % 100 === 0 && tool) {
    console.log("tick", now.seq, "message", tool.seq, "in force, of", `${seq},`, "force", tool.force_n[0]);
  }
}

// Print the position twice a second, every cycle and every event.
// Once: npm ci     Then: node subscribe.mjs [ENDPOINT]
import { decode } from "@msgpack/msgpack";
import { Subscriber } from "zeromq";

const socket = new Subscriber();
socket.connect(process.argv[2] ?? "ipc:///run/hapticd/default/telemetry");
socket.subscribe("hapticd/position", "hapticd/cycle", "hapticd/event");

let last = null;
for await (const [topic, payload] of socket) {
  for (const tick of decode(payload)) {
    if (topic.toString() === "hapticd/position") {
      if (last !== null && tick.seq > last + 1) console.log("lost", tick.seq - last - 1, "ticks");
      last = tick.seq;
      if (tick.seq % 500 === 0) {
        console.log("tick", tick.seq, "position", String(tick.position_m), "force", String(tick.force_n));
      }
    } else if (topic.toString() === "hapticd/cycle") {
      console.log("cycle", tick.cycle, "generated", tick.generated_j);
    } else {
      console.log("event", tick.code, tick.text);
    }
  }
}

// The last events, newest first, below what stands and should be known.

import { clock } from "./clock.js";

const MOST = 100;

export class EventList {
  constructor(list) {
    this.list = list;
  }

  draw(events, status) {
    const standing = (status?.warnings ?? []).map((text) => item("now", text, "standing"));
    const latest = events.slice(-MOST).reverse().map(({ timestamp, code, text }) => item(
      clock(timestamp), text, code >= 200 && code < 300 ? "fault" : ""));
    this.list.replaceChildren(...standing, ...latest);
  }
}

function item(when, text, kind) {
  const line = document.createElement("li"), time = document.createElement("time"), said = document.createElement("span");
  time.textContent = when;
  said.textContent = text;
  said.className = kind;
  line.append(time, said);
  return line;
}

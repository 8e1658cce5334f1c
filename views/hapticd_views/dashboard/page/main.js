// Brings the parts together: what comes from the server, what is pressed, what is drawn.

import { Charts } from "./charts.js";
import { Choice } from "./choice.js";
import { Connection } from "./connection.js";
import { CyclePlot } from "./cycles.js";
import { EventList } from "./events.js";
import { Settings } from "./settings.js";
import { Store } from "./store.js";
import { Strip, banner } from "./strip.js";
import { Theme } from "./theme.js";
import { KINDS, Trigger } from "./trigger.js";
import { View } from "./view.js";

const SPANS = [[0.2, "0.2 s"], [1, "1 s"], [5, "5 s"], [20, "20 s"], [60, "60 s"]];
const get = (id) => document.getElementById(id);

export const store = new Store();
export const view = new View(store, 5, () => { page.stale = true; });
export const trigger = new Trigger();
const page = { link: false, mayCommand: false, trouble: "", stale: true };

const theme = new Theme(get("theme"), () => { charts.redraw(); cycles.draw(); });
export const charts = new Charts(get("charts"), store, theme, view);
const cycles = new CyclePlot(get("cycles"), get("cycle"), store, theme);
const events = new EventList(get("events"));
const strip = new Strip();

const MESSAGES = {
  hello({ keep_s: keepS, may_command: mayCommand }) {
    store.keepS = keepS;
    store.restart();
    Object.assign(page, { link: true, mayCommand });
    for (const button of [get("arm"), get("disarm"), get("clear")]) {
      button.disabled = !mayCommand;
      button.title = mayCommand ? (button.id === "disarm" ? "Esc" : "") : "read only: open the address with the token";
    }
    say();
  },
  status(status) {
    store.setStatus(status);
    settings.follow(status.config_hash, page.mayCommand);
    events.draw(store.events, status);
    say();
  },
  trouble(trouble) {
    page.trouble = trouble;
    say();
  },
  past(notes) {
    addNotes(notes);
  },
  notes(notes) {
    addNotes(notes);
    trigger.lookAtNotes(notes);
  },
};

const connection = new Connection({
  onTicks(buffer) {
    const from = store.addTicks(buffer);
    trigger.lookAtTicks(store.ring, from);
    page.stale = true;
  },
  onMessage(name, value) {
    MESSAGES[name]?.(value);
    page.stale = true;
  },
  onClose(reason) {
    page.link = false;
    page.trouble = reason;
    say();
  },
});
export const settings = new Settings(connection);

function addNotes(notes) {
  store.addNotes(notes);
  if (notes.cycles.length) cycles.draw();
  if (notes.events.length) events.draw(store.events, store.status);
}

function say() {
  strip.say(page.link, page.trouble, store.status);
}

async function press(what) {
  const answer = await connection.ask({ do: what });
  banner(get("answer"), answer.ok ? "" : `${what}: ${answer.text}`);
}

get("arm").addEventListener("click", () => press("arm"));
get("disarm").addEventListener("click", () => press("disarm"));
get("clear").addEventListener("click", () => press("clear"));
get("answer").querySelector("button").addEventListener("click", () => banner(get("answer"), ""));
addEventListener("keydown", ({ key, repeat }) => {
  if (key === "Escape" && !repeat && page.mayCommand) press("disarm");
});

new Choice(get("span"), SPANS, view.span, (span) => {
  view.span = span;
  if (trigger.state === "held") view.holdAround(trigger.at);
  page.stale = true;
});
const kinds = new Choice(get("trigger"), KINDS, "off", (kind) => {
  trigger.arm(kind, store.ring.latest);
  view.release();
  get("threshold").hidden = kind !== "late";
  page.stale = true;
});
get("threshold").querySelector("input").addEventListener("input", ({ target }) => {
  const us = Number(target.value);
  if (us > 0) trigger.thresholdUs = us;
});
get("hold").addEventListener("click", () => {
  if (trigger.state === "held") kinds.buttons.get(trigger.kind).click();
  else if (view.held) view.release();
  else view.pause();
  page.stale = true;
});

/** One picture, when there is something new; the browser asks for it as often as it can show one. */
function picture() {
  requestAnimationFrame(picture);
  if (!page.stale) return;
  page.stale = false;
  if (trigger.isFilled(store.ring.latest, view.span)) view.holdAround(trigger.at);
  const text = trigger.describe() || (view.held ? "Paused; drag to look closer, twice to see all" : "");
  if (get("trigger-state").textContent !== text) get("trigger-state").textContent = text;
  get("trigger-state").className = view.held ? "held" : "";
  get("hold").textContent = trigger.state === "held" ? "Again" : view.held ? "Go on" : "Pause";
  if (store.ring.end) charts.draw();
}

setInterval(() => strip.sayPunctuality(store.punctuality()), 500);
requestAnimationFrame(picture);

// What has to be readable from two metres: state, law, rate, lateness; and the banners below.

import { clock } from "./clock.js";

const FAULTS = {
  200: "The law failed", 201: "The law took too long", 202: "Over-speed", 203: "Impossible sample", 204: "Device lost",
  205: "Device frozen", 206: "Device fault", 207: "Supervisor stalled", 208: "Control process lost", 209: "Loop too late",
};

export class Strip {
  constructor() {
    this.get = (id) => document.getElementById(id);
  }

  /** State of it all: connection, daemon, device. */
  say(link, trouble, status) {
    const [word, kind] = state(link, trouble, status);
    document.body.dataset.state = kind;
    this.get("state").textContent = word;
    document.title = `${word} · hapticd${status ? ` ${status.instance}` : ""}`;
    if (status) {
      const notes = [status.device || status.driver, status.simulated ? "simulated" : "", status.calibrated ? "" : "not calibrated"];
      this.get("device").textContent = notes.filter(Boolean).join(" · ");
      this.get("law").textContent = status.fallback ? `${status.law} (fallback)` : status.law;
      const runs = link && !trouble && status.measured_rate_hz; // what was measured before is no rate now
      this.get("rate").textContent = runs ? status.measured_rate_hz.toFixed(1) : "–";
    }
    const away = link ? trouble : "No connection to the dashboard's server: what is shown is old. Disarm at the device, or run: hapticd disarm";
    banner(this.get("trouble"), away);
    banner(this.get("fault"), status ? faultText(status) : "");
    this.get("clear").hidden = !status?.latched;
  }

  sayPunctuality({ share, lost }) {
    this.get("late").textContent = Number.isNaN(share) ? "–" : percent(100 * share);
    this.get("lost").textContent = String(lost);
  }
}

export function banner(element, text) {
  element.querySelector("p").textContent = text;
  element.hidden = !text;
}

function state(link, trouble, status) {
  if (!link) return ["No link", "warn"];
  if (trouble || !status) return ["No daemon", "warn"];
  if (status.device_lost_timestamp) return ["Device lost", "fault"];
  if (status.latched) return [status.releasing ? "Fault, releasing" : "Fault", "fault"];
  if (status.fallback) return ["Fallback", "warn"];
  if (status.releasing) return ["Releasing", "warn"];
  return status.armed ? ["Armed", "armed"] : ["Disarmed", "idle"];
}

function faultText(status) {
  if (!status.latched && !status.device_lost_timestamp) return "";
  const name = FAULTS[status.fault_code] ?? `Fault ${status.fault_code}`;
  const at = status.fault_timestamp;
  return `${name}${at ? ` at ${clock(at)}` : ""}. ${status.fault_text}`;
}

function percent(value) {
  return value === 0 ? "0" : value < 0.01 ? "<0.01" : value < 10 ? value.toFixed(2) : value.toFixed(0);
}

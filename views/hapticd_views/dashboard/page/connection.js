// The WebSocket to the server, opened again whenever it is gone; requests and their answers.

const PLACE = "hapticd-token";
const FIRST_WAIT_MS = 300, LONGEST_WAIT_MS = 5000;
const SILENT_MS = 5000; // the server tells the time each second

/** The token behind the # of the address: kept for this tab, and taken out of sight. */
function takeToken() {
  const found = new URLSearchParams(location.hash.slice(1)).get("token");
  if (found) {
    sessionStorage.setItem(PLACE, found);
    history.replaceState(null, "", location.pathname);
  }
  return sessionStorage.getItem(PLACE) || "";
}

export class Connection {
  /** @param heard { onTicks(buffer), onMessage(name, value), onClose(reason) } */
  constructor(heard) {
    this.heard = heard;
    this.token = takeToken();
    this.waitMs = FIRST_WAIT_MS;
    this.asked = new Map();
    this.lastId = 0;
    this.open();
    setInterval(() => { if (performance.now() - this.heardMs > SILENT_MS) this.#lose(""); }, 500);
  }

  open() {
    this.heardMs = performance.now();
    this.now = undefined; // of the server
    this.socket = new WebSocket(`ws://${location.host}/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.socket.send(JSON.stringify({ do: "hello", token: this.token }));
    this.socket.onmessage = ({ data }) => this.#take(data);
    this.socket.onclose = ({ code, reason }) => this.#lose(code === 4401 ? reason : "");
  }

  /** Ask for something; the answer, which has `ok` and, when that is false, `text` or `problems`. */
  ask(request) {
    if (this.socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ ok: false, text: "no connection to the dashboard's server" });
    }
    const id = ++this.lastId;
    this.socket.send(JSON.stringify({ ...request, id, now: this.now }));
    return new Promise((resolve) => this.asked.set(id, resolve));
  }

  /** The connection has gone, or the server is silent: one that stands still, or a cut cable, ends none. */
  #lose(reason) {
    this.heardMs = Infinity;
    this.socket.onclose = this.socket.onmessage = null;
    this.socket.close();
    for (const answer of this.asked.values()) answer({ ok: false, text: "the dashboard's server has gone" });
    this.asked.clear();
    this.heard.onClose(reason);
    setTimeout(() => this.open(), this.waitMs);
    this.waitMs = Math.min(LONGEST_WAIT_MS, this.waitMs * 2);
  }

  #take(data) {
    this.heardMs = performance.now();
    if (data instanceof ArrayBuffer) {
      this.heard.onTicks(data);
      return;
    }
    const message = JSON.parse(data);
    if ("answer" in message) {
      this.asked.get(message.answer)?.(message);
      this.asked.delete(message.answer);
      return;
    }
    this.now = message.now ?? this.now;
    if ("hello" in message) this.waitMs = FIRST_WAIT_MS;
    for (const [name, value] of Object.entries(message)) this.heard.onMessage(name, value);
  }
}

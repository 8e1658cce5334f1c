// The WebSocket to the server, opened again whenever it is gone; requests and their answers.

const PLACE = "hapticd-token";
const FIRST_WAIT_MS = 300, LONGEST_WAIT_MS = 5000;

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
  }

  open() {
    this.socket = new WebSocket(`ws://${location.host}/live`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.socket.send(JSON.stringify({ do: "hello", token: this.token }));
    this.socket.onmessage = ({ data }) => this.#take(data);
    this.socket.onclose = ({ code, reason }) => {
      for (const answer of this.asked.values()) answer({ ok: false, text: "the dashboard's server has gone" });
      this.asked.clear();
      this.heard.onClose(code === 4401 ? reason : "");
      setTimeout(() => this.open(), this.waitMs);
      this.waitMs = Math.min(LONGEST_WAIT_MS, this.waitMs * 2);
    };
  }

  /** Ask for something; the answer, which has `ok` and, when that is false, `text` or `problems`. */
  ask(request) {
    if (this.socket.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ ok: false, text: "no connection to the dashboard's server" });
    }
    const id = ++this.lastId;
    this.socket.send(JSON.stringify({ ...request, id }));
    return new Promise((resolve) => this.asked.set(id, resolve));
  }

  #take(data) {
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
    if ("hello" in message) this.waitMs = FIRST_WAIT_MS;
    for (const [name, value] of Object.entries(message)) this.heard.onMessage(name, value);
  }
}

// SPDX-License-Identifier: MIT
// link.js - the WebSocket to heave-panel: requests with answers, events, samples. Comes back by itself when it is lost.
const RETRY_MS = 1000;
const SLOW_MS = 2000;
const ANSWERED = ["request", "configure", "press", "identify"]; // by heaved

export class Link {
  // onSlow: called every two seconds while there is no answer to a message. mayConnect: asked before it comes back; true, false: later, null: never.
  constructor({ onEvent, onBlock, onChange, onSlow, mayConnect }) {
    Object.assign(this, { onEvent, onBlock, onChange, onSlow, mayConnect, isOpen: false, next: 1 });
    this.waiting = new Map();
    this.connect();
  }

  connect() {
    const address = new URL("ws", location); // beside the page, which a proxy may serve below a path
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    this.socket = new WebSocket(address, "heave-panel.1");
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.isOpen = true; this.onChange(true); };
    this.socket.onmessage = (message) => (typeof message.data === "string" ? this.take(JSON.parse(message.data)) : this.takeBlock(message.data));
    this.socket.onclose = () => {
      for (const reject of this.waiting.values()) reject({ error: "connection lost" });
      this.waiting.clear();
      this.isOpen = false;
      this.onChange(false);
      this.retry();
    };
  }

  retry() {
    setTimeout(async () => {
      const may = await this.mayConnect();
      if (may) this.connect();
      else if (may !== null) this.retry();
    }, RETRY_MS);
  }

  take(message) {
    if (message.event) {
      this.onEvent(message);
    } else {
      this.waiting.get(message.id)?.(message);
      this.waiting.delete(message.id);
    }
  }

  // A block: stream, rows, first (8 bytes), lost, 0; then each column's values.
  takeBlock(data) {
    const head = new DataView(data);
    const rows = head.getUint32(4, true);
    const first = Number(head.getBigUint64(8, true));
    const columns = [];
    for (let at = 24; at < data.byteLength; at += 8 * rows) columns.push(new Float64Array(data, at, rows));
    this.onBlock({ stream: head.getUint32(0, true), rows, first, lost: head.getUint32(16, true), columns });
  }

  send(message) {
    if (this.isOpen) this.socket.send(JSON.stringify(message));
  }

  // Resolves to the answer: {answer} of heaved, or {error}.
  ask(message) {
    return new Promise((resolve) => {
      if (!this.isOpen) return resolve({ error: "connection lost" });
      const id = this.next++;
      const timer = ANSWERED.includes(message.op) ? setInterval(() => this.onSlow(message), SLOW_MS) : null;
      this.waiting.set(id, (got) => { clearInterval(timer); resolve(got); });
      this.send({ id, ...message });
    });
  }
}

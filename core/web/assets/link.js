// The connection: requests with their answers, events, and the echo time. Nothing is kept to be sent later: what was asked while
// the connection was lost is refused here, so that a page that comes back starts nothing.

const PROTOCOL = "tandem.2";
const ECHO_EVERY_MS = 2000;

export class Link {
  constructor(token) {
    this.token = token;
    this.listeners = new Map();
    this.waiting = new Map();
    this.lastId = 0;
    this.greeting = null;
    this.wait = 250;
  }

  on(event, listener) {
    const all = this.listeners.get(event) || [];
    this.listeners.set(event, [...all, listener]);
  }

  tell(event, told) {
    for (const listener of this.listeners.get(event) || []) listener(told);
  }

  open() {
    const digits = [...new TextEncoder().encode(this.token)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
    const socket = new WebSocket(`ws://${location.host}/socket`, [PROTOCOL, "token." + digits]);
    this.socket = socket;
    let opened = false;
    socket.onopen = () => { opened = true; this.wait = 250; };
    socket.onmessage = ({ data }) => this.hear(JSON.parse(data));
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.lose();
      if (opened) setTimeout(() => this.open(), this.wait);
      else this.askWhy(digits);
    };
  }

  lose() {
    this.greeting = null;
    for (const { refuse } of this.waiting.values()) refuse(new Error("the connection was lost"));
    this.waiting.clear();
    clearInterval(this.echoes);
    this.tell("away");
  }

  // A browser does not say why a socket was refused.
  async askWhy(digits) {
    try {
      const answer = await fetch("/token", { headers: { Authorization: "Bearer " + digits } });
      if (answer.status === 403) { this.tell("stranger"); return; }
    } catch { /* nobody answers: tried again below */ }
    this.wait = Math.min(this.wait * 1.6, 3000);
    setTimeout(() => this.open(), this.wait);
  }

  hear(told) {
    if (told.tandem) {
      this.greeting = told.tandem;
      this.echoes = setInterval(() => this.echo(), ECHO_EVERY_MS);
      this.tell("greeting", told.tandem);
      this.echo();
      return;
    }
    if (told.event) { this.tell(told.event, told); return; }
    const waiting = this.waiting.get(told.id);
    this.waiting.delete(told.id);
    if (!waiting) return;
    if (told.error) waiting.refuse(Object.assign(new Error(told.error.why), { told: told.error }));
    else waiting.answer(told.ok);
  }

  get isOpen() {
    return this.greeting !== null && this.socket.readyState === WebSocket.OPEN;
  }

  // Asks; the answer is a promise. The number of the request stands in `id` of it, for events that come later.
  ask(request, keys = {}) {
    const id = ++this.lastId;
    const answer = new Promise((resolve, refuse) => {
      if (!this.isOpen) { refuse(new Error("there is no connection to the controller")); return; }
      this.waiting.set(id, { answer: resolve, refuse });
      this.socket.send(JSON.stringify({ id, request, ...keys }));
    });
    answer.id = id;
    return answer;
  }

  async echo() {
    const start = performance.now();
    try {
      await this.ask("status");
      this.tell("echo", performance.now() - start);
    } catch { /* the loss of the connection is told elsewhere */ }
  }
}

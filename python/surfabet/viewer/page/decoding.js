// The decoder: in a worker, or where the browser has none for pages from a file, beside the page itself.

export class Decoding {
  /** `source` is that of the decoder; `script` runs a source on the page. */
  constructor(source, script) {
    this.source = source;
    this.script = script;
    this.waiting = new Map();
    this.last = 0;
    try {
      const whole = `${source}\nsurfabetWorker.serve(self);`;
      const url = URL.createObjectURL(new Blob([whole], { type: "text/javascript" }));
      this.worker = new Worker(url);
      this.worker.onmessage = ({ data }) => this.answer(data);
      this.worker.onerror = (event) => {
        event.preventDefault();
        this.goOnWithout();
      };
    } catch {
      this.goOnWithout();
    }
  }

  /** Asks all that is open beside the page. */
  goOnWithout() {
    this.worker = null;
    this.script(this.source);
    for (const { message } of [...this.waiting.values()]) setTimeout(() => this.handle(message));
  }

  async handle(message) {
    this.answer(await surfabetWorker.handle(message));
  }

  answer({ id, result, error, name }) {
    const { resolve, reject } = this.waiting.get(id) ?? {};
    this.waiting.delete(id);
    if (error === undefined) resolve?.(result);
    else reject?.(Object.assign(new Error(error), { name }));
  }

  ask(kind, request = {}) {
    const message = { id: ++this.last, kind, ...request };
    return new Promise((resolve, reject) => {
      this.waiting.set(message.id, { message, resolve, reject });
      if (this.worker) this.worker.postMessage(message);
      // A picture goes first.
      else setTimeout(() => this.handle(message), 20);
    });
  }
}

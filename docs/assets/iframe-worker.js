// Browsers give a page that is opened from disk no workers. The search asks one: here it is the same script in a hidden
// frame. By the file's name the site's builder knows that it need not have such a thing fetched from elsewhere.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(script) {
      super();
      this.frame = Object.assign(document.createElement("iframe"), { hidden: true, srcdoc: "<!doctype html>" });
      this.started = new Promise((done) => (this.frame.onload = done)).then(() => this.start(script));
      document.body.append(this.frame);
    }

    start(script) {
      const inside = this.frame.contentWindow;
      inside.postMessage = (data) => {
        const message = new MessageEvent("message", { data: structuredClone(data) });
        this.dispatchEvent(message);
        this.onmessage?.(message);
      };
      return new Promise((done, fail) => {
        const tag = Object.assign(inside.document.createElement("script"), { src: script, onload: done, onerror: fail });
        inside.document.body.append(tag);
      });
    }

    async postMessage(data) {
      const message = new MessageEvent("message", { data: structuredClone(data) });
      await this.started;
      this.frame.contentWindow.dispatchEvent(message);
    }

    terminate() {
      this.frame.remove();
    }
  };
}

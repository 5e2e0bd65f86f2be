// Browsers give a page that is opened from disk neither workers nor requests. The site's search asks a worker; this one
// answers in the page itself, from the index that the build writes as a script too (tools/docs_hooks.py).
if (location.protocol === "file:") {
  const load = (path) =>
    new Promise((done, fail) => {
      const script = document.createElement("script");
      Object.assign(script, { src: joinUrl(base_url, path), onload: done, onerror: fail });
      document.head.append(script);
    });

  window.Worker = class {
    postMessage(message) {
      if (message.init) this.start();
      else this.onmessage({ data: { results: this.find(message.query) } });
    }

    async start() {
      await load("search/lunr.js");
      await load("search/index.js");
      const { config, docs } = window.searchIndex;
      lunr.tokenizer.separator = new RegExp(config.separator);
      this.pages = new Map(docs.map((page) => [page.location, page]));
      this.index = lunr(function () {
        this.field("title");
        this.field("text");
        this.ref("location");
        docs.forEach((page) => this.add(page));
      });
      this.onmessage({ data: { config } });
      this.onmessage({ data: { allowSearch: true } });
    }

    find(query) {
      const pages = this.index.search(query).map((found) => this.pages.get(found.ref));
      return pages.map((page) => ({ ...page, summary: page.text.substring(0, 200) }));
    }
  };
}

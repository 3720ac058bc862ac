// Runs in the 3D scene's frame before any script of viser's. The frame has an origin of its own that nobody else has,
// so the console's page around it can only be told things, and tell: which event a change belongs to, and which
// changes may be shown (web/src/scene/scene_frame.ts). Without such a page it shows none.
(() => {
  "use strict";
  const waiting = []; // changes that the page has not let through: {id, deliver}, in order
  let lastId = 0;
  const tell = (message) => window.parent.postMessage(message, "*"); // nothing secret, and our origin has no name

  // The scene is one view of many: viser's own notices, and on a small screen its panel, would cover it.
  const style = document.createElement("style");
  style.textContent = `.mantine-Notifications-root, .mantine-Notification-root { display: none !important; }
@media (max-width: 767px) { .mantine-Paper-root { display: none !important; } }`;
  document.head.append(style);

  window.addEventListener(
    "keydown",
    ({ code, repeat }) => tell({ type: "scene_key", code, repeat }),
    { capture: true },
  );

  window.addEventListener("message", ({ source, data }) => {
    if (source !== window.parent || data?.type !== "scene_deliver") return;
    while (waiting.length > 0 && waiting[0].id <= data.id) {
      const { id, deliver } = waiting.shift();
      deliver();
      tell({ type: "scene_shown", id });
    }
  });

  const hold = (messages, deliver) => {
    const id = ++lastId;
    waiting.push({ id, deliver });
    // Only the label that names the event is of interest to the page.
    const labels = Array.isArray(messages) ? messages.filter((each) => each?.name?.endsWith?.("/event")) : [];
    tell({ type: "scene_batch", id, messages: labels });
  };

  const gate = (worker) => {
    let handler = null;
    Object.defineProperty(worker, "onmessage", { get: () => handler, set: (wanted) => (handler = wanted) });
    worker.addEventListener("message", (event) => {
      const deliver = () => handler?.call(worker, event);
      if (event.data?.type === "message_batch") return hold(event.data.messages, deliver);
      if (event.data?.type === "connected") {
        waiting.length = 0;
        tell({ type: "scene_connected", id: lastId });
      }
      deliver();
    });
    return worker;
  };

  // viser fetches parts of itself, code and a picture, from data: URLs, which the page's policy lets nobody do.
  const PART = /^data:(application\/wasm|image\/[a-z+]+);base64,/;
  const fetched = window.fetch;
  window.fetch = async (resource, options) => {
    const url = resource instanceof Request ? resource.url : String(resource);
    const part = PART.exec(url);
    if (part === null) return fetched(resource, options);
    const bytes = Uint8Array.from(atob(decodeURIComponent(url.slice(part[0].length))), (each) => each.charCodeAt(0));
    return new Response(bytes, { headers: { "Content-Type": part[1] } });
  };

  // In an origin that is nobody's, Chromium starts no module worker from a blob: URL that another thread has made. So
  // the worker is a plain one, which makes such a URL itself and imports it; messages wait until it has.
  const STARTER = `const early = [];
self.onmessage = (event) => early.push(event.data);
self.addEventListener("message", ({ data }) => {
  early.length = 0;
  import(URL.createObjectURL(data)).then(() => {
    for (const each of early) self.dispatchEvent(new MessageEvent("message", { data: each }));
  });
}, { once: true });`;
  const blobs = new Map(); // by URL
  const makeUrl = URL.createObjectURL.bind(URL);
  URL.createObjectURL = (object) => {
    const url = makeUrl(object);
    blobs.set(url, object);
    return url;
  };
  const revokeUrl = URL.revokeObjectURL.bind(URL);
  URL.revokeObjectURL = (url) => {
    blobs.delete(url);
    revokeUrl(url);
  };

  const start = (Worker, url, options) => {
    const code = options?.type === "module" ? blobs.get(String(url)) : undefined;
    if (code === undefined) return new Worker(url, options);
    const worker = new Worker(makeUrl(new Blob([STARTER], { type: "text/javascript" })));
    worker.postMessage(code);
    return worker;
  };

  window.Worker = new Proxy(window.Worker, { construct: (target, args) => gate(start(target, ...args)) });
})();

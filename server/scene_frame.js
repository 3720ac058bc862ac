// Runs in the 3D scene's frame before any script of viser's. The frame has an origin of its own that nobody else has,
// so the console's page around it can only be told things, and tell: which event a change belongs to, and which
// changes may be shown (web/src/ui/scene_frame.ts). Without such a page it shows none.
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

  // viser fetches a part of itself from a data: URL, which the page's policy lets nobody do.
  const WASM = "data:application/wasm;base64,";
  const fetched = window.fetch;
  window.fetch = async (resource, options) => {
    if (typeof resource !== "string" || !resource.startsWith(WASM)) return fetched(resource, options);
    const bytes = Uint8Array.from(atob(resource.slice(WASM.length)), (each) => each.charCodeAt(0));
    return new Response(bytes, { headers: { "Content-Type": "application/wasm" } });
  };

  window.Worker = new Proxy(window.Worker, { construct: (target, args) => gate(new target(...args)) });
})();

/** Calls back when the device's network comes back or is another one, where the browser says so; returns how to stop it. */
export function onNetworkChange(changed: () => void): () => void {
  // Network Information API: Chromium's, and not in TypeScript's library. It also tells of mere changes of speed.
  const network: unknown = Reflect.get(navigator, "connection");
  const target = network instanceof EventTarget ? network : null;
  const kind = (): unknown => (target === null ? undefined : Reflect.get(target, "type"));
  let before = kind();
  const looked = (): void => {
    const now = kind();
    if (now !== before) changed();
    before = now;
  };
  window.addEventListener("online", changed);
  target?.addEventListener("change", looked);
  return () => {
    window.removeEventListener("online", changed);
    target?.removeEventListener("change", looked);
  };
}

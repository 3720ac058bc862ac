/** What the page's link says behind the `#`. No server and no log ever sees it. */
export interface PageLink {
  readonly token: string | null;
  readonly trailer: boolean; // `stamp=trailer` forces the trailer carrier
  readonly relayOnly: boolean; // `relay=only`: media and data through TURN or not at all
  readonly name: string | null; // what others see
}

export function readFragment(hash: string): PageLink {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  return {
    token: fields.get("token") || null,
    trailer: fields.get("stamp") === "trailer",
    relayOnly: fields.get("relay") === "only",
    name: fields.get("name") || null,
  };
}

/** What the page's link says behind the `#`. No server and no log ever sees it. */
export interface PageLink {
  readonly token: string | null;
  readonly trailer: boolean; // `stamp=trailer` forces the trailer carrier
  readonly name: string | null; // what others see
}

export function readFragment(hash: string): PageLink {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  return {
    token: fields.get("token") || null,
    trailer: fields.get("stamp") === "trailer",
    name: fields.get("name") || null,
  };
}

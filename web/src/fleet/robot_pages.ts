/** Links from the overview to the pages of its robots. What stands behind the `#` goes along: token, name, carrier. */

/** The robot's page. null: the address is none that a browser should follow. */
export function robotPage(url: string, hash: string, base: string): string | null {
  if (!URL.canParse(url, base)) return null;
  const found = new URL(url, base);
  if (!/^https?:$/.test(found.protocol)) return null;
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  fields.set("from", "fleet");
  found.hash = `#${fields}`;
  return found.href;
}

/** The robot's episodes, in the page of its console. null: as of `robotPage`. */
export function episodesPage(url: string, hash: string, base: string): string | null {
  const page = robotPage(url, hash, base);
  if (page === null) return null;
  const found = new URL(page);
  const token = new URLSearchParams(found.hash.slice(1)).get("token") ?? "";
  const address = new URL("./episodes", found);
  address.hash = `#${new URLSearchParams({ token })}`;
  return address.href;
}

/** Whether this page may ask there: another console's pictures are shown by its own pages. */
export function isOwnOrigin(url: string, base: string): boolean {
  return URL.canParse(url, base) && new URL(url, base).origin === new URL(base).origin;
}

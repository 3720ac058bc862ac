/** What the page's link says behind the `#`. No server and no log ever sees it. */
export interface PageLink {
  readonly token: string | null;
  readonly trailer: boolean; // `stamp=trailer` forces the trailer carrier
  readonly turnOnly: boolean; // `relay=only`: media and data through TURN or not at all
  readonly name: string | null; // what others see
  readonly watches: boolean; // the token is an observer's, as far as can be read here
}

export function readFragment(hash: string): PageLink {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  return {
    token: fields.get("token") || null,
    watches: roleOf(fields.get("token") ?? "") === "observer",
    trailer: fields.get("stamp") === "trailer",
    turnOnly: fields.get("relay") === "only",
    name: fields.get("name") || null,
  };
}

/** What the token says; the console alone decides (RFC 7519 3: the middle part is Base64url of JSON). */
export function roleOf(token: string): unknown {
  const payload = token.split(".")[1]?.replaceAll("-", "+").replaceAll("_", "/") ?? "";
  try {
    const claims: unknown = JSON.parse(atob(payload));
    return typeof claims === "object" && claims !== null && "role" in claims ? claims.role : null;
  } catch {
    return null;
  }
}

/** What the page of one robot knows of its fleet, by its own address. What stands behind the `#` goes along. */

/** The overview that a robot's page was opened from; null when it was not. */
export function overviewPage(hash: string, page: string): string | null {
  const fields = new URLSearchParams(hash.replace(/^#/, ""));
  if (fields.get("from") !== "fleet") return null;
  fields.delete("from");
  const found = new URL("../../", page);
  found.hash = `#${fields}`;
  return found.href;
}

/** What a fleet calls the robot of this page; "" on the page of a console's only robot. */
export function robotName(page: string): string {
  return /\/robots\/([^/]+)\/$/.exec(new URL(page).pathname)?.[1] ?? "";
}

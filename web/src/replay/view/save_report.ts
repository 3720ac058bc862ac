import { h } from "../../ui/elements/dom";

const KEPT_MS = 60_000; // for the browser to write it

/** Lets the browser write a report, a page that needs nothing else, to disk. */
export function saveReport(recording: string, page: ArrayBuffer): void {
  const url = URL.createObjectURL(new Blob([page], { type: "text/html" }));
  h("a", "", { href: url, download: `${recording}-report.html` }).click();
  setTimeout(() => URL.revokeObjectURL(url), KEPT_MS);
}

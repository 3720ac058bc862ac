import type { Disposal } from "./disposal";
import { onNetworkChange } from "../transport/network_change";

/** What happens to the page as a whole. */
export interface PageWatch {
  blurred(): void;
  left(): void; // for good, or into the browser's cache of pages
  visibilityChanged(): void;
  networkChanged(): void;
}

/** Tells of it until `disposal` closes. A page that comes back from the browser's cache is loaded anew. */
export function watchPage(disposal: Disposal, watch: PageWatch): void {
  disposal.listen(window, "blur", () => watch.blurred());
  disposal.listen(window, "pagehide", () => watch.left());
  disposal.listen(window, "pageshow", (event) => {
    if (event.persisted) location.reload();
  });
  disposal.add(onNetworkChange(() => watch.networkChanged()));
  const visibility = (): void => watch.visibilityChanged();
  document.addEventListener("visibilitychange", visibility);
  disposal.add(() => document.removeEventListener("visibilitychange", visibility));
}

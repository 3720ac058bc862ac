const LIMIT_MS = 3000; // a page without style is better than none

/** When the page's style sheets are there, so that nothing of it is seen without them. */
export async function stylesheetsLoaded(): Promise<void> {
  const links = [...document.querySelectorAll<HTMLLinkElement>('link[rel="stylesheet"]')];
  const waiting = links.filter(({ sheet }) => sheet === null);
  const all = waiting.map(
    (link) =>
      new Promise<void>((resolve) => {
        link.addEventListener("load", () => resolve());
        link.addEventListener("error", () => resolve());
      }),
  );
  const limit = new Promise<void>((resolve) => setTimeout(resolve, LIMIT_MS));
  await Promise.race([Promise.all(all), limit]);
}

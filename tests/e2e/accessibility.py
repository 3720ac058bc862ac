"""What axe-core finds on a page."""

from pathlib import Path

from playwright.async_api import Page

__all__ = ["findings"]

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"
# Animations are over before colours are measured; a frame of another origin has a page of its own.
RUN = """async (without) => {
  await Promise.all(document.getAnimations().map((each) => each.effect.getTiming().iterations === Infinity
    ? each.cancel() : each.finished.catch(() => undefined)));
  const { violations, incomplete } = await axe.run(document, {
    iframes: false,
    resultTypes: ["violations", "incomplete"],  // of all else it does not look for each place
    rules: {
      "label-content-name-mismatch": { enabled: true },
      ...Object.fromEntries(without.map((rule) => [rule, { enabled: false }])),
    },
  });
  // A name on what may have none is in doubt, for axe-core, while there are words in it: it counts here all the same.
  const named = incomplete.filter(({ id }) => id === "aria-prohibited-attr");
  return [...violations, ...named].flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) =>
    `${id}: ${target.join(" ")}: ${failureSummary.replaceAll("\\n", " ")}`));
}"""


async def findings(page: Page, *without: str) -> list[str]:
    """Each rule that something on the page breaks now, and what; but for the rules `without`."""
    if not await page.evaluate("'axe' in window"):
        await page.evaluate(AXE.read_text())
    found: list[str] = await page.evaluate(RUN, without)
    return found

"""All that a page says, also what stands for a moment only: a test that looks now and then may never see that."""

from lockstep.bench.browsers.console_page import ConsolePage

__all__ = ["hears", "listen", "said"]

# Ten times a second where something changes: the text of a whole page costs a layout, which at every change of a page
# that drives would hold up the driving.
LISTEN = """() => {
  window.said = new Set();
  let due = null;
  const note = () => {
    due = null;
    document.body.innerText.split("\\n").forEach((line) => window.said.add(line));
  };
  new MutationObserver(() => { due ??= setTimeout(note, 100); }).observe(document.body, {
    attributes: true, characterData: true, childList: true, subtree: true,
  });
  note();
}"""


async def listen(console: ConsolePage) -> None:
    """From now on every line of the page is kept, until it is left."""
    await console.page.evaluate(LISTEN)


async def hears(console: ConsolePage, words: str) -> None:
    """Until the page has said this in a line, since it is listened to."""
    await console.until(f"[...window.said].some((line) => line.includes({words!r}))")


async def said(console: ConsolePage) -> str:
    """All lines since then."""
    lines: str = await console.page.evaluate("[...window.said].join(' | ')")
    return lines

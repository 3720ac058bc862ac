"""The event that a picture of the planar robot shows, read from the page."""

from playwright.async_api import Page

__all__ = ["READ_STRIP", "drawn_event"]

# The true event, read from the strip that the planar robot draws into its pictures (robots/event_strip.py), together
# with the stamp that the page believes it has. It is one expression, so no picture is drawn in between.
READ_STRIP = """(name) => {
  const canvas = document.querySelector(`canvas[data-stream="${name}"]`);
  const rendered = window.lockstep.rendered(name).at(-1);
  if (!canvas || !rendered || canvas.width === 0) return null;
  const rows = Math.floor(canvas.height / 20);
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, rows).data;
  let event = 0, parity = 0, last = 0;
  for (let cell = 0; cell < 32; cell++) {
    const left = Math.floor(cell * canvas.width / 32), right = Math.floor((cell + 1) * canvas.width / 32);
    const quarter = Math.floor((right - left) / 4), edge = Math.floor(rows / 4);
    let sum = 0, count = 0;
    for (let y = edge; y < rows - edge; y++) for (let x = left + quarter; x < right - quarter; x++) {
      const at = 4 * (y * canvas.width + x);
      sum += 0.299 * pixels[at] + 0.587 * pixels[at + 1] + 0.114 * pixels[at + 2];
      count++;
    }
    const mean = sum / count;
    if (mean >= 90 && mean <= 160) return { stamp: rendered.stamp, event: null };
    const bit = mean > 160 ? 1 : 0;
    if (cell < 31) { event = event * 2 + bit; parity ^= bit; } else last = bit;
  }
  return { stamp: rendered.stamp, event: parity === last ? event : null };
}"""


async def drawn_event(page: Page, stream: str) -> tuple[int, int | None] | None:
    """Return the stamp that the page believes its picture has, and the event drawn into it; None before the first."""
    found = await page.evaluate(READ_STRIP, stream)
    return None if found is None else (found["stamp"], found["event"])

"""Tells when Chromium drew a picture into its window, from Chromium's own trace.

A page's drawing reaches the window in a frame: of the page, which the browser makes once per beat of the display, or of
a surface of its own, as a <video> and a desynchronized canvas have. The browser then puts the newest frames of all
together, and swaps the result into the window. The trace names each of these steps (`Graphics.Pipeline`), on the
machine's monotonic clock.
"""

import json
from bisect import bisect_left
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

from playwright.async_api import Browser

__all__ = ["WindowTrace", "read_trace", "traced_window"]

CATEGORIES = ["graphics.pipeline"]
OWN_SURFACE = 1 << 31  # frame sinks from here on are of surfaces that a page made, and not of pages


class Swap(NamedTuple):
    began: float  # s, monotonic; frames that came later are not in it
    ended: float


class WindowTrace:
    """The frames of one spell and the swaps that showed them. All times are in s, of the monotonic clock."""

    def __init__(self, pages: Iterable[float], surface: Iterable[float], swaps: Iterable[Swap]) -> None:
        """`pages`, `surface`: when frames of pages, and of the measured surface of its own, came to the window."""
        self._pages = sorted(pages)
        self._surface = sorted(surface)
        self._swaps = sorted(swaps)

    def shown_by_page(self, composed: float) -> float | None:
        """Return the swap of the page's first frame since `composed`; None: it is not in the trace."""
        return self._shown(self._pages, composed)

    def shown_by_surface(self, drawn: float) -> float | None:
        """Return the swap of the surface's first frame since `drawn`; None: it is not in the trace."""
        return self._shown(self._surface, drawn)

    def _shown(self, frames: list[float], since: float) -> float | None:
        frame = bisect_left(frames, since)
        if frame == len(frames):
            return None
        swap = bisect_left(self._swaps, (frames[frame], 0.0))
        return None if swap == len(self._swaps) else self._swaps[swap].ended


@asynccontextmanager
async def traced_window(browser: Browser) -> AsyncIterator[list[WindowTrace]]:
    """Trace Chromium until leaving, which then fills the list with one trace."""
    found: list[WindowTrace] = []
    await browser.start_tracing(categories=CATEGORIES)
    try:
        yield found
    finally:
        found.append(read_trace(json.loads(await browser.stop_tracing())["traceEvents"]))


def read_trace(events: Iterable[Mapping[str, Any]]) -> WindowTrace:
    """Read trace events as Chromium writes them; their times are in µs.

    The measured surface is that with the most frames: the fastest camera's.
    """
    pages: list[float] = []
    surfaces: dict[int, list[float]] = {}
    began: dict[int, float] = {}
    ended: dict[int, float] = {}
    for event in events:
        step = event.get("args", {}).get("chrome_graphics_pipeline")
        if step is None or event.get("ph") != "X":
            continue
        time = event["ts"] / 1e6
        match step.get("step"):
            case "STEP_RECEIVE_COMPOSITOR_FRAME":
                sink = step["frame_sink_id"]["frame_sink_id"]
                frames = surfaces.setdefault(sink, []) if sink >= OWN_SURFACE else pages
                frames.append(time)
            case "STEP_SURFACE_AGGREGATION":
                began[step["display_trace_id"]] = time
            case "STEP_FINISH_BUFFER_SWAP":
                ended[step["display_trace_id"]] = time
    swaps = [Swap(time, ended[swap]) for swap, time in began.items() if swap in ended]
    measured: list[float] = max(surfaces.values(), key=len) if surfaces else []
    return WindowTrace(pages, measured, swaps)

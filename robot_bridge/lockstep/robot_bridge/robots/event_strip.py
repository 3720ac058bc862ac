"""Draws the event reference into a picture, so that a test can read it back from rendered pixels.

The strip is the picture's top band: rows 0 to H // 20 - 1 of a picture of W x H pixels. It is divided into 32 cells of
equal width: cell i covers the columns i * W // 32 to (i + 1) * W // 32 - 1. Cells 0 to 30 are the 31 bits of the event
reference, most significant first; cell 31 is the even-parity bit: the exclusive or of the 31 others. A 1 is white (luma
235), a 0 is black (luma 16), without colour.

To read it, take the mean luma of the middle half of each cell (half its width and half its height, centred). If luma is
computed from RGB use 0.299 R + 0.587 G + 0.114 B. Above 160 the cell is a 1, below 90 a 0; anything between makes the
strip unreadable. So does wrong parity, and an event of 0. The cells scale with the picture, so the strip survives
scaling and compression.
"""

import msgspec
import numpy as np
import numpy.typing as npt

from lockstep.protocol.messages import Media
from lockstep.protocol.serial import is_event

__all__ = ["CELLS", "draw_event_strip", "read_event_strip", "strip_height", "with_event_strip"]

Luma = npt.NDArray[np.uint8]

CELLS = 32
WHITE = 235
BLACK = 16
SURELY_WHITE = 160
SURELY_BLACK = 90


def strip_height(height: int) -> int:
    """Return the number of rows that the strip takes of a picture of `height` rows."""
    return height // 20


def draw_event_strip(luma: Luma, event: int) -> None:
    """Draw the strip over the top of a luma plane of shape (H, W)."""
    height, width = luma.shape
    for index in range(CELLS):
        left, right = _columns(index, width)
        luma[: strip_height(height), left:right] = WHITE if _bit(event, index) else BLACK


def with_event_strip(media: Media) -> Media:
    """Return a raw picture with its stamp drawn over the top; any other medium unchanged."""
    pixels = media.width * media.height
    if media.codec != "yuv420p" or not 0 < pixels <= len(media.payload):
        return media
    payload = bytearray(media.payload)
    draw_event_strip(np.frombuffer(payload, np.uint8, pixels).reshape(media.height, media.width), media.stamp)
    return msgspec.structs.replace(media, payload=bytes(payload))


def read_event_strip(luma: npt.NDArray[np.generic]) -> int | None:
    """Return the event in a luma plane of shape (H, W); None if it cannot be read."""
    height, width = luma.shape
    rows = strip_height(height)
    band = luma[rows // 4 : rows - rows // 4].astype(float)
    bits = 0
    for index in range(CELLS):
        left, right = _columns(index, width)
        quarter = (right - left) // 4
        cell = band[:, left + quarter : right - quarter]
        mean = float(cell.mean()) if cell.size else 0.5 * (SURELY_BLACK + SURELY_WHITE)
        if SURELY_BLACK <= mean <= SURELY_WHITE:
            return None
        bits = bits << 1 | (mean > SURELY_WHITE)
    event = bits >> 1
    return event if is_event(event) and bits & 1 == event.bit_count() & 1 else None


def _columns(index: int, width: int) -> tuple[int, int]:
    return index * width // CELLS, (index + 1) * width // CELLS


def _bit(event: int, index: int) -> int:
    return event.bit_count() & 1 if index == CELLS - 1 else event >> (CELLS - 2 - index) & 1

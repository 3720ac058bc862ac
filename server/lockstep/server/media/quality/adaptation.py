"""Chooses a frame rate and a picture size for a bitrate. No I/O.

| bits per second for a camera | pictures per second | size |
|---|---|---|
| enough for 0.025 bit per pixel and picture | all | whole |
| less | all | the next smaller: 3/4, 1/2, 3/8, 1/4 of both sides |
| again 0.04 bit per pixel at the next larger size, five seconds after the last change | all | the next larger |
| less than 3000 bits per picture | full rate divided by 2, 3, 4, 6 …, until each has 3000; at least 5 | as above |

The size is reduced before the frame rate: a person steers by a steady sequence of pictures, and a longer wait for the
next picture is a larger gap. A new size begins with a keyframe, hence the distance between down and up.
"""

from lockstep.server.media.quality.encoding_target import EncodingTarget

__all__ = ["SCALES", "Adaptation"]

SCALES = (1.0, 0.75, 0.5, 0.375, 0.25)
DOWN_BITS, UP_BITS = 0.025, 0.04  # per pixel
UP_AFTER = 5.0  # s
PICTURE_BITS = 3000
MIN_FRAME_RATE = 5.0
MIN_SHORT_SIDE = 90  # pixels; a smaller picture shows a person too little to steer by
DIVISORS = (1, 2, 3, 4, 6, 8, 12, 16, 30)


class Adaptation:
    """The adaptation of one camera in one tier; remembers the size."""

    def __init__(self) -> None:
        self._step = 0  # index of SCALES
        self._changed_at = float("-inf")

    def plan(self, bitrate_bps: float, frame_rate: float, size: tuple[int, int], now: float) -> EncodingTarget:
        """Return the encoding target for pictures of `size` that come at `frame_rate`."""
        rate = _frame_rate(bitrate_bps, frame_rate)
        bits = bitrate_bps / (rate * size[0] * size[1])  # per pixel of the whole picture
        step = self._step
        while step + 1 < len(SCALES) and bits / SCALES[step] ** 2 < DOWN_BITS and self._fits(step + 1, size):
            step += 1
        if step == self._step and step > 0 and now - self._changed_at >= UP_AFTER:
            step -= bits / SCALES[step - 1] ** 2 >= UP_BITS
        if step != self._step:
            self._step, self._changed_at = step, now
        return EncodingTarget(round(bitrate_bps), rate, SCALES[step])

    def _fits(self, step: int, size: tuple[int, int]) -> bool:
        return min(size) * SCALES[step] >= MIN_SHORT_SIDE


def _frame_rate(bitrate_bps: float, full: float) -> float:
    affordable = max(bitrate_bps / PICTURE_BITS, min(MIN_FRAME_RATE, full))
    return next((full / divisor for divisor in DIVISORS if full / divisor <= affordable * 1.001), full / DIVISORS[-1])

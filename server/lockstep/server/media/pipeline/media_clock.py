"""RTP media time of one stream (RFC 3550 5.1). No clock is read here.

Media time starts at 0 with the stream and is shared by all peers; each sender adds its own random offset.
"""

__all__ = ["PictureClock", "SoundClock"]

VIDEO_RATE = 90_000  # Hz, RFC 6184 8.2.1 and RFC 7741 6.1
MAX_SOUND_DRIFT_SECONDS = 0.04


class PictureClock:
    """90 kHz timestamps that strictly increase."""

    def __init__(self) -> None:
        self._origin: float | None = None
        self._last = -1

    def timestamp(self, link_time: float) -> int:
        if self._origin is None:
            self._origin = link_time
        self._last = max(self._last + 1, round((link_time - self._origin) * VIDEO_RATE))
        return self._last

    def place(self, link_time: float) -> int:
        """Return the timestamp of a time, without a step of the clock; 0 before the first."""
        return 0 if self._origin is None else max(0, round((link_time - self._origin) * VIDEO_RATE))


class SoundClock:
    """Places sound on the link's time line: sample-exact while it is continuous, moved on where some is missing."""

    def __init__(self, rate: int) -> None:
        self._rate = rate
        self._origin: float | None = None
        self._next = 0  # index of the next sample

    def place(self, link_time: float, samples: int) -> tuple[int, bool]:
        """Return the index of the first of `samples` captured at `link_time`, and True if it continues the last sound.

        The bridge's clock jitters against its sound card; up to 40 ms of difference count as continuous. A card that
        is slower skips 40 ms then; one that is faster moves the time line.
        """
        if self._origin is None:
            self._origin = link_time
        expected = round((link_time - self._origin) * self._rate)
        limit = MAX_SOUND_DRIFT_SECONDS * self._rate
        continuous = expected - self._next <= limit
        if not continuous:
            self._next = expected
        elif self._next - expected > limit:  # the sound card is faster than the bridge's clock
            self._origin = link_time - self._next / self._rate
        start = self._next
        self._next += samples
        return start, continuous

"""Which bitrate, size and keyframes the media links ask of each stream, in one. No I/O, no clock.

A picture is encoded once for all media links, so the least that any of them asks for counts, and a keyframe that one
needs goes to all.
"""

from collections.abc import Hashable, Iterable
from typing import Generic, NamedTuple, TypeVar

from lockstep.protocol.messages import EncodeRequest, StreamRequest

__all__ = ["EncodingGoal", "EncodingRequests", "FrameRateGate", "KeyframeSpacing"]

Link = TypeVar("Link", bound=Hashable)

# Before a link has asked, when nothing is known about its path: a picture that a narrow uplink carries too.
FIRST_BITRATE = 300_000  # bit/s
LEAST_BITRATE = 30_000  # bit/s; encoders do not go lower
LEAST_FRAME_RATE = 0.2  # Hz
LEAST_SCALE = 0.1
MIN_SIDE = 16  # pixels
SPACING = 0.2  # s between two keyframes that were asked for
EARLY = 0.25  # of an interval by which a picture may come early: cameras are not exact


class EncodingGoal(NamedTuple):
    """What an encoder aims at."""

    bitrate: int  # bit/s
    frame_rate: float  # pictures/s at most; 0: all
    scale: float  # of both sides

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the encoded size of a picture of `width` x `height`; both sides are even."""
        return _scaled(width, self.scale), _scaled(height, self.scale)


class EncodingRequests(Generic[Link]):
    """The newest requests of all media links. Call `joined`, `asked` and `left` for the links."""

    def __init__(self, streams: Iterable[str]) -> None:
        """`streams`: the names of the robot's streams; requests for others are ignored."""
        self._streams = frozenset(streams)
        self._requests: dict[Link, dict[str, StreamRequest]] = {}
        self._served: dict[Link, dict[str, int]] = {}  # keyframes asked for so far, as far as they were passed on
        self._wanted: set[str] = set()  # streams that owe somebody a keyframe
        self._complete: set[str] = set()  # streams that have given a keyframe since the newest link joined

    def joined(self, link: Link) -> None:
        """A media link opened: it can decode nothing before a keyframe."""
        self._requests[link], self._served[link] = {}, {}
        self._complete.clear()

    def left(self, link: Link) -> None:
        """Forget a link. Idempotent."""
        self._requests.pop(link, None)
        self._served.pop(link, None)

    def asked(self, link: Link, request: EncodeRequest) -> None:
        """Take a link's newest request, which replaces the one before. Ignored for a link that has not joined."""
        if link not in self._requests:
            return
        self._requests[link] = {each.stream: each for each in request.streams if each.stream in self._streams}
        served = self._served[link]
        for name, each in self._requests[link].items():
            if each.keyframes > served.get(name, 0):
                served[name] = each.keyframes
                self._wanted.add(name)

    def takes(self, link: Link, stream: str) -> bool:
        """Return whether a link's newest request names a stream."""
        return stream in self._requests.get(link, {})

    def is_asked(self, stream: str) -> bool:
        """Return whether some link's newest request names a stream."""
        return any(stream in requests for requests in self._requests.values())

    def lost(self, stream: str) -> None:
        """A link had to drop pictures of a stream: without a keyframe it gets no more of them."""
        self._wanted.add(stream)

    def goal(self, stream: str) -> EncodingGoal:
        """Return what to aim at now."""
        asked = [each for requests in self._requests.values() if (each := requests.get(stream)) is not None]
        bitrate = min((each.bitrate for each in asked if each.bitrate), default=FIRST_BITRATE)
        frame_rate = min((each.frame_rate for each in asked if each.frame_rate), default=0.0)
        scale = min((each.scale for each in asked), default=1.0)
        return EncodingGoal(
            max(LEAST_BITRATE, bitrate),
            max(LEAST_FRAME_RATE, frame_rate) if frame_rate else 0.0,
            max(LEAST_SCALE, scale),
        )

    def wants_keyframe(self, stream: str) -> bool:
        """True if the next picture of a stream has to be a keyframe."""
        return stream in self._wanted or stream not in self._complete

    def keyframe_made(self, stream: str) -> None:
        """A keyframe was made: it serves all who waited for one."""
        self._wanted.discard(stream)
        self._complete.add(stream)


class KeyframeSpacing:
    """Bounds how often a stream's requests are answered: each keyframe costs as much as many pictures."""

    def __init__(self) -> None:
        self._last: float | None = None  # time of the last keyframe

    def allows(self, time: float) -> bool:
        return self._last is None or not 0 <= time - self._last < SPACING

    def made(self, time: float) -> None:
        self._last = time


class FrameRateGate:
    """Leaves pictures out, evenly, so that no more than a rate remain."""

    def __init__(self) -> None:
        self._due: float | None = None  # time from which the next picture is taken; None before the first

    def takes(self, time: float, frame_rate: float) -> bool:
        """Return whether the picture captured at `time` is taken. `frame_rate`: at most, in Hz; 0: all are."""
        if frame_rate <= 0:
            self._due = None
            return True
        interval = 1 / frame_rate
        if self._due is None or not -2 * interval < time - self._due < interval:
            self._due = time
        if time < self._due - EARLY * interval:
            return False
        self._due += interval
        return True


def _scaled(side: int, scale: float) -> int:
    if scale >= 1.0:
        return side - side % 2
    return max(MIN_SIDE, round(side * scale / 2) * 2)

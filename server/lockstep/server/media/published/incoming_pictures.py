"""Turns one publisher's packets into encoded pictures with the time of capture. No I/O, no clock is read."""

from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.media.published.encoded_wire import Encoded
from lockstep.server.media.published.path_bound import PathBound
from lockstep.server.media.published.picture_assembly import AssembledPicture, MediaPacket, PictureAssembly
from lockstep.server.media.sources.capture_timeline import CaptureTimeline

__all__ = ["IncomingPictures"]

MAX_RATE, MAX_BURST = 2000.0, 4000.0  # Hz, of packets: 20 Mbit/s of full ones
FIRST_ROUND_TRIP = 0.1  # s, before the first measurement
MOST_LAG = 5.0  # s behind the quickest; beyond it the backlog is given up by publishing anew


class IncomingPictures:
    """Call `take` for each packet, `look` some times a second, and `path.observe` for each measured round trip.

    A picture without a time is to be decoded, since others build on it, but not shown: its event is not known.

    Attributes:
        flooded: packets dropped because they exceeded the allowed rate
        heard_at: arrival of the last packet; None before the first
    """

    def __init__(self, codec: PictureCodec, latency: float) -> None:
        """`latency`: s from capture until the quickest picture leaves the publisher."""
        self.flooded = 0
        self.heard_at: float | None = None
        self.path = PathBound()
        self._codec = codec
        self._assembly = PictureAssembly(codec)
        self._timeline = CaptureTimeline(latency)
        self._budget = TokenBucket(MAX_RATE, MAX_BURST)

    @property
    def lost(self) -> int:
        """Packets that never came, or came too late."""
        return self._assembly.lost

    @property
    def malformed(self) -> int:
        """Pictures that are not valid in their codec."""
        return self._assembly.malformed

    @property
    def late(self) -> bool:
        """True if the publisher is too late to catch up."""
        return self._timeline.lag > MOST_LAG

    def take(self, packet: MediaPacket, now: float) -> list[Encoded]:
        self.heard_at = now
        if not self._budget.take(now):
            self.flooded += 1
            return []
        return self._timed(self._assembly.take(packet, now, self._round_trip), now)

    def look(self, now: float) -> list[Encoded]:
        """Return the pictures that are whole once packets missing for too long are given up."""
        return self._timed(self._assembly.look(now, self._round_trip), now)

    def wants_keyframe(self, now: float) -> bool:
        """True if a keyframe is to be requested now; it then counts as requested."""
        return self._assembly.wants_keyframe(now)

    def lost_picture(self) -> None:
        """Note that a picture could not be decoded."""
        self._assembly.lost_picture()

    @property
    def _round_trip(self) -> float:
        return FIRST_ROUND_TRIP if self.path.newest is None else self.path.newest

    def _timed(self, pictures: list[AssembledPicture], now: float) -> list[Encoded]:
        return [Encoded(self._codec, self._captured_at(each, now), each.keyframe, each.data) for each in pictures]

    def _captured_at(self, picture: AssembledPicture, now: float) -> float | None:
        """Return a time no later than the capture, if the quickest left within the latency; None: not known."""
        at = self._timeline.place(picture.media_time, 0.0, picture.arrival)
        path = self.path.seconds(now)
        return None if at is None or path is None else at - path

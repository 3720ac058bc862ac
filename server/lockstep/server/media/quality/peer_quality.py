"""The quality of one peer: its feedback about its path, and the decisions for it."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from lockstep.protocol.console import Quality, Report, StreamQuality, Tier
from lockstep.protocol.serial import event_gap
from lockstep.server.media.pipeline.rtp_sender import SenderStats
from lockstep.server.media.quality.encoding_target import PictureTier
from lockstep.server.media.quality.observer_tier import ObserverTier
from lockstep.server.media.quality.path.bandwidth_estimator import BandwidthEstimator, RateLimits, Reason
from lockstep.server.media.subscription import Subscription

if TYPE_CHECKING:
    from lockstep.server.media.pipeline.stream import AudioStream, VideoStream

__all__ = ["CameraDelivery", "PeerQuality", "SoundDelivery"]

CALM_RATE = 25.0  # events a second up to which each event of a gap counts in full
WIRE_SHARE = 0.92  # share of payload in the bytes that a receiver counts; the rest are headers


class CameraDelivery(NamedTuple):
    """The delivery of one camera to this peer."""

    stream: "VideoStream"
    codec: str
    target: Subscription


class SoundDelivery(NamedTuple):
    """The delivery of one microphone to this peer."""

    stream: "AudioStream"
    codec: str
    target: Subscription


class PeerQuality:
    """Takes one peer's receiver reports, bandwidth estimates and the client's own reports."""

    def __init__(
        self, *, operator: bool, limits: RateLimits, tier: Tier, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.operator = operator
        self.drives = False  # holds the control seat
        self.stays_low = False  # a thumbnail: never more than the lowest tier
        self.relays = False  # a relay, with many peers behind it
        self.cameras: list[CameraDelivery] = []  # the main one first
        self.sounds: list[SoundDelivery] = []
        self.pace: Callable[[float | None], None] = lambda rate: None  # bit/s that the path carries; None: no limit
        self.path = BandwidthEstimator(limits, clock())
        self.choice = ObserverTier(clock())
        self.tier = tier  # tier that its pictures are planned for
        self.encoded_as: PictureTier = tier  # tier whose pictures it gets: a tier may be served by another's encoder
        self.hears_as: PictureTier = "operator"  # tier whose sound packets it gets: a crowd's are longer
        self.on_quality: Callable[[Quality], None] | None = None
        self.quality: Quality | None = None  # the last one sent
        self._clock = clock
        self._estimates: dict[frozenset[int], int] = {}
        self._reported: tuple[int, float] | None = None  # event and time of the last report

    def stay_low(self) -> None:
        """Keep this peer in the low tier: nobody looks closely at its pictures. Call before it joins."""
        self.stays_low = True
        self.tier = self.encoded_as = "low"

    @property
    def in_crowd(self) -> bool:
        """True for a peer that gets fewer pictures in a crowd, as long as it does not drive.

        False for a peer that may drive at any moment, a relay and a thumbnail.
        """
        return bool(self.cameras) and not (self.operator or self.relays or self.stays_low)

    @property
    def estimate_bps(self) -> int | None:
        """The peer's estimate of its bandwidth (REMB); None before the first."""
        return sum(self._estimates.values()) if self._estimates else None

    @property
    def loss(self) -> float | None:
        """The loss of pictures, 0 to 1; None before the first report."""
        return self.path.losses.fraction(self._clock()) if self.path.losses.known else None

    @property
    def round_trip_ms(self) -> float | None:
        """The round trip in ms; None before the first measurement."""
        for camera in self.cameras:
            if (measured := camera.target.sender.round_trip_ms) is not None:
                return measured
        return None

    def stats(self) -> list[SenderStats]:
        return [camera.target.sender.stats for camera in self.cameras]

    def reception(self, lost: int, expected: int, round_trip: float | None) -> None:
        """Take a receiver report about one of its streams, sound included: all of them share one path."""
        self.path.received(lost, expected, round_trip, self._clock())

    def bandwidth(self, bitrate_bps: int, ssrcs: frozenset[int]) -> None:
        """Take a receiver's estimate, which is for all its streams together or for each by itself."""
        self._estimates = {known: bps for known, bps in self._estimates.items() if not known & ssrcs}
        self._estimates[ssrcs] = bitrate_bps
        self.path.estimated(WIRE_SHARE * sum(self._estimates.values()), self._clock())

    def report(self, report: Report, now: float) -> None:
        """Take the client's own report. Only the gaps of the main camera count, or of the first that delivers pictures.

        The gap of a camera without pictures grows with every event, which says nothing about the path. Nor does a gap
        that grows because events follow one another more quickly: the operator's page lets them only while pictures
        keep up. So a gap counts as it were at `CALM_RATE`.
        """
        share = self._calm_share(report.event, now)
        if not self.cameras:
            return
        streams = [camera.stream for camera in self.cameras]
        main = next((stream.name for stream in streams if stream.is_giving(now)), streams[0].name)
        for stream in report.streams:
            if stream.stream != main or stream.stamp == 0 or report.event == 0:
                continue
            lag = max(stream.lag, event_gap(report.event, stream.stamp))
            self.path.lagged(int(lag * share), stream.tolerance, now)

    def _calm_share(self, event: int, now: float) -> float:
        """Return the part of a gap that is left at `CALM_RATE`, from the events since the last report."""
        before, self._reported = self._reported, (event, now)
        if before is None or not event or not before[0]:
            return 1.0
        events, seconds = event_gap(event, before[0]), now - before[1]
        return min(1.0, CALM_RATE * seconds / events) if events > 0 else 1.0

    def decide(self, now: float) -> Reason | None:
        """Evaluate the path; return the reason if its rate was lowered."""
        before = self.path.rate
        self.path.sending.add(sum(stats.octets for stats in self.stats()), now)
        self.path.decide(now)
        self.pace(self.path.rate if self.path.limited else None)
        return self.path.reason if self.path.rate < before else None

    def move_pictures(self, tier: PictureTier) -> bool:
        """Get the pictures of `tier`; return whether that is another one."""
        if self.encoded_as == tier:
            return False
        self.encoded_as = tier
        for camera in self.cameras:
            camera.stream.encodings.move(camera.codec, camera.target, tier)
        return True

    def move_sound(self, tier: PictureTier) -> None:
        """Get the sound packets of `tier`."""
        if self.hears_as != tier:
            self.hears_as = tier
            for sound in self.sounds:
                sound.stream.encodings.move(sound.codec, sound.target, tier)

    def tell(self, streams: list[StreamQuality], crowd: int) -> None:
        """Tell the peer its quality if that has changed; `crowd` as in `Quality`."""
        quality = Quality(streams=streams, reason=self.path.reason, crowd=crowd)
        if self.on_quality is not None and _differs(self.quality, quality):
            self.quality = quality
            self.on_quality(quality)


def _differs(old: Quality | None, new: Quality) -> bool:
    """True if a person would notice the difference in quality."""
    if old is None or (old.reason, old.crowd) != (new.reason, new.crowd) or len(old.streams) != len(new.streams):
        return True
    return any(
        (a.stream, a.tier, a.width, a.height) != (b.stream, b.tier, b.width, b.height)
        or abs(a.frames_per_second - b.frames_per_second) > 0.1
        or abs(a.bits_per_second - b.bits_per_second) > 0.2 * a.bits_per_second
        for a, b in zip(old.streams, new.streams, strict=True)
    )

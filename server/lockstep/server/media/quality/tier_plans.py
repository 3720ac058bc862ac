"""The plans of all tiers: how the encoders of each make the pictures of each camera."""

from collections.abc import Iterable

from lockstep.protocol.console import Tier
from lockstep.server.media.pipeline.stream import VideoStream
from lockstep.server.media.quality.adaptation import Adaptation
from lockstep.server.media.quality.budget import CameraNeed, share_out
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.quality.load_shedding import LoadShedding
from lockstep.server.media.quality.peer_quality import PeerQuality

__all__ = ["LOW_FLOOR_BPS", "TierPlans", "cameras_of"]

LOW_FLOOR_BPS = 120_000
LOW_SHARE = 0.5  # of the high tier, at most


class TierPlans:
    """The plans of one media hub. The operator's and the low tier's are made; those of the others follow from them."""

    def __init__(self, maximum_bps: float, crowd: LoadShedding) -> None:
        """`maximum_bps`: of one camera."""
        self._maximum_bps = maximum_bps
        self._crowd = crowd
        self._ladders: dict[tuple[Tier, str], Adaptation] = {}
        self._plans: dict[tuple[PictureTier, str], EncodingTarget] = {}
        self._low_divisor = 1  # the low tier gets one of so many pictures

    def of(self, stream: VideoStream, tier: PictureTier) -> EncodingTarget:
        """Return the plan of a camera; the best that there is before the tier's first."""
        full = stream.encodings.full
        if tier == "crowd":
            return full.thinned(self._crowd.divisor)
        return self._plans.get((tier, stream.name), full)

    def apply(self, streams: Iterable[VideoStream], tier: PictureTier) -> None:
        """Give the existing encoders of a tier their plans."""
        for stream in streams:
            for encoding in stream.encodings.own.of_tier(tier):
                encoding.plan = self.of(stream, tier)

    def plan(self, tier: Tier, streams: list[VideoStream], total_bps: float, now: float, divisor: int = 1) -> None:
        """Plan the cameras of a tier. `divisor`: the tier gets one picture of so many, at most.

        A camera without pictures keeps the plan that it would have, so that it begins with no more than its share;
        until then the others share the whole bitrate.
        """
        shares = self._shares(total_bps, streams) | self._shares(total_bps, _giving(streams, now))
        for stream, bps in shares.items():
            ladder = self._ladders.setdefault((tier, stream.name), Adaptation())
            self._plans[tier, stream.name] = ladder.plan(bps, stream.frame_rate / divisor, stream.size, now)
        self.apply(shares, tier)

    def plan_low(self, members: list[PeerQuality], now: float) -> None:
        """Plan the low tier, which `members` are in."""
        if members:
            watched = [peer for peer in members if not peer.stays_low]
            least = min((peer.path.rate for peer in watched), default=LOW_FLOOR_BPS)
            most = LOW_SHARE * max(self.needed_bps(peer, now) for peer in members)
            # A crowd's member whose path is too slow for the crowd's pictures gets no more of them than the crowd. The
            # tier has one encoder: while it has a member outside the crowd, which is due all pictures, all get them.
            self._low_divisor = self._crowd.divisor if all(peer.in_crowd for peer in members) else 1
            self.plan("low", cameras_of(members), min(most, max(LOW_FLOOR_BPS, least)), now, self._low_divisor)

    def needed_bps(self, peer: PeerQuality, now: float) -> float:
        """Return the bits per second of all that an observer gets in the high tier, or in the crowd."""
        whole = len(_giving(cameras_of([peer]), now)) * self._maximum_bps
        return whole / self._crowd.divisor if peer.in_crowd else whole

    def is_thinned(self, peer: PeerQuality) -> bool:
        """Return whether a crowd is the reason that an observer gets fewer pictures."""
        return peer.in_crowd and (self._low_divisor if peer.encoded_as == "low" else self._crowd.divisor) > 1

    def _shares(self, total_bps: float, streams: list[VideoStream]) -> dict[VideoStream, float]:
        """Return the bits per second of each of these cameras, the main one first."""
        needs = [
            CameraNeed(stream.size[0] * stream.size[1] * stream.frame_rate, self._maximum_bps) for stream in streams
        ]
        return dict(zip(streams, share_out(total_bps, needs), strict=True))


def cameras_of(peers: Iterable[PeerQuality]) -> list[VideoStream]:
    """Return the cameras of these peers, the main one first."""
    return list({camera.stream: None for peer in peers for camera in peer.cameras})


def _giving(streams: list[VideoStream], now: float) -> list[VideoStream]:
    """Return the streams that deliver pictures; all if none does, as before the first picture."""
    return [stream for stream in streams if stream.is_giving(now)] or streams

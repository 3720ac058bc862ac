"""Controls the quality of all peers: the tiers, their encoding, and the tier of each peer.

| tier | peers | bits per second |
|---|---|---|
| operator | the holder of the control seat; while nobody holds it, all operators | those of the slowest path |
| high | observers (and other operators) whose paths carry it | all |
| low | the others, and thumbnails | those of the slowest path, but no less than a floor and at most half of high |

While the operator's pictures are whole and their path shows no limit, the high tier gets the same pictures: one
encoder serves both. As soon as that ends, the high tier has a separate encoder. So there are at most three encoders for
a camera and codec, and one while the network is good.

In a crowd (`LoadShedding`) the observers of the high tier get every second or third picture, or fewer while the event
loop is overloaded, from one more encoder, with as many bits for each picture as before, and their sound in longer
packets. Nothing changes for peers that may drive, relays, recordings and thumbnails.
"""

import asyncio
import time
from collections.abc import Callable, Iterable

from lockstep.protocol.console import StreamQuality, Tier
from lockstep.server.media.pipeline.stream import AudioStream, VideoStream
from lockstep.server.media.quality.adaptation import Adaptation
from lockstep.server.media.quality.budget import CameraNeed, share_out
from lockstep.server.media.quality.encoding_target import EncodingTarget, PictureTier
from lockstep.server.media.quality.load_shedding import LoadShedding
from lockstep.server.media.quality.metrics import QualityMetrics
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.media.settings import MediaSettings

__all__ = ["QualityController"]

TICK = 0.1  # s
LATE = 0.03  # s by which a tick may be late
LOAD_SECONDS = 1.0  # between two measurements of the loop's load
OBSERVER_TICKS = 10  # an observer is evaluated once in so many
SHARE_AFTER = 5.0  # s of an operator's path without a limit
LOW_FLOOR_BPS = 120_000
LOW_SHARE = 0.5  # of the high tier, at most


class QualityController:
    """The quality controller of one media hub, on its loop. Switched off, all peers get one tier with full quality."""

    def __init__(
        self,
        settings: MediaSettings,
        metrics: QualityMetrics,
        clock: Callable[[], float] = time.monotonic,
        busy_seconds: Callable[[], float] = lambda: 0.0,
        on_fault: Callable[[Exception], None] | None = None,
    ) -> None:
        """`busy_seconds`: as in `CooperativeScheduler`. `on_fault` gets the exception of a tick; the next is tried."""
        self._settings = settings
        self._metrics = metrics
        self._clock = clock
        self._peers: dict[PeerQuality, None] = {}  # an ordered set
        self._ladders: dict[tuple[Tier, str], Adaptation] = {}
        self._plans: dict[tuple[Tier, str], EncodingTarget] = {}
        self._crowd = LoadShedding(settings.crowd_observers)
        self._low_divisor = 1  # the low tier gets one of so many pictures
        self._busy_seconds = busy_seconds
        self._on_fault = on_fault
        self._load_at = clock(), busy_seconds()  # time and busy seconds of the last measurement
        self._ticks = 0
        self._common: object = None  # the state that decides for all observers, at the last tick
        self._whole_since: float | None = None  # time from which the operator's pictures are whole; None: they are not

    def join(self, peer: PeerQuality) -> None:
        self._peers[peer] = None
        if self._settings.quality:
            self.tick()

    def leave(self, peer: PeerQuality) -> None:
        """Remove a peer. Idempotent."""
        self._peers.pop(peer, None)
        self._common = None
        self._metrics.forget(peer)

    async def run(self) -> None:
        """Tick until cancelled."""
        while self._settings.quality:
            due = self._clock() + TICK
            await asyncio.sleep(TICK)
            if (now := self._clock()) > due + LATE:
                for peer in list(self._peers):
                    peer.path.late(now)
            if self._peers:
                self._try_tick()

    def _try_tick(self) -> None:
        try:
            self.tick()
        except Exception as error:
            if self._on_fault is None:
                raise
            self._on_fault(error)

    def tick(self) -> None:
        """Evaluate the paths, plan the tiers, move peers between tiers and tell them about changes."""
        now = self._clock()
        self._ticks += 1
        leaders = self.leaders()
        for peer in leaders:
            if (reason := peer.decide(now)) is not None:
                self._metrics.lowered(reason)
        self._plan_operator(leaders, now)
        observers = [peer for peer in self._peers if peer not in leaders]
        for peer in observers:
            if peer.tier == "operator":  # it drove until now
                self._step_back(peer, now)
        turn = observers[-self._ticks % OBSERVER_TICKS :: OBSERVER_TICKS]
        for peer in turn:
            peer.decide(now)
            peer.tier = "low" if peer.stays_low else peer.choice.decide(peer.path, self._needs(peer), now)
        self._plan_low([peer for peer in observers if peer.tier == "low"], now)
        self._look_at_load(now)
        self._thin(observers, now)
        shared = self._whole_since is not None and now - self._whole_since >= SHARE_AFTER
        for peer in leaders:
            self._settle(peer, "operator", "operator")
        # A change for all observers is rare, and there may be hundreds: otherwise settle only those whose turn it is.
        common = shared, self._crowd.divisor > 1, leaders, observers
        settled = turn if common == self._common else observers
        self._common = common
        for peer in settled:
            self._settle(peer, peer.tier, self._encoded_as(peer, shared))
        for peer in turn:
            self._tell(peer)
        for peer in (*leaders, *settled):
            self._sound_for(peer)
            held_back = peer.path.limited or peer.tier == "low"
            for camera in peer.cameras:
                # A robot that encodes as it is asked to makes what the operator's path carries.
                fits = camera.stream.encodings.follows and peer.tier == "operator"
                camera.stream.passthrough.hold_back(camera.target, held_back and not fits)
        if self._ticks % OBSERVER_TICKS == 0:
            for peer in leaders:
                self._tell(peer)
            self._protect_sound(leaders or observers, now)
            self._measure(leaders, observers)

    def planned_bps(self, stream: VideoStream) -> int:
        """Return the bits per second of a camera that the operators' paths carry; all without an operator."""
        return (
            self._plans.get(("operator", stream.name), stream.encodings.full).bitrate_bps
            if self.leaders()
            else (stream.encodings.full.bitrate_bps)
        )

    def operator_limited(self) -> bool:
        """Return whether an operator's path has shown a limit within the last minute."""
        return any(peer.path.limited for peer in self.leaders())

    def _look_at_load(self, now: float) -> None:
        (since, before), busy = self._load_at, self._busy_seconds()
        if now - since >= LOAD_SECONDS:
            self._load_at = now, busy
            self._crowd.loaded((busy - before) / (now - since), now)

    def _thin(self, observers: list[PeerQuality], now: float) -> None:
        """Count the crowd and, if there is one, plan its pictures."""
        members = [peer for peer in observers if peer.in_crowd]
        if self._crowd.watch(len(members), now) > 1:
            for stream in _streams(members):
                for encoding in stream.encodings.own.of_tier("crowd"):
                    encoding.plan = self._plan_of(stream, "crowd")

    def _encoded_as(self, peer: PeerQuality, shared: bool) -> PictureTier:
        """Return the tier whose pictures an observer gets; `shared`: the operator's pictures serve the high tier."""
        if peer.tier != "high":
            return peer.tier
        if peer.in_crowd and self._crowd.divisor > 1:
            return "crowd"
        return "operator" if shared else "high"

    def leaders(self) -> list[PeerQuality]:
        """Return the peers of the operator's tier."""
        return [peer for peer in self._peers if peer.drives] or [peer for peer in self._peers if peer.operator]

    def _step_back(self, peer: PeerQuality, now: float) -> None:
        """Make a former operator an observer; if its path has shown no limit, on trial with full quality."""
        if not peer.path.limited:
            peer.path.assume(self._needs(peer), now)
        peer.tier = peer.choice.decide(peer.path, self._needs(peer), now)

    def _needs(self, peer: PeerQuality) -> float:
        whole = len(_giving(_streams([peer]), self._clock())) * float(self._settings.video_bitrate_bps)
        return whole / self._crowd.divisor if peer.in_crowd else whole

    def _plan_operator(self, leaders: list[PeerQuality], now: float) -> None:
        if not leaders:
            self._whole_since = None
            return
        tightest = min(leaders, key=lambda peer: peer.path.rate)
        streams = _streams(leaders)
        self._plan("operator", streams, tightest.path.rate, now)
        limited = any(peer.path.limited for peer in leaders)
        pause = max(peer.path.paused_until for peer in leaders)
        for stream in streams:
            for encoding in stream.encodings.own.of_tier("operator"):
                encoding.paused_until = pause
                encoding.keyframes.sparing = limited
        whole = not limited and all(
            plan.scale == 1.0 and plan.frame_rate >= stream.frame_rate
            for stream in streams
            if (plan := self._plans.get(("operator", stream.name))) is not None
        )
        if not whole:
            self._whole_since = None
        elif self._whole_since is None:
            self._whole_since = now

    def _plan_low(self, members: list[PeerQuality], now: float) -> None:
        if members:
            watched = [peer for peer in members if not peer.stays_low]
            least = min((peer.path.rate for peer in watched), default=LOW_FLOOR_BPS)
            most = LOW_SHARE * max(self._needs(peer) for peer in members)
            # A crowd's member whose path is too slow for the crowd's pictures gets no more of them than the crowd. The
            # tier has one encoder: while it has a member outside the crowd, which is due all pictures, all get them.
            self._low_divisor = self._crowd.divisor if all(peer.in_crowd for peer in members) else 1
            self._plan("low", _streams(members), min(most, max(LOW_FLOOR_BPS, least)), now, self._low_divisor)

    def _plan(self, tier: Tier, streams: list[VideoStream], total_bps: float, now: float, divisor: int = 1) -> None:
        """Plan the cameras of a tier. `divisor`: the tier gets one picture of so many, at most.

        A camera without pictures keeps the plan that it would have, so that it begins with no more than its share;
        until then the others share the whole bitrate.
        """
        shares = self._shares(total_bps, streams) | self._shares(total_bps, _giving(streams, now))
        for stream, bps in shares.items():
            ladder = self._ladders.setdefault((tier, stream.name), Adaptation())
            plan = ladder.plan(bps, stream.frame_rate / divisor, stream.size, now)
            self._plans[tier, stream.name] = plan
            for encoding in stream.encodings.own.of_tier(tier):
                encoding.plan = plan

    def _shares(self, total_bps: float, streams: list[VideoStream]) -> dict[VideoStream, float]:
        """Return the bits per second of each of these cameras, the main one first."""
        maximum = float(self._settings.video_bitrate_bps)
        needs = [CameraNeed(stream.size[0] * stream.size[1] * stream.frame_rate, maximum) for stream in streams]
        return dict(zip(streams, share_out(total_bps, needs), strict=True))

    def _settle(self, peer: PeerQuality, tier: Tier, encoded_as: PictureTier) -> None:
        peer.tier = tier
        if peer.encoded_as == encoded_as:
            return
        peer.encoded_as = encoded_as
        for camera in peer.cameras:
            camera.stream.encodings.move(camera.codec, camera.target, encoded_as)
            for encoding in camera.stream.encodings.own.of_tier(encoded_as):
                encoding.plan = self._plan_of(camera.stream, encoded_as)

    def _sound_for(self, peer: PeerQuality) -> None:
        """Give a crowd longer sound packets, in the low tier too: their headers are a third of a narrow path."""
        hears_as: PictureTier = "crowd" if peer.in_crowd and not peer.drives and self._crowd.divisor > 1 else "operator"
        if peer.hears_as != hears_as:
            peer.hears_as = hears_as
            for sound in peer.sounds:
                sound.stream.encodings.move(sound.codec, sound.target, hears_as)

    def _plan_of(self, stream: VideoStream, tier: PictureTier) -> EncodingTarget:
        if tier == "crowd":
            return stream.encodings.full.thinned(self._crowd.divisor)
        return stream.encodings.full if tier == "high" else self._plans.get((tier, stream.name), stream.encodings.full)

    def _tell(self, peer: PeerQuality) -> None:
        streams, thinned = [], False
        for camera in peer.cameras:
            plan = self._plan_of(camera.stream, peer.encoded_as)
            width, height = plan.size(*camera.stream.size)
            rate, bps = plan.frame_rate, float(plan.bitrate_bps)
            if (passed := camera.stream.passthrough.measured(camera.target)) is not None:  # as the camera made it
                (width, height), (rate, bps) = camera.stream.size, passed
            else:
                thinned |= (
                    self._low_divisor if peer.encoded_as == "low" else self._crowd.divisor
                ) > 1 and peer.in_crowd
            streams.append(
                StreamQuality(
                    stream=camera.stream.name,
                    tier=peer.tier,
                    width=width,
                    height=height,
                    frames_per_second=round(rate, 2),
                    bits_per_second=bps,
                    camera_frames_per_second=round(camera.stream.frame_rate, 2),
                )
            )
        peer.tell(streams, self._crowd.size if thinned else 0)

    @staticmethod
    def _protect_sound(peers: list[PeerQuality], now: float) -> None:
        """Protect sound, encoded once for all, against the operator's loss, or the worst observer's without one."""
        losses: dict[AudioStream, float] = {}
        for peer in peers:
            for sound in peer.sounds:
                losses[sound.stream] = max(losses.get(sound.stream, 0.0), peer.loss or 0.0)
        for stream, loss in losses.items():
            stream.expected_loss.update(loss, now)

    def _measure(self, leaders: list[PeerQuality], observers: list[PeerQuality]) -> None:
        tiers: dict[PictureTier, list[PeerQuality]] = {
            "operator": leaders,
            "high": [peer for peer in observers if peer.tier == "high" and peer.encoded_as != "crowd"],
            "crowd": [peer for peer in observers if peer.encoded_as == "crowd"],
            "low": [peer for peer in observers if peer.tier == "low"],
        }
        for tier, peers in tiers.items():
            self._metrics.paths(tier, peers)
            for stream in _streams(peers):
                self._metrics.plan(stream.name, tier, self._plan_of(stream, tier), stream.size)


def _streams(peers: Iterable[PeerQuality]) -> list[VideoStream]:
    """The cameras of these peers, the main one first."""
    return list({camera.stream: None for peer in peers for camera in peer.cameras})


def _giving(streams: list[VideoStream], now: float) -> list[VideoStream]:
    """Return the streams that deliver pictures; all if none does, as before the first picture."""
    return [stream for stream in streams if stream.is_giving(now)] or streams

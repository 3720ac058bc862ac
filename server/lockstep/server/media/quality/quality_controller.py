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
from collections.abc import Callable

from lockstep.protocol.console import StreamQuality, Tier
from lockstep.server.media.pipeline.stream import AudioStream, VideoStream
from lockstep.server.media.quality.encoding_target import PictureTier
from lockstep.server.media.quality.load_shedding import LoadShedding
from lockstep.server.media.quality.loop_load import LoopLoad
from lockstep.server.media.quality.metrics import QualityMetrics
from lockstep.server.media.quality.peer_quality import PeerQuality
from lockstep.server.media.quality.tier_plans import TierPlans, cameras_of
from lockstep.server.media.settings import MediaSettings

__all__ = ["QualityController"]

TICK = 0.1  # s
LATE = 0.03  # s by which a tick may be late
OBSERVER_TICKS = 10  # an observer is evaluated once in so many
SHARE_AFTER = 5.0  # s of an operator's path without a limit


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
        self._crowd = LoadShedding(settings.crowd_observers)
        self._plans = TierPlans(float(settings.video_bitrate_bps), self._crowd)
        self._load = LoopLoad(busy_seconds, clock())
        self._on_fault = on_fault
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
            try:
                if self._peers:
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
        turn = observers[-self._ticks % OBSERVER_TICKS :: OBSERVER_TICKS]
        self._choose_tiers(observers, turn, now)
        self._plans.plan_low([peer for peer in observers if peer.tier == "low"], now)
        self._plan_crowd(observers, now)
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
            # A crowd gets longer sound packets, in the low tier too: their headers are a third of a narrow path.
            peer.move_sound("crowd" if peer.in_crowd and not peer.drives and self._crowd.divisor > 1 else "operator")
            held_back = peer.path.limited or peer.tier == "low"
            for camera in peer.cameras:
                # A robot that encodes as it is asked to makes what the operator's path carries.
                fits = camera.stream.encodings.follows and peer.tier == "operator"
                camera.stream.passthrough.hold_back(camera.target, held_back and not fits)
        if self._ticks % OBSERVER_TICKS == 0:
            for peer in leaders:
                self._tell(peer)
            _protect_sound(leaders or observers, now)
            self._measure(leaders, observers)

    def planned_bps(self, stream: VideoStream) -> int:
        """Return the bits per second of a camera that the operators' paths carry; all without an operator."""
        plan = self._plans.of(stream, "operator") if self.leaders() else stream.encodings.full
        return plan.bitrate_bps

    def operator_limited(self) -> bool:
        """Return whether an operator's path has shown a limit within the last minute."""
        return any(peer.path.limited for peer in self.leaders())

    def _choose_tiers(self, observers: list[PeerQuality], turn: list[PeerQuality], now: float) -> None:
        """Evaluate the paths of the observers in `turn`. A former operator without a limit is on trial in full."""
        for peer in observers:
            if peer.tier == "operator":  # it drove until now
                needed = self._plans.needed_bps(peer, now)
                if not peer.path.limited:
                    peer.path.assume(needed, now)
                peer.tier = peer.choice.decide(peer.path, needed, now)
        for peer in turn:
            peer.decide(now)
            needed = self._plans.needed_bps(peer, now)
            peer.tier = "low" if peer.stays_low else peer.choice.decide(peer.path, needed, now)

    def _plan_crowd(self, observers: list[PeerQuality], now: float) -> None:
        """Count the crowd and, if there is one, plan its pictures."""
        if (load := self._load.measure(now)) is not None:
            self._crowd.loaded(load, now)
        members = [peer for peer in observers if peer.in_crowd]
        if self._crowd.watch(len(members), now) > 1:
            self._plans.apply(cameras_of(members), "crowd")

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

    def _plan_operator(self, leaders: list[PeerQuality], now: float) -> None:
        if not leaders:
            self._whole_since = None
            return
        tightest = min(leaders, key=lambda peer: peer.path.rate)
        streams = cameras_of(leaders)
        self._plans.plan("operator", streams, tightest.path.rate, now)
        limited = any(peer.path.limited for peer in leaders)
        pause = max(peer.path.paused_until for peer in leaders)
        for stream in streams:
            for encoding in stream.encodings.own.of_tier("operator"):
                encoding.paused_until = pause
                encoding.keyframes.sparing = limited
        whole = not limited and all(
            (plan := self._plans.of(stream, "operator")).scale == 1.0 and plan.frame_rate >= stream.frame_rate
            for stream in streams
        )
        if not whole:
            self._whole_since = None
        elif self._whole_since is None:
            self._whole_since = now

    def _settle(self, peer: PeerQuality, tier: Tier, encoded_as: PictureTier) -> None:
        peer.tier = tier
        if peer.move_pictures(encoded_as):
            self._plans.apply(cameras_of([peer]), encoded_as)

    def _tell(self, peer: PeerQuality) -> None:
        streams, thinned = [], False
        for camera in peer.cameras:
            plan = self._plans.of(camera.stream, peer.encoded_as)
            width, height = plan.size(*camera.stream.size)
            rate, bps = plan.frame_rate, float(plan.bitrate_bps)
            if (passed := camera.stream.passthrough.measured(camera.target)) is not None:  # as the camera made it
                (width, height), (rate, bps) = camera.stream.size, passed
            else:
                thinned |= self._plans.is_thinned(peer)
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

    def _measure(self, leaders: list[PeerQuality], observers: list[PeerQuality]) -> None:
        tiers: dict[PictureTier, list[PeerQuality]] = {
            "operator": leaders,
            "high": [peer for peer in observers if peer.tier == "high" and peer.encoded_as != "crowd"],
            "crowd": [peer for peer in observers if peer.encoded_as == "crowd"],
            "low": [peer for peer in observers if peer.tier == "low"],
        }
        for tier, peers in tiers.items():
            self._metrics.paths(tier, peers)
            for stream in cameras_of(peers):
                self._metrics.plan(stream.name, tier, self._plans.of(stream, tier), stream.size)


def _protect_sound(peers: list[PeerQuality], now: float) -> None:
    """Protect sound, encoded once for all, against the operator's loss, or the worst observer's without one."""
    losses: dict[AudioStream, float] = {}
    for peer in peers:
        for sound in peer.sounds:
            losses[sound.stream] = max(losses.get(sound.stream, 0.0), peer.loss or 0.0)
    for stream, loss in losses.items():
        stream.expected_loss.update(loss, now)

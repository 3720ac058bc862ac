"""All peers that get streams of one media hub: each gets its subscriptions here, and leaves them here."""

import asyncio
from collections.abc import Callable

from lockstep.protocol.console import StreamInfo
from lockstep.rtc.endpoint import Connection, Turns
from lockstep.server.media.codecs.codec_choice import h264_profile
from lockstep.server.media.encoding.frame_queue import FrameQueue
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.picture_traces import PictureTraces
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.rtp_sender import RtpSender
from lockstep.server.media.pipeline.stream import AudioStream, VideoStream
from lockstep.server.media.planning import MediaPlan, PlannedStream
from lockstep.server.media.quality.path.bandwidth_estimator import RateLimits
from lockstep.server.media.quality.peer_quality import CameraDelivery, PeerQuality, SoundDelivery
from lockstep.server.media.quality.quality_controller import QualityController
from lockstep.server.media.sending_priority import SendingPriority
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.subscription import Subscription
from lockstep.server.media.subscriptions import Delivery, Subscriptions
from lockstep.server.webrtc.datagram_queue import DriverQueue

__all__ = ["Subscribers"]

REPORTED = 50  # peers that get a sender report in a second


class Subscribers:
    """Makes the subscriptions of peers and relays, and has their quality controlled."""

    def __init__(
        self,
        settings: MediaSettings,
        metrics: MediaMetrics,
        fan_out: FanOut,
        quality: QualityController,
        wall_clock: Callable[[], float],
    ) -> None:
        self._settings = settings
        self._metrics = metrics
        self._fan_out = fan_out
        self._quality = quality
        self._wall_clock = wall_clock
        self._peers: dict[Subscriptions, None] = {}  # an ordered set

    def attach(
        self, connection: Connection, plan: MediaPlan, *, priority: bool, turns: Turns | None = None
    ) -> Subscriptions:
        """Give a peer its planned streams, once `connection` has answered with the plan's media.

        `priority` is for the operator: served first and at once. `turns`: the queue in which its datagrams wait.
        """
        peer = self._create(connection, plan, priority=priority, turns=turns)
        peer.voice = plan.voice
        if plan.thumbnail and self._settings.quality:
            peer.quality.stay_low()
        return self._joined(peer)

    def publish(self, connection: Connection, plan: MediaPlan) -> Subscriptions:
        """Give a relay its planned streams, once `connection` is up. Call it with the offer."""
        peer = self._create(connection, plan, priority=False)
        peer.quality.relays = True
        return self._joined(peer)

    def end_all(self) -> None:
        """End what all peers get, because another epoch has begun, which has other streams."""
        for peer in list(self._peers):
            peer.leave()
            peer.ending.end()

    def _create(
        self, connection: Connection, plan: MediaPlan, *, priority: bool, turns: Turns | None = None
    ) -> Subscriptions:
        deliveries: list[Delivery] = []
        quality = self._quality_of(sum(each.stream.kind == "video" for each in plan.streams), priority)
        peer = Subscriptions(
            deliveries,
            quality,
            SendingPriority(connection, quality, turns if isinstance(turns, DriverQueue) else None),
            on_close=self._detached,
            on_connected=self._quality.tick if self._settings.quality else lambda: None,
            on_paced=self._fan_out.serve_again,
        )
        deliveries += [self._delivery(connection, peer, each, priority) for each in plan.streams]
        peer.traces = PictureTraces([each.target.traced for each in deliveries if each.info.kind == "video"])
        if self._settings.quality:
            peer.quality.pace = connection.peer.share.path_budget.limit
        return peer

    def _quality_of(self, cameras: int, priority: bool) -> PeerQuality:
        settings = self._settings
        maximum = float(max(1, cameras) * settings.video_bitrate_bps)
        start = min(maximum, settings.quality_start_bps) if priority else maximum
        limits = RateLimits(min(settings.quality_min_bps, start), start, maximum)
        one_tier = priority or not settings.quality
        return PeerQuality(operator=priority, limits=limits, tier="operator" if one_tier else "high")

    def _delivery(
        self, connection: Connection, peer: Subscriptions, planned: PlannedStream, priority: bool
    ) -> Delivery:
        mid, stream, codecs, carrier = planned
        codec = next(name for name in stream.encodings.codecs if name.lower() == codecs[0].name.lower())
        video, settings = stream.kind == "video", self._settings
        epoch = self._wall_clock() - asyncio.get_running_loop().time()
        target = Subscription(
            FrameQueue(settings.video_queue_frames if video else settings.audio_queue_frames, video=video),
            RtpSender(connection, mid, carrier, video=video, wall_clock=epoch),
            priority=priority,
            stream=stream.name,
            carrier=carrier,
            metrics=self._metrics,
            on_dropped=lambda: stream.encodings.request_keyframe(target, "drop"),
            on_failed=lambda error: peer.failed("media", error),
        )
        target.h264 = h264_profile(codecs[0])
        info = StreamInfo(
            mid=mid, stream=stream.name, label=stream.label, kind=stream.kind, codec=codec, carrier=carrier
        )
        return Delivery(info, stream, target)

    def _joined(self, peer: Subscriptions) -> Subscriptions:
        self._peers[peer] = None
        for each in peer.deliveries:
            if isinstance(each.stream, VideoStream):
                peer.quality.cameras.append(CameraDelivery(each.stream, each.info.codec, each.target))
            elif isinstance(each.stream, AudioStream):
                peer.quality.sounds.append(SoundDelivery(each.stream, each.info.codec, each.target))
        if peer.deliveries:
            self._quality.join(peer.quality)
        self._spread_reports()
        return peer

    def _detached(self, peer: Subscriptions) -> None:
        self._peers.pop(peer, None)
        self._quality.leave(peer.quality)
        self._spread_reports()

    def _spread_reports(self) -> None:
        """Send reports more rarely to a crowd (RFC 3550 6.2)."""
        for peer in self._peers:
            peer.priority.report_every(float(max(1, -(-len(self._peers) // REPORTED))))

"""The media hub: the streams of one robot, encoded once and sent to every peer."""

import asyncio
import re
import time
from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

from prometheus_client import CollectorRegistry

from lockstep.protocol.carriers import PLAYOUT_DELAY_URI, Carrier
from lockstep.protocol.console import StreamInfo, StreamOffer
from lockstep.protocol.description import Camera, Microphone, RobotDescription
from lockstep.protocol.messages import Media
from lockstep.rtc.endpoint import Connection, Turns
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.sdp import MID_URI, Codec, LocalMedia, MediaSection, SessionDescription
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.media.codecs.codec_choice import OPUS, chosen_codecs, h264_profile, known_codecs, offered_codecs
from lockstep.server.media.codecs.extensions import choose_carrier, wanted_uris
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.audio_stream import AudioStream
from lockstep.server.media.pipeline.capture_clock import CaptureClock
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.frame_queue import Outbox
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker, RecordedEncoding
from lockstep.server.media.pipeline.rtp_sender import RtpSender
from lockstep.server.media.pipeline.video_stream import VideoStream
from lockstep.server.media.quality.bandwidth_estimator import RateLimits
from lockstep.server.media.quality.metrics import QualityMetrics
from lockstep.server.media.quality.peer_quality import CameraLink, PeerQuality, SoundLink
from lockstep.server.media.quality.quality_controller import QualityController
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.subscription import Subscription
from lockstep.server.media.subscriptions import Delivery, Subscriptions
from lockstep.server.util.cooperative_scheduler import turns_of_loop
from lockstep.server.webrtc.datagram_queue import DatagramQueue, DriverQueue

__all__ = ["MediaPlan", "MediaHub", "MediaSettings", "Subscriptions"]

NOT_DRIVING_RATE = 1000.0  # Hz, datagrams of all peers that may drive but do not, before theirs wait as observers' do
REPORTED = 50  # peers that get a sender report in a second
MAX_LINK_TIME = 1e9  # s; no monotonic clock gets there, and NaN is not below it

AnyStream = VideoStream | AudioStream


class PlannedStream(NamedTuple):
    """One stream in a section of an answer, or of an offer to a relay."""

    mid: str
    stream: AnyStream
    codecs: tuple[Codec, ...]  # the one to send, and its repair codec if there is one
    carrier: Carrier


class MediaPlan(NamedTuple):
    """The media planned for a peer before its offer is answered."""

    media: dict[str, LocalMedia]  # by mid
    streams: list[PlannedStream]
    voice: str = ""  # mid of the section that receives the peer's own sound; "" without one
    thumbnail: bool = False


class MediaHub:
    """Encodes each stream once per codec and sends it to every attached peer.

    Create it and call everything on one event loop. `close` ends all tasks and threads.
    """

    def __init__(
        self,
        settings: MediaSettings,
        metrics_registry: CollectorRegistry,
        attached: Sequence[SourceSpec] = (),
        *,
        wall_clock: Callable[[], float] = time.time,
        on_fault: Callable[[str, Exception], None] | None = None,
    ) -> None:
        """`attached`: cameras and microphones attached to the console; their streams come after the robot's.

        `on_fault` gets the name and the exception of a service for all peers that failed; the service goes on.
        """
        self._settings = settings
        self._attached = {spec.name: spec for spec in attached}
        self._stream_names: dict[str, str] = {}  # of attached sources, by the source's name
        self._metrics = MediaMetrics(metrics_registry)
        self._wall_clock = wall_clock
        self._capture_clock = CaptureClock()
        self._loop_turns = turns_of_loop()
        self._fan_out = FanOut(self._loop_turns)
        self._turns = DatagramQueue(self._loop_turns)
        self._not_driving = TokenBucket(NOT_DRIVING_RATE, NOT_DRIVING_RATE)
        self._quality = QualityController(
            settings,
            QualityMetrics(metrics_registry),
            busy_seconds=lambda: self._loop_turns.busy_seconds,
            on_fault=None if on_fault is None else lambda error: on_fault("quality", error),
        )
        self._streams: dict[str, AnyStream] = {}
        self._peers: dict[Subscriptions, None] = {}  # an ordered set
        self._stream_tasks: list[asyncio.Task[None]] = []
        self._service_tasks: list[asyncio.Task[None]] = []
        self._ending: set[asyncio.Task[None]] = set()
        self._closed = False
        self._recorder: FrameTaker | None = None
        self._record_keyframes = 0.0  # s between keyframes while something is recorded

    def configure(self, description: RobotDescription) -> None:
        """Create the streams of a robot; once per epoch. Peers that are still attached get nothing more."""
        self._end_streams()
        settings, fan_out, metrics = self._settings, self._fan_out, self._metrics
        self._capture_clock = CaptureClock()
        self._streams = {camera.name: VideoStream(camera, settings, fan_out, metrics) for camera in description.cameras}
        for microphone in description.microphones:
            self._streams[microphone.name] = AudioStream(microphone, settings, fan_out, metrics)
        for spec in self._attached.values():
            name = self._stream_names[spec.name] = _free_name(spec.name, self._streams)
            self._streams[name] = self._attached_stream(spec, name)
        self._record_streams()
        loop = asyncio.get_running_loop()
        self._stream_tasks = [loop.create_task(stream.run()) for stream in self._streams.values()]
        if not self._service_tasks:
            self._service_tasks = [loop.create_task(self._quality.run())]

    def feed(self, media: Media, now: float) -> None:
        """Take a picture or sound from the robot link. Called on the loop, never blocks; the newest wins.

        `now` is on a monotonic clock, the same for all calls.
        """
        stream = self._streams.get(media.stream)
        if stream is None:
            self._metrics.dropped.labels("", "unknown_stream").inc()
            return
        if not 0 <= media.time <= MAX_LINK_TIME:
            self._metrics.dropped.labels(stream.name, "bad_time").inc()
            return
        self._capture_clock.observe(media.time, self._wall_clock())
        stream.feed(media, now, self._capture_clock.wall_time(media.time))

    def record(self, take: FrameTaker | None, keyframe_seconds: float = 4.0) -> None:
        """Hand the encoded frames of every stream to `take` from now on, across epochs; None stops it."""
        self._recorder, self._record_keyframes = take, keyframe_seconds
        self._record_streams()

    def _record_streams(self) -> None:
        attached = set(self._stream_names.values())
        for stream in self._streams.values():
            video = stream.kind == "video"
            stream.record(
                None
                if self._recorder is None
                else RecordedEncoding(
                    _recorded_codecs(stream),
                    "high" if video else "operator",
                    self._recorder,
                    keyframe_seconds=self._record_keyframes,
                    attached=stream.name in attached,
                    sound=not video,
                )
            )

    def record_keyframes(self) -> None:
        """Request a keyframe of every camera, because a new file begins."""
        for stream in self._streams.values():
            stream.record_keyframe()

    def recorded_codecs(self) -> dict[str, str]:
        """Return each stream's recording codec while nobody takes another, by stream name: "H264", "opus" or "PCMU"."""
        return {each.name: _recorded_codecs(each)[0] for each in self._streams.values()}

    def _attached_stream(self, spec: SourceSpec, name: str) -> AnyStream:
        """Create the stream of an attached source, whose real format shows with its first media."""
        settings, fan_out, metrics = self._settings, self._fan_out, self._metrics
        if spec.kind == "audio":
            return AudioStream(Microphone(name=name, label=spec.label, sample_rate=48_000), settings, fan_out, metrics)
        width, height = spec.size or (640, 480)
        camera = Camera(name=name, label=spec.label, width=width, height=height, frame_rate=spec.rate or 30.0)
        return VideoStream(camera, settings, fan_out, metrics)

    def stream_of(self, source: str) -> str:
        """Return the stream name of an attached source: its own name, or a similar one if the robot has that."""
        return self._stream_names.get(source, source)

    def feed_local(self, media: Media, now: float) -> None:
        """As `feed`, for a medium captured by this machine, whose time is on the clock of `now`."""
        stream = self._streams.get(media.stream)
        if stream is not None:
            stream.feed(media, now, self._wall_clock() - (now - media.time))

    @property
    def offers(self) -> list[StreamOffer]:
        """The streams that a peer can ask for, in the order of an offer's sections of their kind."""
        return [StreamOffer(stream=each.name, label=each.label, kind=each.kind) for each in self._streams.values()]

    def plan(
        self, offer: SessionDescription, *, trailer: bool, thumbnail: bool = False, voice: bool = False
    ) -> MediaPlan:
        """Plan the media that answer an offer.

        The i-th video section gets the i-th camera, the i-th audio section the i-th microphone; sections without
        one, or without a codec that it has, are answered inactive. `trailer` asks for the trailer carrier; otherwise
        the offer's header extensions decide. `thumbnail`: the first camera alone, in the lowest tier. `voice`: the
        first audio section in which the peer would only send receives its own sound.
        """
        sources: dict[str, Iterator[AnyStream]] = {
            kind: iter([stream for stream in self._streams.values() if stream.kind == kind][: 1 if thumbnail else None])
            for kind in (("video",) if thumbnail else ("video", "audio"))
        }
        plan = MediaPlan({}, [], thumbnail=thumbnail)
        for section in offer.sections:
            if not section.is_media:
                continue
            if section.direction == "sendonly":
                if voice and not plan.voice and chosen_codecs(section, (OPUS.name,)):
                    plan = plan._replace(voice=section.mid)
                    plan.media[section.mid] = LocalMedia((OPUS,), "recvonly", (MID_URI,))
                else:
                    plan.media[section.mid] = _inactive(section)
                continue
            planned = self._planned(section, next(sources.get(section.kind, iter(())), None), trailer)
            plan.media[section.mid] = _inactive(section) if planned is None else _sent(planned)
            plan.streams.extend([] if planned is None else [planned])
        return plan

    def _planned(self, section: MediaSection, stream: AnyStream | None, trailer: bool) -> PlannedStream | None:
        if stream is None or section.direction not in ("recvonly", "sendrecv"):
            return None
        codecs = chosen_codecs(section, stream.codecs, h264_first=self._gives_h264(stream))
        if not codecs:
            return None
        carrier = choose_carrier({each.uri for each in section.extensions}, trailer)
        return PlannedStream(section.mid, stream, codecs, carrier)

    def attach(
        self, connection: Connection, plan: MediaPlan, *, priority: bool, turns: Turns | None = None
    ) -> Subscriptions:
        """Give a peer its planned streams, once `connection` has answered with the plan's media.

        `priority` is for the operator: served first and at once. `turns`: the queue in which its datagrams wait.
        """
        cameras = sum(each.stream.kind == "video" for each in plan.streams)
        peer = self._peer_of(connection, plan, self._quality_of(cameras, priority), priority=priority, turns=turns)
        peer.voice = plan.voice
        if plan.thumbnail and self._settings.quality:
            peer.quality.stay_low()
        return self._joined(peer)

    def plan_publication(self, camera_codec: str = "") -> tuple[MediaPlan, list[OfferedMedia]]:
        """Plan every stream for a relay, each in one codec and with trailers; return the plan and the media to offer.

        `camera_codec`: "" selects a codec that is already encoded for somebody, so that it costs no encoder.
        """
        plan, offered = MediaPlan({}, []), []
        for number, stream in enumerate(self._streams.values()):
            name = stream.codec_in_use(camera_codec if stream.kind == "video" else "")
            planned = PlannedStream(str(number), stream, offered_codecs(stream.kind, name), "trailer")
            plan.streams.append(planned)
            # A relay forwards playout-delay, so that browsers show pictures at once.
            uris = (MID_URI, PLAYOUT_DELAY_URI) if stream.kind == "video" else (MID_URI,)
            offered.append(OfferedMedia(planned.mid, stream.kind, replace(_sent(planned), extensions=uris)))
        return plan, offered

    def publish(self, connection: Connection, plan: MediaPlan) -> Subscriptions:
        """Give a relay its planned streams, once `connection` is up. Call it with the offer."""
        cameras = sum(each.stream.kind == "video" for each in plan.streams)
        peer = self._peer_of(connection, plan, self._quality_of(cameras, priority=False), priority=False)
        peer.quality.relays = True
        return self._joined(peer)

    def _peer_of(
        self,
        connection: Connection,
        plan: MediaPlan,
        quality: PeerQuality,
        *,
        priority: bool,
        turns: Turns | None = None,
    ) -> Subscriptions:
        deliveries: list[Delivery] = []
        peer = Subscriptions(
            connection,
            deliveries,
            quality,
            on_close=self._detached,
            on_connected=self._quality.tick if self._settings.quality else lambda: None,
            on_paced=self._fan_out.serve_again,
            turns=turns if isinstance(turns, DriverQueue) else None,
        )
        deliveries += [self._delivery(connection, peer, each, priority) for each in plan.streams]
        if self._settings.quality:
            quality.pace = connection.peer.pace
        return peer

    def _joined(self, peer: Subscriptions) -> Subscriptions:
        deliveries = peer.deliveries
        self._peers[peer] = None
        peer.quality.cameras = [
            CameraLink(each.stream, each.info.codec, each.target, each.sender)
            for each in deliveries
            if isinstance(each.stream, VideoStream)
        ]
        peer.quality.sounds = [
            SoundLink(each.stream, each.info.codec, each.target)
            for each in deliveries
            if isinstance(each.stream, AudioStream)
        ]
        if peer.quality.cameras or peer.quality.sounds:
            self._quality.join(peer.quality)
        self._spread_reports()
        return peer

    def _spread_reports(self) -> None:
        """Send reports more rarely to a crowd (RFC 3550 6.2)."""
        for peer in self._peers:
            peer.report_every(float(max(1, -(-len(self._peers) // REPORTED))))

    def _gives_h264(self, stream: AnyStream) -> bool:
        """True if the camera itself may encode H.264, as far as is known now; its peers should then take that codec."""
        if not isinstance(stream, VideoStream):
            return False
        if stream.gives is not None:
            return stream.gives == "h264"
        attached = {self._stream_names[spec.name]: spec for spec in self._attached.values()}
        spec = attached.get(stream.name)
        return spec is not None and spec.passing and spec.size is None

    @property
    def turns(self) -> DatagramQueue:
        """The queue of observers' datagrams, which publishers' datagrams share."""
        return self._turns

    def turns_of(self, *, waits: bool) -> DatagramQueue | DriverQueue:
        """Return the datagram queue for a new peer.

        `waits`: its datagrams wait in observers' turns; otherwise only those above the rate do, unless it drives.
        """
        return self._turns if waits else DriverQueue(self._turns, self._may_go_at_once)

    def _may_go_at_once(self) -> bool:
        """True if one more datagram of the peers that may drive but do not is handled before all waiting ones."""
        return self._not_driving.take(time.monotonic())

    def _quality_of(self, cameras: int, priority: bool) -> PeerQuality:
        settings = self._settings
        maximum = float(max(1, cameras) * settings.video_bitrate_bps)
        start = min(maximum, settings.quality_start_bps) if priority else maximum
        limits = RateLimits(min(settings.quality_min_bps, start), start, maximum)
        one_tier = priority or not settings.quality
        return PeerQuality(operator=priority, limits=limits, tier="operator" if one_tier else "high")

    def _detached(self, peer: Subscriptions) -> None:
        self._peers.pop(peer, None)
        self._quality.leave(peer.quality)
        self._spread_reports()

    def _delivery(
        self, connection: Connection, peer: Subscriptions, planned: PlannedStream, priority: bool
    ) -> Delivery:
        mid, stream, codecs, carrier = planned
        codec = next(name for name in stream.codecs if name.lower() == codecs[0].name.lower())
        target = self._target(peer, stream, codec, carrier, priority)
        target.h264 = h264_profile(codecs[0])
        epoch = self._wall_clock() - asyncio.get_running_loop().time()
        sender = RtpSender(connection, mid, carrier, video=stream.kind == "video", wall_clock=epoch)
        return Delivery(_info(stream, mid, codec, carrier), stream, target, sender)

    def _target(
        self, peer: Subscriptions, stream: AnyStream, codec: str, carrier: Carrier, priority: bool
    ) -> Subscription:
        video = stream.kind == "video"
        target = Subscription(
            Outbox(self._settings.video_queue_frames if video else self._settings.audio_queue_frames, video=video),
            priority=priority,
            stream=stream.name,
            carrier=carrier,
            metrics=self._metrics,
            on_dropped=lambda: stream.request_keyframe(codec, target, "drop"),
            on_failed=lambda error: peer.failed("media", error),
        )
        return target

    def _end_streams(self) -> None:
        for peer in list(self._peers):
            peer.detach()
        for task in self._stream_tasks:
            task.cancel()
            self._ending.add(task)
            task.add_done_callback(self._ending.discard)
        self._stream_tasks = []
        self._streams = {}

    async def close(self) -> None:
        """Stop all streams and workers; peers get nothing more. Idempotent."""
        if self._closed:
            return
        self._closed = True
        self._end_streams()
        for task in self._service_tasks:
            task.cancel()
        await asyncio.gather(*self._ending, *self._service_tasks, return_exceptions=True)


def _inactive(section: MediaSection) -> LocalMedia:
    return LocalMedia(known_codecs(section.kind), "inactive")


def _sent(planned: PlannedStream) -> LocalMedia:
    name = _msid(planned.stream.name)
    uris = wanted_uris(planned.stream.kind, planned.carrier)
    return LocalMedia(planned.codecs, "sendonly", uris, msid=f"{name} {name}")


def _info(stream: AnyStream, mid: str, codec: str, carrier: Carrier) -> StreamInfo:
    return StreamInfo(mid=mid, stream=stream.name, label=stream.label, kind=stream.kind, codec=codec, carrier=carrier)


def _msid(name: str) -> str:
    """`name` as a media stream id: only the characters of RFC 8830 2 (token-char), at most 64."""
    return re.sub(r"[^0-9A-Za-z!#$%&'*+.^_`{|}~-]", "_", name)[:64] or "_"


def _recorded_codecs(stream: AnyStream) -> tuple[str, ...]:
    """Return the codecs that a recording may have, the best first."""
    return tuple(sorted(stream.codecs, key=lambda codec: codec not in ("H264", "opus")))


def _free_name(wanted: str, taken: Container[str]) -> str:
    return next(name for n in count(1) if (name := wanted if n == 1 else f"{wanted}-{n}") not in taken)

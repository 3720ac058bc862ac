"""The media plane: the streams of one robot, encoded once and sent to every peer."""

import asyncio
import re
import time
from collections.abc import Callable, Container, Iterator, Sequence
from itertools import count

from aiortc import RTCPeerConnection, RTCRtpTransceiver
from prometheus_client import CollectorRegistry

from robot_bridge.protocol.carriers import Carrier
from robot_bridge.protocol.console import StreamInfo, StreamOffer
from robot_bridge.protocol.description import Camera, Microphone, RobotDescription
from robot_bridge.protocol.messages import Media
from server.loop_turns import turns_of_loop
from server.media.aiortc_private import (
    MediaSender,
    install_sender,
    keep_extensions,
    offered_direction,
    offered_extensions,
)
from server.media.audio_stream import AudioStream
from server.media.capture_clock import CaptureClock
from server.media.codec_choice_private import keep_codec, negotiated_h264
from server.media.fanout import FanOut
from server.media.header_extensions import choose_carrier, wanted_uris
from server.media.metrics import MediaMetrics
from server.media.outbox import Outbox
from server.media.peer_media import Delivery, PeerMedia
from server.media.peer_stream import PeerStream
from server.media.publishing_private import offer_section
from server.media.quality.desk import QualityDesk
from server.media.quality.metrics import QualityMetrics
from server.media.quality.path import RateLimits
from server.media.quality.peer_quality import CameraLink, PeerQuality, SoundLink
from server.media.receive_guard_private import guard_transports
from server.media.receive_turns import ReceiveTurns
from server.media.recorded_output import FrameTaker, RecordedOutput
from server.media.sender_reports import SenderReports
from server.media.settings import MediaSettings
from server.media.sources.source_url import SourceSpec
from server.media.video_stream import VideoStream
from server.media.voice_private import VoicePacket, take_voice
from server.token_bucket import TokenBucket

__all__ = ["MediaPlane", "MediaSettings", "PeerMedia"]

NOT_DRIVING_RATE = 1000.0  # Hz, datagrams of all together who may drive and do not, before they wait as observers' do
MAX_LINK_TIME = 1e9  # s; no monotonic clock gets there, and NaN is not below it

AnyStream = VideoStream | AudioStream


class MediaPlane:
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
        """`attached`: cameras and microphones of the console's own; their streams come after the robot's.

        `on_fault` hears where something that serves all peers failed, and what was raised; it goes on.
        """
        self._settings = settings
        self._attached = {spec.name: spec for spec in attached}
        self._stream_names: dict[str, str] = {}  # of those, by the source's name
        self._metrics = MediaMetrics(metrics_registry)
        self._wall_clock = wall_clock
        self._capture_clock = CaptureClock()
        self._loop_turns = turns_of_loop()
        self._fan_out = FanOut(self._loop_turns)
        self._turns = ReceiveTurns(self._loop_turns)
        self._not_driving = TokenBucket(NOT_DRIVING_RATE, NOT_DRIVING_RATE, time.monotonic())
        self._quality = QualityDesk(
            settings,
            QualityMetrics(metrics_registry),
            busy_seconds=lambda: self._loop_turns.busy_seconds,
            on_fault=None if on_fault is None else lambda error: on_fault("quality", error),
        )
        self._streams: dict[str, AnyStream] = {}
        self._peers: dict[PeerMedia, None] = {}  # an ordered set
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
            reports = SenderReports(lambda: list(self._peers))
            services = (fan_out.run_paced(), reports.run(), self._quality.run())
            self._service_tasks = [loop.create_task(service) for service in services]

    def feed(self, media: Media, now: float) -> None:
        """Take a picture or sound from the robot link. Called on the loop, never blocks; newest wins.

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
        """Hand every stream, encoded, to `take` from now on; None: no more. Over epochs too."""
        self._recorder, self._record_keyframes = take, keyframe_seconds
        self._record_streams()

    def _record_streams(self) -> None:
        attached = set(self._stream_names.values())
        for stream in self._streams.values():
            video = stream.kind == "video"
            stream.record(
                None
                if self._recorder is None
                else RecordedOutput(
                    _recorded_codecs(stream),
                    "high" if video else "operator",
                    self._recorder,
                    keyframe_seconds=self._record_keyframes,
                    attached=stream.name in attached,
                    sound=not video,
                )
            )

    def record_keyframes(self) -> None:
        """A new file begins: every camera starts with a keyframe."""
        for stream in self._streams.values():
            stream.record_keyframe()

    def recorded_codecs(self) -> dict[str, str]:
        """What each stream is recorded as where nobody takes another codec, by its name: "H264", "opus" or "PCMU"."""
        return {each.name: _recorded_codecs(each)[0] for each in self._streams.values()}

    def _attached_stream(self, spec: SourceSpec, name: str) -> AnyStream:
        """What the source really gives shows when it comes."""
        settings, fan_out, metrics = self._settings, self._fan_out, self._metrics
        if spec.kind == "audio":
            return AudioStream(Microphone(name=name, label=spec.label, sample_rate=48_000), settings, fan_out, metrics)
        width, height = spec.size or (640, 480)
        camera = Camera(name=name, label=spec.label, width=width, height=height, frame_rate=spec.rate or 30.0)
        return VideoStream(camera, settings, fan_out, metrics)

    def stream_of(self, source: str) -> str:
        """The stream of an attached source: its name, or one like it when the robot has a stream of that name."""
        return self._stream_names.get(source, source)

    def feed_local(self, media: Media, now: float) -> None:
        """As `feed`, for what was captured here: its time is on the clock of `now`."""
        stream = self._streams.get(media.stream)
        if stream is not None:
            stream.feed(media, now, self._wall_clock() - (now - media.time))

    @property
    def offers(self) -> list[StreamOffer]:
        """The streams that a peer can ask for, in the order of an offer's sections of their kind."""
        return [StreamOffer(stream=each.name, label=each.label, kind=each.kind) for each in self._streams.values()]

    def attach(
        self,
        pc: RTCPeerConnection,
        offer_sdp: str,
        *,
        priority: bool,
        waits: bool = False,
        trailer: bool,
        thumbnail: bool = False,
        voice: Callable[[VoicePacket], None] | None = None,
    ) -> PeerMedia:
        """Give a peer its streams. Call after setRemoteDescription(offer), before createAnswer.

        The i-th video section gets the i-th camera, the i-th audio section the i-th microphone; sections without
        one, or without a codec in common, are answered inactive. `priority` is for the operator: served first and at
        once. `waits`: its datagrams take observers' turns; without it those do that are too many, unless it drives.
        `trailer` asks for the trailer carrier; otherwise the offer's header extensions decide. `thumbnail`: the first
        camera alone, in the lowest tier. `voice` takes the peer's own sound, from the first audio section in which it
        would only send.
        """
        extensions = offered_extensions(offer_sdp)
        sources: dict[str, Iterator[AnyStream]] = {
            kind: iter([stream for stream in self._streams.values() if stream.kind == kind][: 1 if thumbnail else None])
            for kind in (("video",) if thumbnail else ("video", "audio"))
        }
        deliveries: list[Delivery] = []
        peer = PeerMedia(deliveries, self._peer_quality(pc, priority), self._detached)
        self._guard(pc, None if waits else lambda: peer.quality.drives or self._may_go_at_once())
        if thumbnail and self._settings.quality:
            peer.quality.stay_low()
        for transceiver in pc.getTransceivers():
            if offered_direction(transceiver) == "recvonly":  # it would send
                transceiver.direction = "inactive"
                wanted = voice is not None and transceiver.kind == "audio" and not peer.voice
                if wanted and voice is not None and take_voice(transceiver, voice):
                    peer.voice = transceiver.mid or ""
                continue
            stream = next(sources.get(transceiver.kind, iter(())), None)
            codec = None
            if stream is not None and offered_direction(transceiver) in ("sendonly", "sendrecv"):
                codec = keep_codec(transceiver, stream.codecs, h264_first=self._gives_h264(stream))
            if stream is None or codec is None:
                transceiver.direction = "inactive"
                continue
            offered = extensions.get(transceiver.mid or "", {})
            carrier = choose_carrier(offered, trailer)
            ids = {uri: offered[uri] for uri in wanted_uris(stream.kind, carrier) if uri in offered}
            keep_extensions(transceiver, ids)
            transceiver.direction = "sendonly"
            deliveries.append(self._deliver(peer, transceiver, stream, codec, carrier, priority))
        return self._joined(peer, deliveries)

    def publish(self, pc: RTCPeerConnection, camera_codec: str = "") -> PeerMedia:
        """Offer every stream to a relay, each in one codec, with trailers. Call before createOffer.

        `camera_codec`: "" is what is being encoded already for somebody, so that it costs no encoder.
        """
        sections = [
            (stream, codec, offer_section(pc, stream.kind, codec))
            for stream in self._streams.values()
            for codec in [stream.codec_in_use(camera_codec if stream.kind == "video" else "")]
        ]
        self._guard(pc)
        deliveries: list[Delivery] = []
        peer = PeerMedia(deliveries, self._peer_quality(pc, priority=False), self._detached)
        peer.quality.relays = True
        for stream, codec, transceiver in sections:
            deliveries.append(self._deliver(peer, transceiver, stream, codec, "trailer", priority=False))
        return self._joined(peer, deliveries)

    def _joined(self, peer: PeerMedia, deliveries: list[Delivery]) -> PeerMedia:
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
        return peer

    def _gives_h264(self, stream: AnyStream) -> bool:
        """Whether the camera may encode by itself, as far as is known now; then its peers had better take that."""
        if not isinstance(stream, VideoStream):
            return False
        if stream.gives is not None:
            return stream.gives == "h264"
        attached = {self._stream_names[spec.name]: spec for spec in self._attached.values()}
        spec = attached.get(stream.name)
        return spec is not None and spec.passing and spec.size is None

    @property
    def turns(self) -> ReceiveTurns:
        """Those of observers, in which publishers have theirs too."""
        return self._turns

    def _guard(self, pc: RTCPeerConnection, at_once: Callable[[], bool] | None = None) -> None:
        """Without `at_once` everything that this peer sends waits for its turn."""
        on_socket = None if at_once is None else self._loop_turns.yield_to
        on_error = self._metrics.malformed.labels
        guard_transports(pc, lambda kind: on_error(kind).inc(), self._turns, on_socket, at_once)

    def _may_go_at_once(self) -> bool:
        """Whether one more datagram of those who may drive and do not is handled before all that waits."""
        return self._not_driving.take(time.monotonic())

    def _peer_quality(self, pc: RTCPeerConnection, priority: bool) -> PeerQuality:
        cameras = min(
            sum(transceiver.kind == "video" for transceiver in pc.getTransceivers()),
            sum(isinstance(stream, VideoStream) for stream in self._streams.values()),
        )
        settings = self._settings
        maximum = float(max(1, cameras) * settings.video_bitrate_bps)
        start = min(maximum, settings.quality_start_bps) if priority else maximum
        limits = RateLimits(min(settings.quality_min_bps, start), start, maximum)
        one_tier = priority or not settings.quality
        return PeerQuality(operator=priority, limits=limits, tier="operator" if one_tier else "high")

    def _detached(self, peer: PeerMedia) -> None:
        self._peers.pop(peer, None)
        self._quality.leave(peer.quality)

    def _deliver(
        self,
        peer: PeerMedia,
        transceiver: RTCRtpTransceiver,
        stream: AnyStream,
        codec: str,
        carrier: Carrier,
        priority: bool,
    ) -> Delivery:
        video = stream.kind == "video"
        quality = peer.quality
        target = PeerStream(
            Outbox(self._settings.video_queue_frames if video else self._settings.audio_queue_frames, video=video),
            priority=priority,
            stream=stream.name,
            carrier=carrier,
            metrics=self._metrics,
            on_dropped=lambda: stream.request_keyframe(codec, target, "drop"),
            on_failed=lambda error: peer.failed("media", error),
        )
        target.h264 = negotiated_h264(transceiver)

        def ready() -> None:
            target.sender = sender
            stream.join(codec, target, quality.encoded_as if video else quality.hears_as)
            if video and self._settings.quality:
                self._quality.tick()

        sender = MediaSender(
            transceiver,
            _msid(stream.name),
            trailer=carrier == "trailer",
            on_ready=ready,
            on_keyframe_request=lambda: stream.request_keyframe(codec, target, "pli"),
            on_stopped=peer.detach,
            on_failed=peer.failed,
            listener=quality,
            pacer=quality.pacer if video and self._settings.quality else None,
            on_paced=lambda: self._fan_out.pace(target),
        )
        install_sender(transceiver, sender)
        return Delivery(_info(stream, transceiver.mid or "", codec, carrier), stream, target, sender)

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


def _info(stream: AnyStream, mid: str, codec: str, carrier: Carrier) -> StreamInfo:
    return StreamInfo(mid=mid, stream=stream.name, label=stream.label, kind=stream.kind, codec=codec, carrier=carrier)


def _msid(name: str) -> str:
    """`name` as a media stream id: only the characters of RFC 8830 2 (token-char), at most 64."""
    return re.sub(r"[^0-9A-Za-z!#$%&'*+.^_`{|}~-]", "_", name)[:64] or "_"


def _recorded_codecs(stream: AnyStream) -> tuple[str, ...]:
    """The best first."""
    return tuple(sorted(stream.codecs, key=lambda codec: codec not in ("H264", "opus")))


def _free_name(wanted: str, taken: Container[str]) -> str:
    return next(name for n in count(1) if (name := wanted if n == 1 else f"{wanted}-{n}") not in taken)

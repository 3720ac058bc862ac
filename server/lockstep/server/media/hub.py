"""The media hub: the streams of one robot, encoded once and sent to every peer."""

import asyncio
import time
from collections.abc import Callable, Container, Sequence
from itertools import count

from prometheus_client import CollectorRegistry

from lockstep.protocol.console import StreamOffer
from lockstep.protocol.description import Camera, Microphone, RobotDescription
from lockstep.protocol.messages import Media
from lockstep.rtc.peer import OfferedMedia
from lockstep.rtc.sdp import SessionDescription
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.capture_clock import CaptureClock
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.recorded_encoding import FrameTaker
from lockstep.server.media.pipeline.stage import SourceFrame
from lockstep.server.media.pipeline.stream import Stream, StreamMaker
from lockstep.server.media.planning import MediaPlan, plan_answer, plan_publication
from lockstep.server.media.quality.metrics import QualityMetrics
from lockstep.server.media.quality.quality_controller import QualityController
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.subscribers import Subscribers
from lockstep.server.media.subscriptions import Subscriptions
from lockstep.server.media.uplink.robot_encoding import RobotEncoding
from lockstep.server.util.cooperative_scheduler import turns_of_loop
from lockstep.server.webrtc.datagram_queue import DatagramQueues

__all__ = ["MediaPlan", "MediaHub", "MediaSettings", "Subscriptions"]

MAX_LINK_TIME = 1e9  # s; no monotonic clock gets there, and NaN is not below it


class MediaHub:
    """Encodes each stream once per codec and sends it to every attached peer.

    Create it and call everything on one event loop. Await `run`.

    Attributes:
        subscribers: the peers that get the streams
        datagrams: the queues of all peers' datagrams
        robot_encoding: what is asked of a robot bridge that encodes
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
        turns = turns_of_loop()
        fan_out = FanOut(turns)
        self._attached = {spec.name: spec for spec in attached}
        self._stream_names: dict[str, str] = {}  # of attached sources, by the source's name
        self._metrics = MediaMetrics(metrics_registry)
        self._wall_clock = wall_clock
        self._capture_clock = CaptureClock()
        self._maker = StreamMaker(settings, fan_out, self._metrics)
        self._quality = QualityController(
            settings,
            QualityMetrics(metrics_registry),
            busy_seconds=lambda: turns.busy_seconds,
            on_fault=None if on_fault is None else lambda error: on_fault("quality", error),
        )
        self.subscribers = Subscribers(settings, self._metrics, fan_out, self._quality, wall_clock)
        self.datagrams = DatagramQueues(turns, time.monotonic)
        self.robot_encoding = RobotEncoding(
            settings,
            self._quality.planned_bps,
            self._metrics,
            operator_limited=self._quality.operator_limited,
        )
        self._streams: dict[str, Stream] = {}
        self._configured = asyncio.Event()  # set when there are other streams
        self._recorder: FrameTaker | None = None
        self._record_keyframes = 0.0  # s between keyframes while something is recorded

    async def run(self) -> None:
        """Encode the streams and control their quality, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._quality.run(), name="quality")
            tasks.create_task(self.robot_encoding.run(), name="robot encoding")
            while True:
                self._configured.clear()
                running = [
                    tasks.create_task(stream.worker.run(), name=f"stream {stream.name}")
                    for stream in self._streams.values()
                ]
                await self._configured.wait()
                for task in running:
                    task.cancel()

    def configure(self, description: RobotDescription) -> None:
        """Create the streams of a robot; once per epoch. Peers that are still attached get nothing more."""
        self.subscribers.end_all()
        for stream in self._streams.values():
            stream.recording.stop()  # what their encoders still finish belongs to the last epoch
        self._capture_clock = CaptureClock()
        self._streams = {camera.name: self._maker.video(camera) for camera in description.cameras}
        for microphone in description.microphones:
            self._streams[microphone.name] = self._maker.audio(microphone)
        self.robot_encoding.configure(self._streams.values())
        for spec in self._attached.values():
            name = self._stream_names[spec.name] = _free_name(spec.name, self._streams)
            self._streams[name] = self._attached_stream(spec, name)
        self.record(self._recorder, self._record_keyframes)
        self._configured.set()

    def _attached_stream(self, spec: SourceSpec, name: str) -> Stream:
        """Create the stream of an attached source, whose real format shows with its first media."""
        if spec.kind == "audio":
            return self._maker.audio(Microphone(name=name, label=spec.label, sample_rate=48_000), attached=True)
        width, height = spec.size or (640, 480)
        camera = Camera(name=name, label=spec.label, width=width, height=height, frame_rate=spec.rate or 30.0)
        return self._maker.video(camera, attached=True, expects_h264=spec.passing and spec.size is None)

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
        self.robot_encoding.arrived(media, now)
        self._capture_clock.observe(media.time, self._wall_clock())
        stream.first.source(SourceFrame(media, now, self._capture_clock.wall_time(media.time)))

    def feed_local(self, media: Media, now: float) -> None:
        """As `feed`, for a medium captured by this machine, whose time is on the clock of `now`."""
        stream = self._streams.get(media.stream)
        if stream is not None:
            stream.first.source(SourceFrame(media, now, self._wall_clock() - (now - media.time)))

    def record(self, take: FrameTaker | None, keyframe_seconds: float = 4.0) -> None:
        """Hand the encoded frames of every stream to `take` from now on, across epochs; None stops it."""
        self._recorder, self._record_keyframes = take, keyframe_seconds
        for stream in self._streams.values():
            if take is None:
                stream.recording.stop()
            else:
                stream.recording.record(take, keyframe_seconds)

    @property
    def is_recorded(self) -> bool:
        """True while frames are handed to a recorder."""
        return self._recorder is not None

    def record_keyframes(self, *, afresh: bool = True) -> None:
        """Request a keyframe of every recorded stream; `afresh`: see `RecordedEncoding.request_keyframe`."""
        for stream in self._streams.values():
            stream.recording.request_keyframe(afresh=afresh)

    def recorded_codecs(self) -> dict[str, str]:
        """Return each stream's recording codec while nobody takes another, by stream name: "H264", "opus" or "PCMU"."""
        return {each.name: each.recording.codecs[0] for each in self._streams.values()}

    def stream_of(self, source: str) -> str:
        """Return the stream name of an attached source: its own name, or a similar one if the robot has that."""
        return self._stream_names.get(source, source)

    @property
    def offers(self) -> list[StreamOffer]:
        """The streams that a peer can ask for, in the order of an offer's sections of their kind."""
        return [StreamOffer(stream=each.name, label=each.label, kind=each.kind) for each in self._streams.values()]

    def plan(
        self, offer: SessionDescription, *, trailer: bool, thumbnail: bool = False, voice: bool = False
    ) -> MediaPlan:
        """Plan the media that answer an offer; see `plan_answer`."""
        return plan_answer(list(self._streams.values()), offer, trailer=trailer, thumbnail=thumbnail, voice=voice)

    def plan_publication(self, camera_codec: str = "") -> tuple[MediaPlan, list[OfferedMedia]]:
        """Plan every stream for a relay; see `planning.plan_publication`."""
        return plan_publication(list(self._streams.values()), camera_codec)


def _free_name(wanted: str, taken: Container[str]) -> str:
    return next(name for n in count(1) if (name := wanted if n == 1 else f"{wanted}-{n}") not in taken)

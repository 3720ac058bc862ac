"""Asks a robot bridge that encodes for what the operator needs and the robot's uplink carries, ten times a second."""

import asyncio
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from lockstep.protocol.messages import EncodeRequest, Media, StreamRequest
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.stream import Stream, VideoStream
from lockstep.server.media.quality.adaptation import Adaptation
from lockstep.server.media.quality.budget import CameraNeed, share_out
from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.uplink.second_requests import SecondRequests
from lockstep.server.media.uplink.second_share import UplinkNow
from lockstep.server.media.uplink.uplink_estimator import UplinkEstimator

__all__ = ["RobotEncoding"]

TICK = 0.1  # s
SOUND_BPS = 80_000.0  # of a microphone's Opus, with the messages around it
REPEAT = 1.0  # s; the bridge of a link that came back knows nothing of what was asked before
STEP = 0.06  # of the bitrate, below which a change is not worth a message
UNWATCHED = EncodingTarget(50_000, 1.0)  # of a camera that nobody takes: enough to know that it gives pictures


@dataclass
class _Camera:
    stream: VideoStream
    adaptation: Adaptation = field(default_factory=Adaptation)
    asked: EncodingTarget | None = None  # in the newest message; None before the first
    keyframes: int = 0  # asked for so far


class RobotEncoding:
    """The requests of one media hub. Call everything on its loop, and await `run`."""

    def __init__(
        self,
        settings: MediaSettings,
        planned_bps: Callable[[VideoStream], int],
        metrics: MediaMetrics,
        clock: Callable[[], float] = time.monotonic,
        operator_limited: Callable[[], bool] = lambda: False,
    ) -> None:
        """The facts that the requests depend on.

        Args:
            planned_bps: bits per second of a camera that the operator's path carries
            operator_limited: whether that path has shown a limit
        """
        self._operator_limited = operator_limited
        self._settings = settings
        self._planned_bps = planned_bps
        self._metrics = metrics
        self._clock = clock
        self._ask: Callable[[EncodeRequest], bool] = lambda request: False
        self._cameras: list[_Camera] = []
        self._camera_names: frozenset[str] = frozenset()
        self._sounds = 0  # microphones
        self._second = SecondRequests(settings, ())
        self._uplink = self._new_uplink()
        self._told_at = float("-inf")

    def ask_by(self, ask: Callable[[EncodeRequest], bool]) -> None:
        """Set how the bridge is asked; `ask` returns False if it does not encode, or its link is down."""
        self._ask = ask

    def configure(self, streams: Iterable[Stream]) -> None:
        """Take the robot's streams; once per epoch."""
        given = list(streams)
        self._cameras = [_Camera(stream) for stream in given if isinstance(stream, VideoStream)]
        self._camera_names = frozenset(each.stream.name for each in self._cameras)
        self._sounds = len(given) - len(self._cameras)
        self._second = SecondRequests(self._settings, [each.stream for each in self._cameras])
        self._uplink = self._new_uplink()
        for camera in self._cameras:
            camera.stream.passthrough.keyframes.ask_by(self._keyframe_asker(camera))

    def arrived(self, media: Media, now: float) -> None:
        """Take the arrival of a robot's medium."""
        is_operators = media.stream in self._camera_names and not media.second
        self._uplink.arrived(media.time, now, len(media.payload), media.stream if is_operators else None)

    async def run(self) -> None:
        """Ask until cancelled."""
        while True:
            await asyncio.sleep(TICK)
            self.tick(self._clock())

    def tick(self, now: float) -> None:
        """Decide what to ask for, and ask if that has changed."""
        if not self._cameras:
            return
        self._uplink.decide(now)
        limited = self._uplink.limited(now)
        targets = self._targets(now)
        for camera in self._cameras:
            if camera.stream.encodings.passed is not None:
                # The operator pays for each, on both paths.
                camera.stream.encodings.passed.keyframes.sparing = limited or self._operator_limited()
            camera.stream.passthrough.keyframes.serve(now)
        changed = any(_differs(camera.asked, target) for camera, target in zip(self._cameras, targets, strict=True))
        sounds = self._sounds * SOUND_BPS
        changed |= self._second.tick(
            now,
            first_bps=float(sum(target.bitrate_bps for target in targets)),
            uplink=UplinkNow(
                shown_bps=self._uplink.shown(now) - sounds,
                carried_bps=self._uplink.carried() - sounds,
                waits=self._uplink.pictures_wait(now),
                limited_at=self._uplink.limited_at,
            ),
        )
        if changed or now - self._told_at >= REPEAT:
            for camera, target in zip(self._cameras, targets, strict=True):
                camera.asked = target
            self._tell(now)

    def _targets(self, now: float) -> list[EncodingTarget]:
        taken = [each for each in self._cameras if each.stream.is_wanted]
        needs = []
        for camera in taken:
            width, height = camera.stream.first_size
            pixels = width * height * camera.stream.frame_rate
            needs.append(CameraNeed(pixels, float(self._planned_bps(camera.stream))))
        total = max(0.0, self._uplink.rate - self._sounds * SOUND_BPS)
        shares = dict(zip(map(id, taken), share_out(total, needs), strict=True))
        targets = []
        for camera in self._cameras:
            share = shares.get(id(camera))
            if share is None:
                targets.append(UNWATCHED)
            else:
                stream = camera.stream
                targets.append(camera.adaptation.plan(share, stream.frame_rate, stream.first_size, now))
        return targets

    def _tell(self, now: float) -> None:
        self._told_at = now
        streams = [
            StreamRequest(
                stream=camera.stream.name,
                bitrate=target.bitrate_bps,
                frame_rate=self._frame_rate(camera.stream, target),
                scale=target.scale,
                keyframes=camera.keyframes,
            )
            for camera in self._cameras
            if (target := camera.asked) is not None
        ]
        follows = self._ask(EncodeRequest(streams=streams, second=self._second.requests()))
        self._metrics.uplink_rate.set(self._uplink.rate if follows else 0.0)
        self._metrics.second_rate.set(self._second.bps if follows else 0.0)
        self._metrics.uplink_wait.set((self._uplink.waits(now) or 0.0) if follows else 0.0)
        for camera in self._cameras:
            camera.stream.passthrough.keyframes.follow(follows, now)

    def _frame_rate(self, stream: VideoStream, target: EncodingTarget) -> float:
        """Return the rate to ask for; 0, all pictures, where nothing asks for fewer than the camera gives."""
        is_all = target.frame_rate >= stream.frame_rate and self._settings.video_frames_per_second is None
        return 0.0 if is_all else target.frame_rate

    def _keyframe_asker(self, camera: _Camera) -> Callable[[float], None]:
        def ask(now: float) -> None:
            camera.keyframes += 1
            self._tell(now)

        return ask

    def _new_uplink(self) -> UplinkEstimator:
        settings, cameras = self._settings, max(1, len(self._cameras))
        encodings = 2 if settings.second_encoding else 1
        most = float(encodings * cameras * settings.video_bitrate_bps)
        return UplinkEstimator(
            min(most, float(settings.quality_start_bps)), min(most, float(settings.quality_min_bps)), most
        )


def _differs(asked: EncodingTarget | None, target: EncodingTarget) -> bool:
    if asked is None or (asked.frame_rate, asked.scale) != (target.frame_rate, target.scale):
        return True
    return abs(target.bitrate_bps - asked.bitrate_bps) > STEP * asked.bitrate_bps

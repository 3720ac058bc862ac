"""Requests of second encodings from a robot: shares of what the operator's pictures leave of the uplink."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from lockstep.protocol.messages import StreamRequest
from lockstep.server.media.pipeline.stream import VideoStream
from lockstep.server.media.quality.adaptation import Adaptation
from lockstep.server.media.quality.budget import CameraNeed, share_out
from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.settings import MediaSettings
from lockstep.server.media.uplink.second_share import SecondShare, UplinkNow

__all__ = ["SecondRequests"]

STEP = 0.06  # of the bitrate, below which a change is not worth a message


@dataclass
class _Camera:
    stream: VideoStream
    adaptation: Adaptation = field(default_factory=Adaptation)
    asked: EncodingTarget | None = None  # None: no second encoding is asked for
    keyframes: int = 0  # asked for so far


class SecondRequests:
    """The requests of one epoch. Call `tick` ten times a second.

    Attributes:
        bps: bits per second of all second encodings; 0: none is asked for
    """

    def __init__(self, settings: MediaSettings, streams: Iterable[VideoStream]) -> None:
        self.bps = 0.0
        self._settings = settings
        self._share = SecondShare()
        self._cameras = [_Camera(stream) for stream in streams]
        for camera in self._cameras:
            camera.stream.second.came = self._share.came

    def tick(self, now: float, *, first_bps: float, uplink: UplinkNow) -> bool:
        """Decide; return whether the robot has to be told. The arguments are those of `SecondShare.decide`."""
        due = [each for each in self._cameras if self._settings.second_encoding and each.stream.second.is_due]
        most = float(self._settings.video_bitrate_bps)
        self.bps = self._share.decide(now, first_bps=first_bps, most_bps=most * len(due), uplink=uplink)
        taken = due if self.bps > 0 else []
        needs = [CameraNeed(_pixels(each.stream), most) for each in taken]
        shares = dict(zip(map(id, taken), share_out(self.bps, needs), strict=True))
        news = [self._ask(camera, shares.get(id(camera)), now) for camera in self._cameras]
        return any(news)

    def _ask(self, camera: _Camera, share: float | None, now: float) -> bool:
        stream = camera.stream
        if share is None:
            was_asked, camera.asked = camera.asked is not None, None
            stream.second.end()
            return was_asked
        stream.second.begin()
        target = camera.adaptation.plan(share, stream.frame_rate, stream.first_size, now)
        wants = stream.second.wants_keyframe(now)
        camera.keyframes += wants
        if not wants and not _differs(camera.asked, target):
            return False
        camera.asked = target
        return True

    def requests(self) -> list[StreamRequest]:
        """Return what is asked for now."""
        return [
            StreamRequest(
                stream=each.stream.name,
                bitrate=each.asked.bitrate_bps,
                frame_rate=min(240.0, each.asked.frame_rate),
                scale=each.asked.scale,
                keyframes=each.keyframes,
            )
            for each in self._cameras
            if each.asked is not None
        ]


def _pixels(stream: VideoStream) -> float:
    width, height = stream.first_size
    return width * height * stream.frame_rate


def _differs(asked: EncodingTarget | None, target: EncodingTarget) -> bool:
    if asked is None or (asked.frame_rate, asked.scale) != (target.frame_rate, target.scale):
        return True
    return abs(target.bitrate_bps - asked.bitrate_bps) > STEP * asked.bitrate_bps

"""The streams of cameras and microphones: their stages, put together."""

from dataclasses import dataclass
from typing import Literal

from lockstep.protocol.description import Camera, Microphone
from lockstep.server.media.codecs.group_of_pictures import GroupOfPictures
from lockstep.server.media.codecs.picture_encoder import VIDEO_CODECS
from lockstep.server.media.encoding.encoder_worker import EncoderWorker
from lockstep.server.media.encoding.picture_encoding import PictureJob, PictureQueue, TierEncoders
from lockstep.server.media.encoding.sound_encoding import SoundEncoders, SoundJob, SoundQueue
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.metrics import DropCounter, MediaMetrics
from lockstep.server.media.pipeline.admission import Admission
from lockstep.server.media.pipeline.media_clock import PictureClock
from lockstep.server.media.pipeline.passthrough import Passthrough
from lockstep.server.media.pipeline.picture_thinning import PictureThinning
from lockstep.server.media.pipeline.recorded_encoding import RecordedEncoding
from lockstep.server.media.pipeline.second_passthrough import SecondPassthrough
from lockstep.server.media.pipeline.sound_rate_limiter import SoundRateLimiter
from lockstep.server.media.pipeline.stage import FrameStage
from lockstep.server.media.quality.encoding_target import EncodingTarget
from lockstep.server.media.quality.expected_loss import ExpectedLoss
from lockstep.server.media.settings import MediaSettings

__all__ = ["AudioStream", "Stream", "StreamMaker", "VideoStream"]

# A camera gives nothing when no picture came for so long, and at least so many in a row are missing.
QUIET_SECONDS, QUIET_PICTURES = 2.0, 3


@dataclass(frozen=True, eq=False)
class Stream:
    """One camera's or microphone's way to the peers; the parts that its users need. Run `worker`."""

    name: str
    label: str
    first: Admission  # takes the source's frames
    encodings: StreamEncodings  # and who gets which
    recording: RecordedEncoding
    worker: EncoderWorker[PictureJob] | EncoderWorker[SoundJob]

    @property
    def kind(self) -> Literal["video", "audio"]:
        return "video" if isinstance(self, VideoStream) else "audio"


@dataclass(frozen=True, eq=False)
class VideoStream(Stream):
    """Takes yuv420p, mjpeg and h264; encoded to H.264 and VP8, h264 also passed on unchanged."""

    passthrough: Passthrough
    second: SecondPassthrough
    frame_rate: float  # pictures per second, at most
    first_size: tuple[int, int]  # width and height, as far as they are known before the first picture
    expects_h264: bool  # the camera may encode H.264 itself, as far as is known before its first picture

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the newest picture that says them."""
        return self.first.size or self.first_size

    @property
    def gives_h264(self) -> bool:
        """True if the camera encodes H.264 itself; its peers should then take that codec."""
        newest = self.first.newest
        return self.expects_h264 if newest is None else newest.media.codec == "h264"

    @property
    def is_wanted(self) -> bool:
        """True while a peer or the recorder takes the pictures."""
        return self.encodings.is_taken or self.recording.takes

    def is_giving(self, now: float) -> bool:
        """True while pictures come. A camera that gives none, or none any more, needs no share of a path."""
        patience = max(QUIET_SECONDS, QUIET_PICTURES / self.frame_rate)
        return self.first.newest is not None and now - self.first.newest.arrived_at < patience


@dataclass(frozen=True, eq=False)
class AudioStream(Stream):
    """Takes pcm_s16le, mono or stereo, at any rate; encoded to Opus and PCMU."""

    expected_loss: ExpectedLoss  # against which sound is protected


class StreamMaker:
    """Makes the streams of one media hub, which all end in one fan-out."""

    def __init__(self, settings: MediaSettings, fan_out: FrameStage, metrics: MediaMetrics) -> None:
        self._settings = settings
        self._fan_out = fan_out
        self._metrics = metrics

    def video(self, camera: Camera, *, attached: bool = False, expects_h264: bool = False) -> VideoStream:
        """Make the stream of a camera.

        Args:
            attached: True for a camera of the console, False for one of the robot
            expects_h264: True if it may encode H.264 itself
        """
        settings, metrics, name = self._settings, self._metrics, camera.name
        frame_rate = min(camera.frame_rate, settings.video_frames_per_second or camera.frame_rate)
        full = EncodingTarget(settings.video_bitrate_bps, frame_rate)
        encodings = StreamEncodings(name, VIDEO_CODECS, full, settings, metrics, video=True)
        passed = encodings.add_passed()
        clock, group, dropped = PictureClock(), GroupOfPictures(), DropCounter(metrics, name)
        recording = RecordedEncoding(self._fan_out, encodings, "high", attached=attached)
        queue = PictureQueue(encodings, frame_rate, clock, group, metrics.taken.labels(name), dropped)
        worker = EncoderWorker(recording, queue, TierEncoders(name, metrics), encodings, dropped)
        thinned: FrameStage = worker
        if settings.video_frames_per_second is not None:
            thinned = PictureThinning(worker, settings.video_frames_per_second, dropped)
        passthrough = Passthrough(thinned, encodings, passed, clock, group, dropped)
        arrived = metrics.frames_in.labels(name)
        second = SecondPassthrough(recording, encodings, encodings.add_second(), clock, dropped)
        admission = Admission(passthrough, recording.choose_for_next, arrived, dropped, passthrough.lost, second)
        return VideoStream(
            name,
            camera.label,
            admission,
            encodings,
            recording,
            worker,
            passthrough,
            second,
            frame_rate,
            (camera.width, camera.height),
            expects_h264,
        )

    def audio(self, microphone: Microphone, *, attached: bool = False) -> AudioStream:
        """Make the stream of a microphone. `attached`: as in `video`."""
        settings, metrics, name = self._settings, self._metrics, microphone.name
        full = EncodingTarget(settings.video_bitrate_bps, 1.0)
        encodings = StreamEncodings(name, settings.sound_codecs, full, settings, metrics, video=False)
        dropped, expected_loss = DropCounter(metrics, name), ExpectedLoss(settings.opus_packet_loss_percent)
        recording = RecordedEncoding(self._fan_out, encodings, "operator", attached=attached, sound=True)
        queue = SoundQueue(encodings, expected_loss, dropped)
        worker = EncoderWorker(recording, queue, SoundEncoders(settings.opus_bitrate_bps), encodings, dropped)
        limiter = SoundRateLimiter(worker, dropped)
        admission = Admission(limiter, recording.choose_for_next, metrics.frames_in.labels(name), dropped)
        return AudioStream(name, microphone.label, admission, encodings, recording, worker, expected_loss)

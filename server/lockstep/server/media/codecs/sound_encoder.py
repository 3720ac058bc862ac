"""Opus and G.711 encoders: 20 ms packets, each with the stamp of the oldest sound in it."""

from abc import ABC, abstractmethod
from collections import deque
from fractions import Fraction
from typing import NamedTuple

import av
import numpy as np
import numpy.typing as npt
from av.audio.codeccontext import AudioCodecContext
from av.audio.resampler import AudioResampler
from av.error import FFmpegError

from lockstep.server.media.errors import EncodeError, PayloadError, UnsupportedCodecError
from lockstep.server.media.pipeline.media_clock import SoundClock

__all__ = [
    "AUDIO_CODECS",
    "PACKET_SECONDS",
    "EncodedSound",
    "OpusEncoder",
    "PcmuEncoder",
    "Segment",
    "SoundEncoder",
    "create_sound_encoder",
]

AUDIO_CODECS = ("opus", "PCMU")
PACKET_SECONDS = Fraction(20, 1000)
OPUS_COMPLEXITY = "5"  # of 10: a third cheaper than the best, for a difference that speech and motors do not show

Samples = npt.NDArray[np.int16]


class Segment(NamedTuple):
    """Sound from the robot link. `samples` is interleaved."""

    samples: Samples
    sample_rate: int  # Hz
    channels: int  # 1 or 2
    stamp: int  # event reference at the first sample
    link_time: float  # s, at the first sample
    capture_time: float  # s since 1970, at the first sample


class EncodedSound(NamedTuple):
    data: bytes
    media_time: int  # in the codec's RTP clock
    stamp: int
    capture_time: float
    link_time: float
    talkspurt: bool  # the first packet, or the first after missing sound (RFC 3551 4.1: the marker)


class _Mark(NamedTuple):
    position: int  # index of a segment's first sample, in the codec's rate
    stamp: int
    capture_time: float
    link_time: float


class SoundEncoder(ABC):
    """Cuts segments of any length into packets. Used from one thread.

    Call `encode` with segments in the order of their capture.
    """

    rate: int  # Hz; also the RTP clock of both codecs
    look_ahead = 0  # samples by which the decoded sound of a packet is older than its position

    def __init__(self) -> None:
        self._form: tuple[int, int] | None = None  # rate and channels of the segments
        self._clock: SoundClock | None = None
        self._origin = 0  # position at which this form of segments began
        self._restart(0)

    def _restart(self, position: int) -> None:
        """Begin a continuous run of sound at `position`."""
        self._position = position  # of the first sample in the buffer
        self._buffer: Samples = np.empty(0, np.int16)
        self._marks: deque[_Mark] = deque()
        self._resampler: AudioResampler | None = None
        self._talkspurt = True

    def expect_loss(self, percent: int) -> None:
        """Set the expected loss of packets. Does nothing for a codec without error correction."""

    def encode(self, segment: Segment) -> list[EncodedSound]:
        """Encode a segment and return the packets that it completes: none, one or several.

        Raises:
            EncodeError: the library refused.
        """
        if self._form != (segment.sample_rate, segment.channels):
            self._form = segment.sample_rate, segment.channels
            self._clock = None
        self._place(segment)
        try:
            self._buffer = np.concatenate((self._buffer, self._convert(segment)))
            return self._cut()
        except (FFmpegError, ValueError) as error:
            self._form = None
            raise EncodeError(str(error)) from error

    def _place(self, segment: Segment) -> None:
        end = self._position + self._buffered()
        if self._clock is None:
            self._clock, self._origin = SoundClock(segment.sample_rate), end
            self._restart(end)
        start, continuous = self._clock.place(segment.link_time, len(segment.samples) // segment.channels)
        position = self._origin + -(-start * self.rate // segment.sample_rate)
        if not continuous:
            position = max(position, end)
            self._restart(position)
        self._marks.append(_Mark(position, segment.stamp, segment.capture_time, segment.link_time))

    def _buffered(self) -> int:
        return len(self._buffer) // self.channels

    @property
    def channels(self) -> int:
        """The number of encoded channels."""
        return 1

    def _convert(self, segment: Segment) -> Samples:
        if segment.sample_rate == self.rate and segment.channels == self.channels:
            return segment.samples
        if self._resampler is None:
            self._resampler = AudioResampler("s16", _layout(self.channels), self.rate)
        frame = av.AudioFrame.from_ndarray(segment.samples.reshape(1, -1), "s16", _layout(segment.channels))
        frame.sample_rate = segment.sample_rate
        parts = [part.to_ndarray().reshape(-1) for part in self._resampler.resample(frame)]
        return np.concatenate(parts) if parts else np.empty(0, np.int16)

    def _cut(self) -> list[EncodedSound]:
        size = int(self.rate * PACKET_SECONDS)
        packets = []
        while self._buffered() >= size:
            samples = self._buffer[: size * self.channels]
            self._buffer = self._buffer[size * self.channels :]
            data = self._compress(np.ascontiguousarray(samples))
            oldest = self._mark(self._position - self.look_ahead)
            passed = (self._position - oldest.position) / self.rate
            packets.append(
                EncodedSound(
                    data,
                    self._position,
                    oldest.stamp,
                    oldest.capture_time + passed,
                    oldest.link_time + passed,
                    self._talkspurt,
                )
            )
            self._talkspurt = False
            self._position += size
        return packets

    def _mark(self, position: int) -> _Mark:
        """Return the mark of the segment at `position`; the first one for an earlier position."""
        while len(self._marks) > 1 and self._marks[1].position <= position:
            self._marks.popleft()
        return self._marks[0]

    @abstractmethod
    def _compress(self, samples: Samples) -> bytes:
        """Encode one packet of exactly 20 ms."""


class OpusEncoder(SoundEncoder):
    """Opus with in-band forward error correction (RFC 7587)."""

    rate = 48_000
    look_ahead = 312  # libopus, 6.5 ms

    def __init__(self, bitrate_bps: int, packet_loss_percent: int) -> None:
        super().__init__()
        self._options = {
            "application": "voip",
            "frame_duration": "20",
            "fec": "1",
            "packet_loss": str(packet_loss_percent),
            "compression_level": OPUS_COMPLEXITY,
        }
        self._bitrate = bitrate_bps
        self._context: AudioCodecContext | None = None

    def expect_loss(self, percent: int) -> None:
        if self._options["packet_loss"] != str(percent):
            self._options = {**self._options, "packet_loss": str(percent)}
            self._context = None  # it takes its options when it is opened

    @property
    def channels(self) -> int:
        return self._form[1] if self._form is not None else 1

    def _compress(self, samples: Samples) -> bytes:
        layout = _layout(self.channels)
        if self._context is None or self._context.layout.name != layout:
            self._context = av.CodecContext.create("libopus", "w")
            self._context.format, self._context.layout = "s16", layout
            self._context.sample_rate = self.rate
            self._context.bit_rate = self._bitrate
            self._context.time_base = Fraction(1, self.rate)
            self._context.options = self._options
        frame = av.AudioFrame.from_ndarray(samples.reshape(1, -1), "s16", layout)
        frame.sample_rate = self.rate
        return b"".join(map(bytes, self._context.encode(frame)))


class PcmuEncoder(SoundEncoder):
    """G.711 mu-law, 8 kHz, mono (RFC 3551 4.5.14)."""

    rate = 8_000

    def _compress(self, samples: Samples) -> bytes:
        return _MU_LAW[samples.view(np.uint16)].tobytes()


def _mu_law_table() -> npt.NDArray[np.uint8]:
    """Code of every 16-bit sample, indexed by its bits (ITU-T G.711 table 2)."""
    samples = np.arange(65536, dtype=np.uint16).view(np.int16).astype(np.int32)
    magnitude = np.minimum(np.abs(samples), 32635) + 132
    exponent = np.floor(np.log2(magnitude)).astype(np.int32) - 7
    mantissa = magnitude >> (exponent + 3) & 0x0F
    sign = np.where(samples < 0, 0x80, 0)
    codes: npt.NDArray[np.uint8] = (~(sign | exponent << 4 | mantissa) & 0xFF).astype(np.uint8)
    return codes


_MU_LAW = _mu_law_table()


def _layout(channels: int) -> str:
    if channels not in (1, 2):
        raise PayloadError(f"{channels} channels: only mono and stereo are supported")
    return "mono" if channels == 1 else "stereo"


def create_sound_encoder(codec: str, bitrate_bps: int, packet_loss_percent: int) -> SoundEncoder:
    """Create an encoder for one of AUDIO_CODECS."""
    if codec == "opus":
        return OpusEncoder(bitrate_bps, packet_loss_percent)
    if codec == "PCMU":
        return PcmuEncoder()
    raise UnsupportedCodecError(codec)

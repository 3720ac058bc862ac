"""Encodes a microphone's sound to Opus with PyAV: packets of 20 ms, each with the stamp of the oldest sound in it."""

from collections import deque
from fractions import Fraction
from typing import NamedTuple

import av
import msgspec
from av.audio.codeccontext import AudioCodecContext
from av.audio.resampler import AudioResampler
from av.error import FFmpegError

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.errors import EncodingFailed

__all__ = ["OpusEncoder"]

RATE = 48_000  # Hz
PACKET = 960  # samples, 20 ms
LOOK_AHEAD = 312  # samples by which the decoded sound of a packet is older than its position: libopus, 6.5 ms
BITRATE = 32_000  # bit/s
EXPECTED_LOSS = 10  # percent, for which packets repair the one before (RFC 7587)
DRIFT = 0.04  # s by which sound may come later than it should before it counts as a gap
LAYOUTS = {1: "mono", 2: "stereo"}


class _Mark(NamedTuple):
    """Where a segment begins."""

    position: int  # samples at RATE
    stamp: int
    time: float  # s


class OpusEncoder:
    """Takes segments of any length and rate, in the order of their capture. Used from one thread."""

    def __init__(self) -> None:
        self._form: tuple[int, int] | None = None  # sample rate and channels of the segments
        self._context: AudioCodecContext | None = None
        self._resampler: AudioResampler | None = None
        self._buffer = bytearray()
        self._position = 0  # of the first sample in the buffer
        self._marks: deque[_Mark] = deque()
        self._due = 0.0  # s; when the next segment should have been captured

    def encode(self, media: Media) -> list[Media]:
        """Return the packets that a segment completes: none, one or several.

        Raises:
            EncodingFailed: it is no sound, or the library refused it; the next one begins afresh.
        """
        try:
            self._take(media)
            return self._cut(media)
        except (FFmpegError, ValueError) as error:
            self._form = None
            raise EncodingFailed(str(error)) from error

    def _take(self, media: Media) -> None:
        channels, size = media.channels, 2 * media.channels
        if channels not in LAYOUTS or media.sample_rate < 8000 or not media.payload or len(media.payload) % size:
            raise EncodingFailed(f"{len(media.payload)} bytes of {channels} channels at {media.sample_rate} Hz")
        if self._form != (media.sample_rate, channels) or not -1.0 < media.time - self._due < DRIFT:
            self._begin((media.sample_rate, channels))
        samples = len(media.payload) // size
        self._due = media.time + samples / media.sample_rate
        self._marks.append(_Mark(self._position + len(self._buffer) // size, media.stamp, media.time))
        self._buffer += self._resampled(media, samples)

    def _begin(self, form: tuple[int, int]) -> None:
        """Begin a run of sound without gaps, in which nothing of the one before sounds on: its stamps were older."""
        self._form, self._context, self._resampler = form, None, None
        self._buffer.clear()
        self._marks.clear()

    def _resampled(self, media: Media, samples: int) -> bytes:
        if media.sample_rate == RATE:
            return media.payload
        layout = LAYOUTS[media.channels]
        if self._resampler is None:
            self._resampler = AudioResampler("s16", layout, RATE)
        parts = self._resampler.resample(_frame(media.payload, samples, layout, media.sample_rate))
        size = 2 * media.channels
        return b"".join(bytes(part.planes[0])[: part.samples * size] for part in parts)

    def _cut(self, media: Media) -> list[Media]:
        size, packets = PACKET * 2 * media.channels, []
        while len(self._buffer) >= size:
            samples = bytes(self._buffer[:size])
            del self._buffer[:size]
            data = self._compress(samples, LAYOUTS[media.channels])
            while len(self._marks) > 1 and self._marks[1].position <= self._position - LOOK_AHEAD:
                self._marks.popleft()
            oldest = self._marks[0]
            packets.append(
                msgspec.structs.replace(
                    media,
                    codec="opus",
                    payload=data,
                    stamp=oldest.stamp,
                    time=oldest.time + (self._position - oldest.position) / RATE,
                    sample_rate=RATE,
                )
            )
            self._position += PACKET
        return packets

    def _compress(self, samples: bytes, layout: str) -> bytes:
        context = self._context
        if context is None:
            made = av.CodecContext.create("libopus", "w")
            if not isinstance(made, AudioCodecContext):
                raise ValueError("libopus is no encoder of sound")
            context = made
            context.format, context.layout = "s16", layout
            context.sample_rate = RATE
            context.bit_rate = BITRATE
            context.time_base = Fraction(1, RATE)
            context.options = {
                "application": "voip",
                "frame_duration": "20",
                "fec": "1",
                "packet_loss": str(EXPECTED_LOSS),
                "compression_level": "5",
            }
            self._context = context
        return b"".join(map(bytes, context.encode(_frame(samples, PACKET, layout, RATE))))


def _frame(samples: bytes, count: int, layout: str, rate: int) -> av.AudioFrame:
    frame = av.AudioFrame("s16", layout, count, align=1)
    frame.planes[0].update(samples)
    frame.sample_rate = rate
    return frame

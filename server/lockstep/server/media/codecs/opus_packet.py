"""Looks at Opus packets that others made, and turns them into samples (RFC 6716). The decoder runs in one thread."""

import av
import numpy as np
import numpy.typing as npt
from av.audio.codeccontext import AudioCodecContext
from av.audio.resampler import AudioResampler
from av.error import FFmpegError

from lockstep.server.media.errors import PayloadError

__all__ = ["OPUS_RATE", "OpusDecoder", "opus_samples"]

OPUS_RATE = 48_000  # Hz
MAX_PACKET = 1275  # bytes of a packet with one frame (3.4); longer ones would be for music at more than 500 kbit/s
SILK, HYBRID, CELT = (480, 960, 1920, 2880), (480, 960), (120, 240, 480, 960)  # samples of a frame (table 2)


def opus_samples(packet: bytes) -> int:
    """Return the samples at 48 kHz that a packet holds.

    Raises:
        PayloadError: it is not a packet of 2.5 to 120 ms, of a size that sound in packets has.
    """
    if not 1 <= len(packet) <= MAX_PACKET:
        raise PayloadError(f"{len(packet)} bytes are not an Opus packet")
    config, code = packet[0] >> 3, packet[0] & 3
    if config < 12:
        frame = SILK[config % 4]
    elif config < 16:
        frame = HYBRID[config % 2]
    else:
        frame = CELT[config % 4]
    if code == 3 and len(packet) < 2:
        raise PayloadError("an Opus packet without its frame count")
    frames = (1, 2, 2, packet[1] & 0x3F if code == 3 else 0)[code]
    if not 0 < frames * frame <= 5760:  # 120 ms (3.4)
        raise PayloadError(f"an Opus packet of {frames} frames of {frame} samples")
    return frames * frame


class OpusDecoder:
    """Decodes the packets of one microphone to mono."""

    def __init__(self) -> None:
        self._context: AudioCodecContext | None = None
        self._resampler: AudioResampler | None = None

    def decode(self, packet: bytes) -> npt.NDArray[np.int16]:
        """Return the samples at 48 kHz.

        Raises:
            PayloadError: the packet cannot be decoded.
        """
        if self._context is None or self._resampler is None:
            made = av.CodecContext.create("libopus", "r")
            assert isinstance(made, AudioCodecContext)  # the decoder of that name is one
            made.sample_rate = OPUS_RATE
            made.layout = "mono"
            self._context, self._resampler = made, AudioResampler("s16", "mono", OPUS_RATE)
        try:
            parts = [
                part.to_ndarray().reshape(-1)
                for frame in self._context.decode(av.Packet(packet))
                for part in self._resampler.resample(frame)
            ]
        except (FFmpegError, ValueError) as error:
            self._context = None
            raise PayloadError(f"not Opus: {error}") from error
        if not parts:
            raise PayloadError("an Opus packet without sound")
        return np.concatenate(parts).astype(np.int16, copy=False)

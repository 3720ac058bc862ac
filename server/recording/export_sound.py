"""Sound of a recording on its way into an MP4 file."""

from fractions import Fraction

import av
import numpy as np
from av.audio.stream import AudioStream
from av.container import OutputContainer

__all__ = ["CopiedOpus", "EncodedG711"]

SECOND = 1_000_000_000
OPUS_RATE = 48_000  # Hz
OPUS_STEREO = 0x04  # in the first byte of a packet (RFC 6716 3.1)
G711_RATE = 8_000
APART = G711_RATE // 10  # samples: a gap longer than this is silence, less is how unsteadily packets came
AAC_BITS = 32_000  # a second


class CopiedOpus:
    """Opus as it was recorded."""

    def __init__(self, output: OutputContainer, packet: bytes) -> None:
        self._output = output
        # Of the encoder only its header is used.
        layout = "stereo" if packet[0] & OPUS_STEREO else "mono"
        self._stream: AudioStream = output.add_stream("libopus", rate=OPUS_RATE, layout=layout)
        self._stream.time_base = Fraction(1, OPUS_RATE)

    def take(self, data: bytes, passed: int) -> None:
        """A packet that was captured so many ns after the film's beginning."""
        packet = av.Packet(data)
        packet.stream, packet.time_base = self._stream, Fraction(1, OPUS_RATE)
        packet.pts = packet.dts = passed * OPUS_RATE // SECOND
        self._output.mux(packet)

    def close(self) -> None: ...


class EncodedG711:
    """G.711 µ-law, which MP4 does not hold, as AAC. What is missing between packets is silent."""

    def __init__(self, output: OutputContainer) -> None:
        self._output = output
        self._decoder = av.CodecContext.create("pcm_mulaw", "r")
        self._decoder.sample_rate, self._decoder.layout = G711_RATE, "mono"
        self._stream: AudioStream = output.add_stream("aac", rate=G711_RATE, layout="mono")
        self._stream.bit_rate = AAC_BITS
        self._until = 0  # samples that were given to the encoder

    def take(self, data: bytes, passed: int) -> None:
        """As `CopiedOpus.take`."""
        at = passed * G711_RATE // SECOND
        if at - self._until > APART:
            self._encode(np.zeros((1, at - self._until), np.int16))
        for frame in self._decoder.decode(av.Packet(data)):
            self._encode(frame.to_ndarray().astype(np.int16).reshape(1, -1))

    def _encode(self, samples: np.typing.NDArray[np.int16]) -> None:
        frame = av.AudioFrame.from_ndarray(samples, format="s16", layout="mono")
        frame.sample_rate, frame.time_base, frame.pts = G711_RATE, Fraction(1, G711_RATE), self._until
        self._until += samples.shape[1]
        self._output.mux(self._stream.encode(frame))

    def close(self) -> None:
        self._output.mux(self._stream.encode(None))

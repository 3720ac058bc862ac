"""Writes the sound of a recording into an MP4 file."""

from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import av
import numpy as np
from av.audio.codeccontext import AudioCodecContext
from av.audio.stream import AudioStream
from av.container import OutputContainer

from lockstep.server.recording.format.payload import RecordedSound

__all__ = ["sound_writer"]

SECOND = 1_000_000_000
OPUS, G711 = "opus", "g711-ulaw"  # formats as a recording names them; others are left out
OPUS_RATE = 48_000  # Hz
OPUS_STEREO = 0x04  # in the first byte of a packet (RFC 6716 3.1)
G711_RATE = 8_000
G711_PACKET = 160  # samples, one byte each: 20 ms
APART = G711_RATE // 10  # samples: a longer gap is silence, a shorter one is jitter
AAC_BITS = OPUS_BITS = 32_000  # a second


def sound_writer(output: OutputContainer, sounds: Iterable[RecordedSound]) -> "CopiedOpus | EncodedG711 | None":
    """Return a writer for all these packets; None if it could write none of them."""
    formats: set[str] = set()
    stereo = False
    for each in sounds:
        formats.add(each.format)
        stereo = stereo or (each.format == OPUS and bool(each.data[:1] and each.data[0] & OPUS_STEREO))
    if OPUS in formats:
        return CopiedOpus(output, stereo=stereo)
    return EncodedG711(output) if G711 in formats else None


class CopiedOpus:
    """Writes Opus as it was recorded. G.711 in between is encoded as Opus, packet by packet."""

    def __init__(self, output: OutputContainer, *, stereo: bool) -> None:
        self._output = output
        # Only the encoder's header is used.
        self._stream: AudioStream = output.add_stream("libopus", rate=OPUS_RATE, layout="stereo" if stereo else "mono")
        self._stream.time_base = Fraction(1, OPUS_RATE)
        self._decoder = _g711_decoder()
        self._encoder: AudioCodecContext | None = None  # while there is G.711

    def take(self, sound: RecordedSound, passed: int) -> None:
        """Write a packet that was captured `passed` ns after the film's beginning."""
        if sound.format == OPUS:
            self._encoder = None
            self._mux(sound.data, passed)
        elif sound.format == G711 and len(sound.data) == G711_PACKET:
            self._encoder = self._encoder or _opus_encoder()
            for frame in self._decoder.decode(av.Packet(sound.data)):
                for packet in self._encoder.encode(_g711_frame(frame.to_ndarray())):
                    self._mux(bytes(packet), passed)

    def _mux(self, data: bytes, passed: int) -> None:
        packet = av.Packet(data)
        packet.stream, packet.time_base = self._stream, Fraction(1, OPUS_RATE)
        packet.pts = packet.dts = passed * OPUS_RATE // SECOND
        self._output.mux(packet)

    def close(self) -> None: ...


class EncodedG711:
    """Writes G.711 µ-law, which MP4 does not hold, as AAC. Gaps between packets become silence."""

    def __init__(self, output: OutputContainer) -> None:
        self._output = output
        self._decoder = _g711_decoder()
        self._stream: AudioStream = output.add_stream("aac", rate=G711_RATE, layout="mono")
        self._stream.bit_rate = AAC_BITS
        self._until = 0  # samples that the encoder was given

    def take(self, sound: RecordedSound, passed: int) -> None:
        """Write a packet, as `CopiedOpus.take`."""
        if sound.format != G711:
            return
        at = passed * G711_RATE // SECOND
        if at - self._until > APART:
            self._encode(np.zeros(at - self._until, np.int16))
        for frame in self._decoder.decode(av.Packet(sound.data)):
            self._encode(frame.to_ndarray())

    def _encode(self, samples: np.typing.NDArray[Any]) -> None:
        frame = _g711_frame(samples)
        frame.time_base, frame.pts = Fraction(1, G711_RATE), self._until
        self._until += frame.samples
        self._output.mux(self._stream.encode(frame))

    def close(self) -> None:
        self._output.mux(self._stream.encode(None))


def _g711_decoder() -> AudioCodecContext:
    decoder = av.CodecContext.create("pcm_mulaw", "r")
    decoder.sample_rate, decoder.layout = G711_RATE, "mono"
    return decoder


def _opus_encoder() -> AudioCodecContext:
    """Return an encoder that gives one packet for each that it takes, and holds none back."""
    encoder = av.CodecContext.create("libopus", "w")
    encoder.format, encoder.layout, encoder.sample_rate = "s16", "mono", G711_RATE
    encoder.bit_rate, encoder.time_base = OPUS_BITS, Fraction(1, G711_RATE)
    encoder.options = {"application": "voip", "frame_duration": "20"}
    return encoder


def _g711_frame(samples: np.typing.NDArray[Any]) -> av.AudioFrame:
    frame = av.AudioFrame.from_ndarray(samples.astype(np.int16).reshape(1, -1), format="s16", layout="mono")
    frame.sample_rate = G711_RATE
    return frame

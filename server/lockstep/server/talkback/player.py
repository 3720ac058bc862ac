"""The process of the loudspeaker: decodes Opus packets from standard input and plays them.

The decoder's input comes from a peer, and a sound device may hang: in this process neither harms the console. Standard
output reports the state of the loudspeaker, in messages of `source_wire`.
"""

import os
import sys
import time
import wave
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import av
import msgspec
from av.audio.codeccontext import AudioCodecContext
from av.error import FFmpegError

from lockstep.server.media.pulse_audio import PulseStream
from lockstep.server.media.sources.errors import reason_of
from lockstep.server.media.sources.source_wire import SAID, Trouble, Working
from lockstep.server.talkback.playout import Playout
from lockstep.server.talkback.speaker_url import SpeakerSpec
from lockstep.server.util.framed_pipe import FramedPipe

__all__ = ["VOICE", "Sink", "VoicePacket", "main", "open_sink"]

MAX_LENGTH = 65_536  # bytes of a packet
RATE = 48_000  # Hz
BUFFER = int(0.1 * RATE)  # samples in the device
RETRY = 2.0  # s until a device that failed is opened again


class Sink(ABC):
    """Takes mono samples of 16 bits at `RATE`. Raises OSError when it fails."""

    @abstractmethod
    def write(self, samples: bytes) -> None: ...

    @abstractmethod
    def close(self) -> None: ...


class _Pulse(Sink):
    def __init__(self, device: str) -> None:
        self._stream = PulseStream.playing(device, RATE, 1, BUFFER)

    def write(self, samples: bytes) -> None:
        self._stream.write(samples)

    def close(self) -> None:
        self._stream.close()


class _Alsa(Sink):
    def __init__(self, device: str) -> None:
        self._container = av.open(device, "w", format="alsa")
        self._stream: Any = self._container.add_stream("pcm_s16le", rate=RATE, layout="mono")
        self._written = 0

    def write(self, samples: bytes) -> None:
        packet = av.Packet(samples)
        packet.stream, packet.time_base = self._stream, self._stream.time_base
        packet.pts = packet.dts = self._written
        self._written += len(samples) // 2
        self._container.mux(packet)

    def close(self) -> None:
        self._container.close()


class _File(Sink):
    """Writes all that was said, without the silence between."""

    def __init__(self, path: str) -> None:
        self._file = wave.open(Path(path).open("wb", buffering=0), "wb")  # noqa: SIM115
        self._file.setnchannels(1)
        self._file.setsampwidth(2)
        self._file.setframerate(RATE)
        self._file.writeframes(b"")

    def write(self, samples: bytes) -> None:
        self._file.writeframes(samples)  # also writes the length anew

    def close(self) -> None:
        self._file.close()


def open_sink(spec: SpeakerSpec) -> Sink:
    """Open the sink that `spec` names. Raises OSError."""
    if spec.scheme == "pulse":
        return _Pulse(spec.device)
    return _Alsa(spec.device) if spec.scheme == "alsa" else _File(spec.device)


class VoicePacket(msgspec.Struct, frozen=True, array_like=True):
    payload: bytes  # Opus
    sent: float  # s, its arrival at the console on the monotonic clock


VOICE: FramedPipe[VoicePacket] = FramedPipe(VoicePacket, MAX_LENGTH)


class Player:
    """Plays the packets that are worth playing; opens a device again that failed."""

    def __init__(self, spec: SpeakerSpec, out: BinaryIO) -> None:
        self._spec = spec
        self._out = out
        self._playout = Playout()
        self._decoder = _decoder()
        self._sink: Sink | None = None
        self._retry_at = 0.0

    def open(self) -> None:
        now = time.monotonic()
        if self._sink is not None or now < self._retry_at:
            return
        self._retry_at = now + RETRY
        try:
            self._sink = open_sink(self._spec)
        except (OSError, FFmpegError, ValueError) as error:
            self._failed(error)
        else:
            SAID.write(self._out, Working(self._spec.scheme))

    def play(self, packet: VoicePacket) -> None:
        self.open()
        try:
            frames = self._decoder.decode(av.Packet(packet.payload))
        except (FFmpegError, ValueError):
            self._decoder = _decoder()
            return
        for frame in frames:
            samples = frame.to_ndarray().tobytes()
            silence = self._playout.admit(frame.samples / RATE, packet.sent, time.monotonic())
            if silence is None or self._sink is None:
                continue
            try:
                if silence and self._spec.scheme != "file":
                    self._sink.write(bytes(2 * int(silence * RATE)))
                self._sink.write(samples)
            except (OSError, FFmpegError) as error:
                with suppress(OSError, FFmpegError):
                    self._sink.close()
                self._sink = None
                self._failed(error)

    def _failed(self, error: Exception) -> None:
        pulse = self._spec.scheme == "pulse" and isinstance(error, OSError)
        SAID.write(self._out, Trouble("no_sound_server", str(error)) if pulse else Trouble(*reason_of(error)))


def _decoder() -> AudioCodecContext:
    decoder: AudioCodecContext = av.CodecContext.create("libopus", "r")
    decoder.sample_rate, decoder.layout, decoder.format = RATE, "mono", "s16"
    return decoder


def main() -> None:
    spec = msgspec.json.Decoder(SpeakerSpec).decode(sys.stdin.buffer.readline())
    out = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # keeps the output of libraries out of the messages
    with suppress(OSError, KeyboardInterrupt):
        player = Player(spec, out)
        player.open()
        while (packet := VOICE.read(sys.stdin.buffer)) is not None:
            player.play(packet)
    os._exit(0)  # a device that hangs must not delay the exit


if __name__ == "__main__":
    main()

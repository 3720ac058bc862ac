"""Reads the sound of one source, as samples of 16 bits."""

import time
from collections.abc import Callable, Iterator

import av
from av.audio.frame import AudioFrame
from av.audio.resampler import AudioResampler

from lockstep.server.media.pulse_audio import PulseStream
from lockstep.server.media.sources.capture_timeline import SETTLE, CaptureTimeline
from lockstep.server.media.sources.errors import NoSoundServer, NoSuchMedium
from lockstep.server.media.sources.opening import Pace, opened, settled_lag
from lockstep.server.media.sources.source_url import SourceSpec
from lockstep.server.media.sources.source_wire import Captured

__all__ = ["read_sound"]

DEFAULT_RATE = 48_000  # Hz
SEGMENT = 0.02  # s
RESAMPLER_DELAY = 0.001  # s by which resampled sound is older than it looks, at most

Emit = Callable[[Captured], None]


def read_sound(spec: SourceSpec, working: Callable[[str], None], captured: Emit) -> None:
    """Read one connection until it ends; a file begins again. Raises SourceError, FFmpegError, OSError."""
    if spec.scheme == "pulse":
        _read_pulse(spec, working, captured)
        return
    while True:
        _read_container(spec, working, captured)
        if spec.live:
            return


def _read_pulse(spec: SourceSpec, working: Callable[[str], None], captured: Emit) -> None:
    rate, channels = int(spec.rate or DEFAULT_RATE), spec.channels
    count = int(rate * SEGMENT)
    try:
        stream = PulseStream.recording(spec.address, rate, channels, count)
    except OSError as error:
        raise NoSoundServer(str(error)) from error
    with stream:
        working(f"{rate} Hz")
        timeline = CaptureTimeline(spec.latency)
        read = 0
        while True:
            payload = stream.read(count)
            # Samples have no time, but no gaps either: their number serves as one.
            at = timeline.place(read / rate, SEGMENT, time.monotonic())
            read += count
            settled_lag(timeline.lag)
            if at is not None:
                captured(Captured("pcm_s16le", at, payload, sample_rate=rate, channels=channels))


def _read_container(spec: SourceSpec, working: Callable[[str], None], captured: Emit) -> None:
    with opened(spec) as container:
        if not container.streams.audio:
            raise NoSuchMedium("the source has no sound")
        stream = container.streams.audio[0]
        context = stream.codec_context
        rate = int(spec.rate or min(DEFAULT_RATE, max(8000, context.sample_rate)))
        channels = min(2, context.layout.nb_channels) if spec.scheme != "alsa" else spec.channels
        timeline = CaptureTimeline(spec.latency, settle=SETTLE if spec.live else 0.0)
        pace = Pace()
        resampler = AudioResampler("s16", "mono" if channels == 1 else "stereo", rate)
        working(f"{context.name} {context.sample_rate} Hz")
        for frame in _frames(container, stream):
            start = frame.time
            length = frame.samples / frame.sample_rate
            if spec.live:
                at = timeline.place(start, length, time.monotonic())
                settled_lag(timeline.lag)
            else:
                at = pace.wait(start or 0.0) - spec.latency
            for part in resampler.resample(frame):
                if at is None:
                    continue
                payload = part.to_ndarray().tobytes()
                captured(Captured("pcm_s16le", at - RESAMPLER_DELAY, payload, sample_rate=rate, channels=channels))
                at += part.samples / rate


def _frames(container: av.container.InputContainer, stream: av.audio.stream.AudioStream) -> Iterator[AudioFrame]:
    for packet in container.demux(stream):
        try:
            yield from packet.decode()
        except av.error.InvalidDataError:
            continue  # the next packet is decoded without it

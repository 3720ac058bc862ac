"""One microphone: sound is encoded once per codec that somebody needs."""

import time
from collections import deque
from typing import NamedTuple

import numpy as np

from robot_bridge.protocol.description import Microphone
from robot_bridge.protocol.messages import Media
from server.media.errors import MediaError, PayloadError, UnsupportedCodecError
from server.media.fanout import FanOut
from server.media.frame import EncodedFrame
from server.media.metrics import MediaMetrics
from server.media.output import Output
from server.media.packetise import packetise_sound
from server.media.quality.expected_loss import ExpectedLoss
from server.media.settings import MediaSettings
from server.media.sound_encoder import AUDIO_CODECS, EncodedSound, Segment, SoundEncoder, create_sound_encoder
from server.media.stream import Encoded, Stream

__all__ = ["AudioStream"]

QUEUE_SEGMENTS = 10
MIN_RATE = 8_000  # Hz


class SoundJob(NamedTuple):
    media: Media
    capture_time: float
    outputs: list[tuple[Output, frozenset[bool]]]  # with the variants to be packetised in the worker
    expected_loss: int  # percent


class AudioStream(Stream[SoundJob]):
    """Takes pcm_s16le, mono or stereo, at any rate; encoded to Opus and PCMU."""

    kind = "audio"
    codecs: tuple[str, ...] = AUDIO_CODECS

    def __init__(self, microphone: Microphone, settings: MediaSettings, fan_out: FanOut, metrics: MediaMetrics) -> None:
        self.codecs = settings.sound_codecs
        super().__init__(microphone.name, microphone.label, settings, fan_out, metrics)
        self._waiting: deque[tuple[Media, float]] = deque()
        self._encoders: dict[str, SoundEncoder] = {}
        self._expected = ExpectedLoss(settings.opus_packet_loss_percent)

    def _enqueue(self, media: Media, now: float, capture_time: float) -> None:
        if len(self._waiting) >= QUEUE_SEGMENTS:
            self._waiting.popleft()
            self._drop("encoder_busy")
        self._waiting.append((media, capture_time))
        self._wake.set()

    def _next_job(self) -> SoundJob | None:
        if not self._waiting:
            return None
        media, capture_time = self._waiting.popleft()
        outputs = [(output, output.variants()) for output in self._outputs.values() if output.needed]
        return SoundJob(media, capture_time, outputs, self._expected.percent)

    def measured_loss(self, loss: float, now: float) -> None:
        """What the peers that matter lose, 0 to 1: sound is protected against it."""
        self._expected.update(loss, now)

    def _work(self, job: SoundJob) -> list[Encoded]:
        needed = {output.codec for output, _ in job.outputs}
        self._encoders = {codec: encoder for codec, encoder in self._encoders.items() if codec in needed}
        try:
            segment = _segment(job)
        except MediaError as error:
            return [Encoded(output, (), 0.0, error) for output, _ in job.outputs]
        return [self._encode(segment, output, variants, job.expected_loss) for output, variants in job.outputs]

    def _encode(self, segment: Segment, output: Output, variants: frozenset[bool], expected_loss: int) -> Encoded:
        started = time.perf_counter()
        encoder = self._encoders.get(output.codec)
        if encoder is None:
            encoder = create_sound_encoder(output.codec, self._settings.opus_bitrate_bps, expected_loss)
            self._encoders[output.codec] = encoder
        encoder.expect_loss(expected_loss)
        try:
            frames = [_frame(output, sound) for sound in encoder.encode(segment)]
        except MediaError as error:
            del self._encoders[output.codec]
            return Encoded(output, (), 0.0, error)
        for frame in frames:
            for trailer in variants:
                frame.payloads(trailer)
        return Encoded(output, frames, time.perf_counter() - started)


def _segment(job: SoundJob) -> Segment:
    media = job.media
    if media.codec != "pcm_s16le":
        raise UnsupportedCodecError(f"{media.codec} is no sound that can be encoded")
    if media.channels not in (1, 2) or media.sample_rate < MIN_RATE:
        raise PayloadError(f"{media.channels} channels at {media.sample_rate} Hz")
    if not media.payload or len(media.payload) % (2 * media.channels):
        raise PayloadError(f"{len(media.payload)} bytes are no whole samples of {media.channels} channels")
    samples = np.frombuffer(media.payload, "<i2").astype(np.int16, copy=False)
    return Segment(samples, media.sample_rate, media.channels, media.stamp, media.time, job.capture_time)


def _frame(output: Output, sound: EncodedSound) -> EncodedFrame:
    # Only this stream's worker calls this, so the output's last capture time has one writer.
    return EncodedFrame(
        sound.data,
        packetise_sound,
        keyframe=True,
        marker=sound.talkspurt,
        stamp=sound.stamp,
        capture_time=output.monotone(sound.capture_time),
        media_time=sound.media_time,
        time=sound.link_time,
    )

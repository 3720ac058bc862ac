"""The stream of a microphone: sound is encoded once per codec in use; a crowd gets several packets in one."""

import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lockstep.protocol.description import Microphone
from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.packetise import packetise_sound
from lockstep.server.media.codecs.sound_bundle import SoundBundle
from lockstep.server.media.codecs.sound_encoder import (
    AUDIO_CODECS,
    PACKET_SECONDS,
    EncodedSound,
    Segment,
    SoundEncoder,
    create_sound_encoder,
)
from lockstep.server.media.errors import MediaError, PayloadError, UnsupportedCodecError
from lockstep.server.media.metrics import MediaMetrics
from lockstep.server.media.pipeline.fanout import FanOut
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stream import Encoded, Stream
from lockstep.server.media.pipeline.tier_encoding import TierEncoding
from lockstep.server.media.quality.expected_loss import ExpectedLoss
from lockstep.server.media.settings import MediaSettings

__all__ = ["AudioStream"]

QUEUE_SEGMENTS = 10
MIN_RATE = 8_000  # Hz
MAX_AHEAD = 2.0  # s of sound that may come at once
FASTEST = 1.25  # s of sound in a second, afterwards


class SoundJob(NamedTuple):
    media: Media
    capture_time: float
    outputs: list[tuple[TierEncoding, frozenset[bool]]]  # with the variants to be packetised in the worker
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
        self._bundles: dict[str, SoundBundle] = {}  # of the codecs that a crowd takes
        self._expected = ExpectedLoss(settings.opus_packet_loss_percent)
        self._room = MAX_AHEAD  # s of sound that may come now
        self._came_at = 0.0  # s, arrival of the last sound

    def _enqueue(self, media: Media, now: float, capture_time: float) -> None:
        if not self._has_room(media, now):
            self._drop("too_often")
            return
        if len(self._waiting) >= QUEUE_SEGMENTS:
            self._waiting.popleft()
            self._drop("encoder_busy")
        self._waiting.append((media, capture_time))
        self._begin_next()

    def _has_room(self, media: Media, now: float) -> bool:
        """True unless more sound comes than time passes: each packet made of it costs the loop."""
        self._room = min(MAX_AHEAD, self._room + max(0.0, now - self._came_at) * FASTEST)
        self._came_at = now
        seconds = len(media.payload) / (2 * max(1, media.channels) * max(MIN_RATE, media.sample_rate))
        if seconds > self._room:
            return False
        self._room -= seconds
        return True

    def _next_job(self) -> SoundJob | None:
        if not self._waiting:
            return None
        media, capture_time = self._waiting.popleft()
        outputs = [(output, output.variants()) for output in self._outputs.values() if output.needed]
        return SoundJob(media, capture_time, outputs, self._expected.percent)

    def measured_loss(self, loss: float, now: float) -> None:
        """Take the loss, 0 to 1, against which sound is to be protected."""
        self._expected.update(loss, now)

    def _work(self, job: SoundJob) -> list[Encoded]:
        orders: dict[str, list[tuple[TierEncoding, frozenset[bool]]]] = {}
        for order in sorted(job.outputs, key=lambda order: order[0].tier == "crowd"):  # see `_finish`
            orders.setdefault(order[0].codec, []).append(order)
        self._encoders = {codec: encoder for codec, encoder in self._encoders.items() if codec in orders}
        crowds = {output.codec for output, _ in job.outputs if output.tier == "crowd"}
        self._bundles = {codec: bundle for codec, bundle in self._bundles.items() if codec in crowds}
        try:
            segment = _segment(job)
        except MediaError as error:
            return [Encoded(output, (), 0.0, error) for output, _ in job.outputs]
        results = []
        for codec, wanted in orders.items():
            started = time.perf_counter()
            try:
                sounds: Sequence[EncodedSound] | MediaError = self._encode(segment, codec, job.expected_loss)
            except MediaError as error:
                self._encoders.pop(codec, None)
                self._bundles.pop(codec, None)
                sounds = error
            seconds = time.perf_counter() - started
            results += [self._packed(output, sounds, variants, seconds) for output, variants in wanted]
        return results

    def _encode(self, segment: Segment, codec: str, expected_loss: int) -> list[EncodedSound]:
        encoder = self._encoders.get(codec)
        if encoder is None:
            encoder = create_sound_encoder(codec, self._settings.opus_bitrate_bps, expected_loss)
            self._encoders[codec] = encoder
        encoder.expect_loss(expected_loss)
        return encoder.encode(segment)

    def _packed(
        self,
        output: TierEncoding,
        sounds: Sequence[EncodedSound] | MediaError,
        variants: frozenset[bool],
        seconds: float,
    ) -> Encoded:
        if isinstance(sounds, MediaError):
            return Encoded(output, (), 0.0, sounds)
        whole = True
        if output.tier == "crowd":
            bundle = self._bundles.get(output.codec)
            if bundle is None:
                samples = int(self._encoders[output.codec].rate * PACKET_SECONDS)
                bundle = self._bundles[output.codec] = SoundBundle(output.codec, samples)
            sounds = [complete for sound in sounds for complete in bundle.add(sound)]
            whole = bundle.empty
        frames = [_frame(output, sound) for sound in sounds]
        for frame in frames:
            for trailer in variants:
                frame.payloads(trailer)
        return Encoded(output, frames, seconds, whole=whole)

    def _admit(self, output: TierEncoding, frame: EncodedFrame) -> None:
        """Admit nobody: `_finish` does it between bundles."""

    def _finish(self, encoded: Encoded) -> None:
        """Move peers into the crowd or out of it between two bundles, when all of a codec have got the same sound."""
        super()._finish(encoded)
        if encoded.output.tier == "crowd" and encoded.whole and encoded.error is None:
            for output in self._outputs.values():
                if output.codec == encoded.output.codec:
                    output.arrive()


def _segment(job: SoundJob) -> Segment:
    media = job.media
    if media.codec != "pcm_s16le":
        raise UnsupportedCodecError(f"{media.codec} is not a sound format that can be encoded")
    if media.channels not in (1, 2) or media.sample_rate < MIN_RATE:
        raise PayloadError(f"{media.channels} channels at {media.sample_rate} Hz")
    if not media.payload or len(media.payload) % (2 * media.channels):
        raise PayloadError(f"{len(media.payload)} bytes are not whole samples of {media.channels} channels")
    samples = np.frombuffer(media.payload, "<i2").astype(np.int16, copy=False)
    return Segment(samples, media.sample_rate, media.channels, media.stamp, media.time, job.capture_time)


def _frame(output: TierEncoding, sound: EncodedSound) -> EncodedFrame:
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

"""Chooses the next sound of a microphone to encode: once for each codec in use; a crowd gets several packets in one."""

import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.opus_packet import OPUS_RATE
from lockstep.server.media.codecs.packetise import packetise_sound
from lockstep.server.media.codecs.sound_bundle import SoundBundle
from lockstep.server.media.codecs.sound_encoder import (
    PACKET_SECONDS,
    EncodedSound,
    Segment,
    SoundEncoder,
    create_sound_encoder,
)
from lockstep.server.media.encoding.encoder_worker import Encoded
from lockstep.server.media.encoding.opus_passing import OpusPassing, PassedSound
from lockstep.server.media.encoding.stream_encodings import StreamEncodings
from lockstep.server.media.encoding.tier_encoding import TierEncoding
from lockstep.server.media.errors import MediaError, PayloadError, UnsupportedCodecError
from lockstep.server.media.metrics import DropCounter
from lockstep.server.media.pipeline.frame import EncodedFrame
from lockstep.server.media.pipeline.stage import SourceFrame
from lockstep.server.media.quality.expected_loss import ExpectedLoss

__all__ = ["SoundEncoders", "SoundJob", "SoundQueue"]

QUEUE_SEGMENTS = 10
MIN_RATE = 8_000  # Hz


class SoundJob(NamedTuple):
    """One piece of sound for all encodings."""

    media: Media
    capture_time: float
    orders: list[tuple[TierEncoding, frozenset[bool]]]  # with the variants to be packetised in the worker
    expected_loss: int  # percent


class SoundQueue:
    """The newest pieces of sound. No I/O."""

    def __init__(self, encodings: StreamEncodings, expected_loss: ExpectedLoss, dropped: DropCounter) -> None:
        self._encodings = encodings
        self._expected_loss = expected_loss
        self._dropped = dropped
        self._waiting: deque[SourceFrame] = deque()

    def put(self, frame: SourceFrame) -> None:
        if len(self._waiting) >= QUEUE_SEGMENTS:
            self._waiting.popleft()
            self._dropped.count("encoder_busy")
        self._waiting.append(frame)

    def next_job(self) -> SoundJob | None:
        """Return the next job, decided now; None when there is none."""
        if not self._waiting:
            return None
        frame = self._waiting.popleft()
        orders = [(each, each.variants()) for each in self._encodings if each.needed]
        return SoundJob(frame.media, frame.capture_time, orders, self._expected_loss.percent)


class SoundEncoders:
    """An encoder for each codec in use; runs in the worker's thread.

    Opus that the robot has encoded goes unchanged to those who take Opus; it is decoded only for others.
    """

    def __init__(self, opus_bitrate_bps: int) -> None:
        self._opus_bitrate_bps = opus_bitrate_bps
        self._encoders: dict[str, SoundEncoder] = {}
        self._bundles: dict[str, SoundBundle] = {}  # of the codecs that a crowd takes
        self._passing = OpusPassing()

    def encode(self, job: SoundJob) -> Sequence[Encoded]:
        orders: dict[str, list[tuple[TierEncoding, frozenset[bool]]]] = {}
        for order in sorted(job.orders, key=lambda order: order[0].tier == "crowd"):  # see `_packed`
            orders.setdefault(order[0].codec, []).append(order)
        self._encoders = {codec: encoder for codec, encoder in self._encoders.items() if codec in orders}
        crowds = {encoding.codec for encoding, _ in job.orders if encoding.tier == "crowd"}
        self._bundles = {codec: bundle for codec, bundle in self._bundles.items() if codec in crowds}
        try:
            sound = self._passing.take(job.media, job.capture_time) if job.media.codec == "opus" else _segment(job)
        except MediaError as error:
            return [Encoded(encoding, (), error=error) for encoding, _ in job.orders]
        results = []
        for codec, wanted in orders.items():
            started = time.perf_counter()
            try:
                sounds: Sequence[EncodedSound] | MediaError = self._encode(sound, codec, job.expected_loss)
            except MediaError as error:
                self._encoders.pop(codec, None)
                self._bundles.pop(codec, None)
                sounds = error
            seconds = time.perf_counter() - started
            results += [self._packed(encoding, sounds, variants, seconds) for encoding, variants in wanted]
        return results

    def _encode(self, sound: Segment | PassedSound, codec: str, expected_loss: int) -> list[EncodedSound]:
        if isinstance(sound, PassedSound):
            if codec == "opus":
                self._encoders.pop(codec, None)
                return [sound.packet]
            segment = self._passing.decoded(sound)
        else:
            segment = sound
        encoder = self._encoders.get(codec)
        if encoder is None:
            encoder = create_sound_encoder(codec, self._opus_bitrate_bps, expected_loss)
            self._encoders[codec] = encoder
        encoder.expect_loss(expected_loss)
        return encoder.encode(segment)

    def _packed(
        self,
        encoding: TierEncoding,
        sounds: Sequence[EncodedSound] | MediaError,
        variants: frozenset[bool],
        seconds: float,
    ) -> Encoded:
        if isinstance(sounds, MediaError):
            return Encoded(encoding, (), error=sounds)
        moves = False
        if encoding.tier == "crowd":
            bundle = self._bundles.get(encoding.codec)
            if bundle is None:
                encoder = self._encoders.get(encoding.codec)
                samples = int((OPUS_RATE if encoder is None else encoder.rate) * PACKET_SECONDS)
                bundle = self._bundles[encoding.codec] = SoundBundle(encoding.codec, samples)
            sounds = [complete for sound in sounds for complete in bundle.add(sound)]
            # Peers move into the crowd or out of it between two bundles, when all of a codec have got the same sound.
            moves = bundle.empty
        frames = [_frame(encoding, sound) for sound in sounds]
        for frame in frames:
            for trailer in variants:
                frame.payloads(trailer)
        return Encoded(encoding, frames, seconds, moves=moves)


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


def _frame(encoding: TierEncoding, sound: EncodedSound) -> EncodedFrame:
    # Only the worker's thread calls this, so the encoding's last capture time has one writer.
    return EncodedFrame(
        sound.data,
        packetise_sound,
        keyframe=True,
        marker=sound.talkspurt,
        stamp=sound.stamp,
        capture_time=encoding.monotone(sound.capture_time),
        media_time=sound.media_time,
        time=sound.link_time,
    )

"""Places Opus that a robot has encoded on the stream's time line; decodes it for peers that take another codec."""

from typing import NamedTuple

from lockstep.protocol.messages import Media
from lockstep.server.media.codecs.opus_packet import OPUS_RATE, OpusDecoder, opus_samples
from lockstep.server.media.codecs.sound_encoder import EncodedSound, Segment
from lockstep.server.media.pipeline.media_clock import SoundClock

__all__ = ["OpusPassing", "PassedSound"]


class PassedSound(NamedTuple):
    """A packet as the robot made it."""

    packet: EncodedSound


class OpusPassing:
    """Of one microphone. Used from one thread, with packets in the order of their capture."""

    def __init__(self) -> None:
        self._clock = SoundClock(OPUS_RATE)
        self._has_begun = False
        self._decoder = OpusDecoder()

    def take(self, media: Media, capture_time: float) -> PassedSound:
        """Return the packet with its place in time.

        Raises:
            PayloadError: it is not an Opus packet.
        """
        position, continuous = self._clock.place(media.time, opus_samples(media.payload))
        talkspurt = not (continuous and self._has_begun)
        self._has_begun = True
        return PassedSound(EncodedSound(media.payload, position, media.stamp, capture_time, media.time, talkspurt))

    def decoded(self, sound: PassedSound) -> Segment:
        """Return the samples of a packet.

        Raises:
            PayloadError: it cannot be decoded.
        """
        packet = sound.packet
        samples = self._decoder.decode(packet.data)
        return Segment(samples, OPUS_RATE, 1, packet.stamp, packet.link_time, packet.capture_time)

"""Joins sound packets: a third of the packets, for peers that can bear a little more delay. No I/O."""

from lockstep.server.media.codecs.sound_encoder import EncodedSound

__all__ = ["BUNDLE_PACKETS", "SoundBundle"]

BUNDLE_PACKETS = 3  # 60 ms, the longest that a single Opus frame can have too
OPUS_CONFIGURATION, OPUS_CODE = 0xFC, 0x03  # of a packet's first byte (RFC 6716 3.1)
OPUS_VBR = 0x80  # each frame has its own length (RFC 6716 3.2.5)
ONE_BYTE_LENGTH = 252


class SoundBundle:
    """Takes the packets of one encoder in order. One that does not follow the held ones begins a new bundle."""

    def __init__(self, codec: str, packet_samples: int) -> None:
        """`packet_samples`: length of each packet, in the codec's RTP clock."""
        self._opus = codec == "opus"
        self._step = packet_samples
        self._held: list[EncodedSound] = []

    @property
    def empty(self) -> bool:
        return not self._held

    def add(self, sound: EncodedSound) -> list[EncodedSound]:
        """Add a packet and return the bundles that it completes: none, one or two."""
        complete = [] if self._follows(sound) else [self._take()]
        self._held.append(sound)
        if len(self._held) == BUNDLE_PACKETS:
            complete.append(self._take())
        return complete

    def _follows(self, sound: EncodedSound) -> bool:
        if not self._held:
            return True
        last = self._held[-1]
        if sound.talkspurt or sound.media_time != last.media_time + self._step:
            return False
        return not self._opus or (_is_single(last.data) and _is_single(sound.data) and _alike(last.data, sound.data))

    def _take(self) -> EncodedSound:
        """Return the held packets as one, with the stamp of the oldest sound."""
        held, self._held = self._held, []
        if len(held) == 1:
            return held[0]
        packets = [sound.data for sound in held]
        return held[0]._replace(data=_join_opus(packets) if self._opus else b"".join(packets))


def _is_single(packet: bytes) -> bool:
    """True if an Opus packet is a single frame (RFC 6716 3.2.2)."""
    return packet[:1] != b"" and packet[0] & OPUS_CODE == 0


def _alike(a: bytes, b: bytes) -> bool:
    """True if two Opus packets have frames of the same mode, bandwidth, length and channels."""
    return a[0] & OPUS_CONFIGURATION == b[0] & OPUS_CONFIGURATION


def _join_opus(packets: list[bytes]) -> bytes:
    """Join packets into one of many frames of different lengths (RFC 6716 3.2.5)."""
    frames = [packet[1:] for packet in packets]
    head = bytes((packets[0][0] | OPUS_CODE, OPUS_VBR | len(frames)))
    return head + b"".join(_length(len(frame)) for frame in frames[:-1]) + b"".join(frames)


def _length(size: int) -> bytes:
    """Encode the length of a frame (RFC 6716 3.2.1). The longest frame has 1275 bytes."""
    if size < ONE_BYTE_LENGTH:
        return bytes((size,))
    first = ONE_BYTE_LENGTH + (size & 3)
    return bytes((first, (size - first) // 4))

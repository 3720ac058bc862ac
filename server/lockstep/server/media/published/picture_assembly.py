"""Assembles pictures from RTP packets that come late, twice, in another order or not at all. No I/O, no clock is read.

A picture is passed on only if all of its packets have arrived, and all pictures that it builds on were passed on. So a
loss that is not repaired in time costs pictures until the next keyframe, and never shows a broken one.
"""

from collections.abc import Iterator
from typing import NamedTuple

from lockstep.rtc.rtp.wire.payloads import PayloadError
from lockstep.server.media.published.depacketise import PictureCodec, begins_picture, is_keyframe, join_payloads

__all__ = ["AssembledPicture", "MediaPacket", "PictureAssembly"]

CAPACITY = 1024  # packets that wait for missing ones
MOST_BYTES = 2_000_000  # of one picture
LEAST_PATIENCE, MOST_PATIENCE = 0.1, 0.6  # s of waiting for a missing packet
MARGIN = 0.05  # s beyond one and a half round trips
KEYFRAME_AGAIN = 0.5  # s until a keyframe is requested again
HALF = 1 << 15


class MediaPacket(NamedTuple):
    """The relevant fields of an RTP packet."""

    sequence: int  # 16 bits
    timestamp: int  # 32 bits, 90 kHz
    marker: bool  # the last of its picture
    payload: bytes


class AssembledPicture(NamedTuple):
    data: bytes
    keyframe: bool
    media_time: float  # s, from the RTP timestamp, on the sender's clock
    arrival: float  # s, of its first packet


class _Kept(NamedTuple):
    packet: MediaPacket
    arrival: float


class PictureAssembly:
    """Call `take` for each packet and `look` at intervals, and `wants_keyframe` after each call.

    Attributes:
        lost: packets that never came, or came too late
        malformed: pictures that are not valid in their codec
    """

    def __init__(self, codec: PictureCodec) -> None:
        self.lost = 0
        self.malformed = 0
        self._codec = codec
        self._kept: dict[int, _Kept] = {}  # by sequence number without wraps
        self._next: int | None = None  # the first packet that is not part of a picture yet
        self._scanned = 0  # from `_next` up to this one, all packets are here and of one picture
        self._newest = 0
        self._missing: dict[int, float] = {}  # time from which each is missing
        self._broken = True  # until a keyframe
        self._tainted: int | None = None  # timestamp of a picture whose beginning may be missing
        self._asked_keyframe = float("-inf")
        self._clock = _MediaTime()

    def take(self, packet: MediaPacket, now: float, round_trip: float = 0.1) -> list[AssembledPicture]:
        """Take a packet and return the pictures that it completes. `round_trip`: to the sender, in s."""
        number = self._unwrapped(packet.sequence)
        if self._next is None:
            self._next, self._scanned, self._newest = number, number, number - 1
            if not begins_picture(self._codec, packet.payload):
                self._tainted = packet.timestamp
        if number < self._next or number in self._kept:
            return self.look(now, round_trip)  # repeated, or too late
        if number >= self._next + CAPACITY:
            self._begin_anew(number, packet)
        self._kept[number] = _Kept(packet, now)
        self._missing.pop(number, None)
        for absent in range(self._newest + 1, number):
            self._missing[absent] = now
        self._newest = max(self._newest, number)
        return self.look(now, round_trip)

    def look(self, now: float, round_trip: float = 0.1) -> list[AssembledPicture]:
        """Return the pictures that are whole now; packets missing for too long are given up."""
        found = [*self._whole_pictures()]
        patience = min(MOST_PATIENCE, max(LEAST_PATIENCE, 1.5 * round_trip + MARGIN))
        while (hole := self._missing.get(self._scanned)) is not None and now - hole > patience:
            self._give_up()
            found += self._whole_pictures()
        return found

    def wants_keyframe(self, now: float) -> bool:
        """True if a keyframe is to be requested now (RFC 4585 6.3.1); it then counts as requested."""
        if not self._broken or self._next is None or now - self._asked_keyframe < KEYFRAME_AGAIN:
            return False
        self._asked_keyframe = now
        return True

    def lost_picture(self) -> None:
        """Note that a picture could not be used: pictures that build on it cannot either."""
        self._broken = True

    def _unwrapped(self, sequence: int) -> int:
        if self._next is None:
            return sequence
        return self._newest + ((sequence - self._newest + HALF) & 0xFFFF) - HALF

    def _begin_anew(self, number: int, packet: MediaPacket) -> None:
        """Begin anew at packet `number`: too many packets are missing to wait for them."""
        self.lost += len(self._missing)
        self._kept.clear()
        self._missing.clear()
        self._next, self._scanned, self._newest = number, number, number - 1
        self._break(packet)

    def _break(self, first: MediaPacket) -> None:
        """Wait for a keyframe: a packet before `first` is missing for good."""
        self._broken = True
        self._tainted = None if begins_picture(self._codec, first.payload) else first.timestamp

    def _give_up(self) -> None:
        """Give up the missing packets and their picture."""
        for number in range(self._next or 0, self._scanned):
            del self._kept[number]
        while self._scanned in self._missing:
            del self._missing[self._scanned]
            self._scanned += 1
            self.lost += 1
        self._next = self._scanned
        if self._next in self._kept:
            self._break(self._kept[self._next].packet)

    def _whole_pictures(self) -> Iterator[AssembledPicture]:
        while (run := self._next_run()) is not None:
            packets = [self._kept.pop(number) for number in run]
            self._next = self._scanned = run.stop
            if (picture := self._picture(packets)) is not None:
                yield picture

    def _next_run(self) -> range | None:
        """Return the packets of the next picture, when all of them are here."""
        if self._next is None or self._next not in self._kept:
            return None
        timestamp = self._kept[self._next].packet.timestamp
        while (kept := self._kept.get(self._scanned)) is not None:
            if kept.packet.timestamp != timestamp:
                return range(self._next, self._scanned)  # its sender set no marker
            self._scanned += 1
            if kept.packet.marker:
                return range(self._next, self._scanned)
        return None

    def _picture(self, packets: list[_Kept]) -> AssembledPicture | None:
        timestamp = packets[0].packet.timestamp
        media_time = self._clock.seconds(timestamp)
        if timestamp == self._tainted:
            return None
        payloads = [each.packet.payload for each in packets if each.packet.payload]
        if not payloads:
            return None  # padding, to probe the path
        data = self._joined(payloads)
        if data is None:
            self.malformed += 1
            self._broken = True
            return None
        keyframe = is_keyframe(self._codec, data)
        if self._broken and not keyframe:
            return None
        self._broken, self._tainted = False, None
        return AssembledPicture(data, keyframe, media_time, min(each.arrival for each in packets))

    def _joined(self, payloads: list[bytes]) -> bytes | None:
        """Join the payloads; None if they are not of this codec, or too large."""
        if sum(map(len, payloads)) > MOST_BYTES:
            return None
        try:
            return join_payloads(self._codec, payloads)
        except PayloadError:
            return None


class _MediaTime:
    """RTP timestamps as seconds that do not wrap."""

    def __init__(self) -> None:
        self._last: int | None = None

    def seconds(self, timestamp: int) -> float:
        if self._last is None:
            self._last = timestamp
        else:
            self._last += ((timestamp - self._last + (1 << 31)) & 0xFFFFFFFF) - (1 << 31)
        return self._last / 90_000

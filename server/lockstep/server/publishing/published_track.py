"""The track of one publisher: from the packets of its section to the decoder."""

import time
from contextlib import suppress

from lockstep.rtc.endpoint import Connection
from lockstep.rtc.peer import PeerNotReady
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.server.media.published.encoded_wire import PICTURES, Encoded
from lockstep.server.media.published.incoming_pictures import IncomingPictures
from lockstep.server.media.published.picture_assembly import MediaPacket
from lockstep.server.media.sources.reader_process import ReaderProcess

__all__ = ["PublishedTrack"]

MOST_BPS = 6_000_000  # bit rate that a publisher is asked not to exceed


class PublishedTrack:
    """One RTP stream of pictures. Packets of any other are counted and ignored.

    Attributes:
        connection: the publisher's
        pictures: what its packets become
    """

    def __init__(self, connection: Connection, mid: str, pictures: IncomingPictures, decoder: ReaderProcess) -> None:
        """`mid`: of the section in which the pictures come."""
        self.connection = connection
        self.pictures = pictures
        self._mid = mid
        self._decoder = decoder
        self._ssrc: int | None = None  # None before the first packet
        self._foreign = 0  # packets of another source
        connection.limit(mid, MOST_BPS)

    @property
    def foreign(self) -> int:
        """Packets of other streams."""
        streams = self.connection.peer.media.streams
        return self._foreign + streams.counts["rtp_unknown"] + streams.incoming[self._mid].ignored

    @property
    def flooded(self) -> int:
        """Packets dropped because they exceeded the allowed rate."""
        return self.pictures.flooded + self.connection.counts["receive_overflow"]

    def take(self, packet: RtpPacket) -> None:
        self._ssrc = packet.ssrc if self._ssrc is None else self._ssrc
        if packet.ssrc != self._ssrc:
            self._foreign += 1
            return
        taken = MediaPacket(packet.sequence_number, packet.timestamp, packet.marker, packet.payload)
        self._decode(self.pictures.take(taken, time.monotonic()))

    def look(self, now: float) -> None:
        """Give up packets missing for too long, and ask for a keyframe if one is needed."""
        self._decode(self.pictures.look(now))
        if self.pictures.wants_keyframe(now):
            with suppress(PeerNotReady):  # it has ended
                self.connection.request_keyframe(self._mid)

    def observe(self, round_trip: float) -> None:
        """Take a round trip in s that was measured on its path."""
        self.pictures.path.observe(round_trip, time.monotonic())
        self.connection.peer.share.round_trip.measure(round_trip)

    def _decode(self, pictures: list[Encoded]) -> None:
        for picture in pictures:
            if not self._decoder.write(PICTURES.encode(picture)):
                self.pictures.lost_picture()  # the decoder is too slow; it goes on with a keyframe

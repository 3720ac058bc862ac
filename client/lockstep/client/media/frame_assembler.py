"""Assembles RTP packets into encoded frames, as early as possible and never a broken one. No I/O.

A video frame is complete with its marker packet (RFC 3550 5.1); waiting for the next frame to begin, as a general
jitter buffer does, would cost one frame time of delay. After a frame that could not be completed nothing is given
out before the next keyframe: a decoder would draw a picture that the robot never saw.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

__all__ = ["Assembler", "AudioAssembler", "EncodedFrame", "MediaPacket", "VideoAssembler"]

SEQUENCES = 1 << 16
WINDOW = 1024  # packets that may wait for a missing one
PATIENCE = 0.3  # s to wait for a missing packet, at least
PATIENT_TRIPS, MOST_PATIENCE = 2.2, 1.6  # round trips, s; a second try over a satellite takes 1.2 s
KEYFRAME_RETRY = 0.4  # s between two keyframe requests, at least; and a round trip and a half


class MediaPacket(NamedTuple):
    """One RTP packet without its payload format."""

    sequence: int
    timestamp: int
    marker: bool
    data: bytes
    stamp: int | None  # from its header extension; None without one
    captured: float | None = None  # s since 1970, from its header extension; None without one


class EncodedFrame(NamedTuple):
    """One access unit or audio packet."""

    timestamp: int
    data: bytes
    stamp: int | None
    captured: float | None = None  # s since 1970 on the sender's clock


class Assembler(Protocol):
    """The interface of both assemblers."""

    lost: int
    round_trip: float  # s to the sender and back; 0 while unknown

    def add(self, packet: MediaPacket, now: float) -> list[EncodedFrame]: ...

    def wants_keyframe(self, now: float) -> bool: ...

    def broken(self) -> None: ...


class AudioAssembler:
    """Gives out every packet as a frame at once, and leaves out late ones."""

    def __init__(self) -> None:
        self.lost = 0
        self.round_trip = 0.0
        self._newest: int | None = None

    def add(self, packet: MediaPacket, now: float) -> list[EncodedFrame]:
        if self._newest is not None:
            ahead = (packet.sequence - self._newest) % SEQUENCES
            if ahead == 0:
                return []
            if ahead >= SEQUENCES // 2:
                return []
            self.lost += ahead - 1
        self._newest = packet.sequence
        return [EncodedFrame(packet.timestamp, packet.data, packet.stamp, packet.captured)]

    def wants_keyframe(self, now: float) -> bool:
        return False

    def broken(self) -> None:
        """Do nothing: every audio packet decodes without others."""


class VideoAssembler:
    """Gives out video frames in order; other parts ask for missing packets.

    Call `add` with every packet, then `wants_keyframe`.
    """

    def __init__(self, is_keyframe: Callable[[bytes], bool]) -> None:
        self.lost = 0  # packets given up
        self.round_trip = 0.0  # s
        self.undecodable = 0  # complete frames left out because a keyframe is missing
        self._is_keyframe = is_keyframe
        self._packets: dict[int, MediaPacket] = {}
        self._start: int | None = None  # sequence number that begins the next frame
        self._end = 0  # number of the first missing packet after `_start`
        self._gap_since: float | None = None  # time since which the first missing packet has held up all others
        self._gap_at = 0  # number of that packet
        self._needs_keyframe = True
        self._keyframe_due = float("inf")

    def add(self, packet: MediaPacket, now: float) -> list[EncodedFrame]:
        """Return the frames that `packet` completes."""
        if self._start is None:
            self._begin_at(packet.sequence)
            self._keyframe_due = now + self._keyframe_retry  # the sender begins with one: it may be on its way
        elif (packet.sequence - self._start) % SEQUENCES >= SEQUENCES // 2 or packet.sequence in self._packets:
            return []  # belongs to a frame already given out or given up, or is a copy
        elif self._offset(packet.sequence) >= WINDOW or self._waited_too_long(now):
            self._give_up(packet.sequence)
        self._packets[packet.sequence] = packet
        frames = self._complete()
        self._note_gap(now)
        return frames

    def wants_keyframe(self, now: float) -> bool:
        """True if it is time to ask for a keyframe."""
        if not self._needs_keyframe or now < self._keyframe_due:
            return False
        self._keyframe_due = now + self._keyframe_retry
        return True

    @property
    def _keyframe_retry(self) -> float:
        return max(KEYFRAME_RETRY, 1.5 * self.round_trip)

    def broken(self) -> None:
        """Note that a frame that was given out did not reach the decoder, or failed there."""
        self._needs_keyframe = True

    def _begin_at(self, sequence: int) -> None:
        self._packets.clear()
        self._start = self._end = sequence
        self._gap_since = None

    def _give_up(self, sequence: int) -> None:
        """Start again at `sequence`, with a keyframe."""
        self.lost += max(1, self._offset(sequence) - len(self._packets))
        self._needs_keyframe = True
        self._begin_at(sequence)

    def _offset(self, sequence: int) -> int:
        return (sequence - (self._start or 0)) % SEQUENCES

    def _waited_too_long(self, now: float) -> bool:
        patience = max(PATIENCE, min(MOST_PATIENCE, PATIENT_TRIPS * self.round_trip))
        return self._gap_since is not None and now - self._gap_since > patience

    def _note_gap(self, now: float) -> None:
        waiting = self._offset(self._end) < len(self._packets)
        if not waiting:
            self._gap_since = None
            return
        if self._gap_since is None or self._gap_at != self._end:  # over a long path one gap opens before another closes
            self._gap_since, self._gap_at = now, self._end

    def _complete(self) -> list[EncodedFrame]:
        frames: list[EncodedFrame] = []
        while (packet := self._packets.get(self._end)) is not None:
            self._end = (self._end + 1) % SEQUENCES
            if packet.marker and (frame := self._take_frame()) is not None:
                frames.append(frame)
        return frames

    def _take_frame(self) -> EncodedFrame | None:
        """Take the packets from `_start` up to `_end` out as one frame."""
        count = self._offset(self._end)
        first = self._start or 0
        parts = [self._packets.pop((first + offset) % SEQUENCES) for offset in range(count)]
        self._start = self._end
        data = b"".join(part.data for part in parts)
        if self._needs_keyframe:
            if not self._is_keyframe(data):
                self.undecodable += 1
                return None
            self._needs_keyframe = False
        return EncodedFrame(parts[0].timestamp, data, parts[0].stamp, parts[0].captured)

"""Decides which voice the robot plays: only that of the holder of the control seat. No I/O.

| a packet | |
|---|---|
| of a peer without the control seat | left out: `no_seat` |
| longer than Opus allows | left out: `too_large` |
| older than the last one, or the same again | left out: `late` |
| beyond the rate that speech needs | left out: `too_often` |
| any other | played |
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

from lockstep.protocol.console import Voice
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["SPEAKS_FOR", "TalkbackArbiter", "VoiceOutcome", "VoicePacket"]

MAX_PACKET = 1275  # bytes, RFC 6716 3.4: the maximum of one frame
RATE, BURST = 110.0, 20.0  # packets a second; the shortest are 10 ms
SPEAKS_FOR = 0.4  # s after the last packet

VoiceOutcome = Literal["played", "no_seat", "too_large", "late", "too_often"]


class VoicePacket(NamedTuple):
    """One Opus packet."""

    sequence_number: int  # 16 bits
    payload: bytes


class TalkbackArbiter:
    """Call `packet` for each packet that comes; play it if the outcome is "played". `state` is for participants."""

    def __init__(self, holds: Callable[[str], bool]) -> None:
        """`holds` returns whether a peer has the control seat."""
        self.trouble = ""  # reason that nobody can be heard
        self._holds = holds
        self._speaker = ""  # id of the peer
        self._name = ""
        self._sequence: int | None = None  # of its last packet
        self._heard_at = float("-inf")
        self._budget = TokenBucket(RATE, BURST)

    def packet(self, peer: str, name: str, packet: VoicePacket, now: float) -> VoiceOutcome:
        if not self._holds(peer):
            return "no_seat"
        if len(packet.payload) > MAX_PACKET:
            return "too_large"
        if not self._budget.take(now):
            return "too_often"
        if peer == self._speaker and self._sequence is not None and now - self._heard_at < SPEAKS_FOR:
            ahead = (packet.sequence_number - self._sequence) & 0xFFFF
            if not 0 < ahead < 0x8000:
                return "late"
        self._speaker, self._name = peer, name
        self._sequence, self._heard_at = packet.sequence_number, now
        return "played"

    def speaks(self, now: float) -> bool:
        """Return whether somebody speaks; a peer that has lost the seat does not."""
        return now - self._heard_at < SPEAKS_FOR and self._holds(self._speaker)

    def state(self, now: float) -> Voice:
        if self.trouble or not self.speaks(now):
            return Voice(trouble=self.trouble)
        return Voice(peer=self._speaker, name=self._name)

"""The receiving half of an association: chunks to messages, and the times of acknowledgements (RFC 9260 6.2)."""

from collections import Counter

from lockstep.rtc.sctp.errors import ProtocolViolation
from lockstep.rtc.sctp.events import MessageReceived
from lockstep.rtc.sctp.receiving.reassembly import Reassembly
from lockstep.rtc.sctp.receiving.received import ReceivedTsns
from lockstep.rtc.sctp.serial import MASK_32
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import (
    IMMEDIATE,
    Data,
    ForwardTsn,
    InterleavedData,
    InterleavedForwardTsn,
    encode_plain_sack,
)

__all__ = ["PLAIN_SACK", "Receiver"]

PLAIN_SACK = 16  # bytes of a SACK without gaps or duplicates
MOST_GAPS = 200  # in one SACK, which then fits into a packet beside some control chunks


class Receiver:
    """Turns chunks into messages, which leave through `messages`. After the chunks of a packet, call `packet_ends`.

    A SACK is due at `acknowledge_at`; before that it may travel with data while `is_pending`.
    """

    def __init__(self, settings: SctpSettings, initial_tsn: int, interleaving: bool, counts: Counter[str]) -> None:
        self._settings = settings
        self._interleaving = interleaving
        self._counts = counts
        self._delay = settings.acknowledgement_delay
        self._window = settings.receive_window
        self._packets = 0  # packets with data, since the last SACK
        self._data_came = False  # True: this packet has data
        self._hurry = False
        self.received = ReceivedTsns(initial_tsn, settings)
        self.reassembly = Reassembly(settings, interleaving)
        self.acknowledge_at: float | None = None

    @property
    def is_pending(self) -> bool:
        return self._packets > 0

    @property
    def messages(self) -> list[MessageReceived]:
        """Whole messages; the caller that takes them clears the list."""
        return self.reassembly.delivered

    def receive_data(self, chunk: Data | InterleavedData, now: float) -> bool:
        """Take one DATA or I-DATA chunk. Return False if its stream is out of bounds, which is to be reported (6.5).

        Raises:
            ProtocolViolation: the peer broke a rule.
        """
        if (chunk.kind != 0) is not self._interleaving:
            raise ProtocolViolation("interleaving_violated")  # RFC 8260 2.2.1
        if not chunk.payload:
            raise ProtocolViolation("empty_data")  # RFC 9260 6.2
        self._data_came = True
        received = self.received
        tsn = received.unwrap(chunk.tsn)
        if self.reassembly.held and self._is_too_much(len(chunk.payload), tsn):
            return True
        problem = received.take(tsn, now)
        if problem:
            self._counts[problem] += 1
            self._hurry = True
            return True
        if chunk.flags & IMMEDIATE:
            self._hurry = True
        if chunk.stream >= self._settings.max_streams:
            self._counts["invalid_stream"] += 1
            return False
        self.reassembly.push(chunk, tsn)
        return True

    def _is_too_much(self, size: int, tsn: int) -> bool:
        """True if a chunk is beyond the window and dropped; never the one that all others wait for."""
        held = self.reassembly.held
        if held > 2 * self._window:
            raise ProtocolViolation("receive_window_exceeded")
        if held + size <= self._window or tsn == self.received.cumulative + 1:
            return False
        self._counts["window_full"] += 1
        self._hurry = True
        return True

    def receive_forward_tsn(self, chunk: ForwardTsn | InterleavedForwardTsn, now: float) -> None:
        """Take FORWARD TSN or I-FORWARD-TSN (RFC 3758 3.6, RFC 8260 2.3.1).

        Raises:
            ProtocolViolation: the other kind than was agreed.
        """
        if isinstance(chunk, InterleavedForwardTsn) is not self._interleaving:
            raise ProtocolViolation("interleaving_violated")
        self._data_came = self._hurry = True
        cumulative = self.received.unwrap(chunk.cumulative)
        if cumulative <= self.received.cumulative:
            return  # an old one
        self.received.forward(cumulative, now)
        skips = [skip for skip in chunk.skips if skip.stream < self._settings.max_streams]
        self.reassembly.forward(self.received.cumulative, skips)

    def packet_ends(self, now: float) -> bool:
        """Decide when to acknowledge. Return True if the packet had data."""
        if not self._data_came:
            return False
        self._data_came = False
        self._packets += 1
        if self.received.has_gaps:
            self._skip_what_was_given_up(now)
            self._hurry = True  # 6.7: the sender is to know of a hole
        if self._hurry or self._packets >= 2 or self._delay <= 0:
            self._hurry = False
            self.acknowledge_at = now
        elif self.acknowledge_at is None:
            self.acknowledge_at = now + self._delay
        return True

    def _skip_what_was_given_up(self, now: float) -> None:
        last = self.received.given_up(now)
        if last is not None and not self.reassembly.waits_in_order:
            self._counts["given_up_by_peer"] += 1
            self.received.forward(last, now)
            self.reassembly.forward(last, [])

    def take_sack(self) -> bytes:
        """Return the SACK chunk, which leaves now."""
        self._packets = 0
        self.acknowledge_at = None
        received, window = self.received, max(0, self._window - self.reassembly.held)
        if received.is_plain:
            return encode_plain_sack(received.cumulative & MASK_32, window)
        return received.sack(window, MOST_GAPS).encode()

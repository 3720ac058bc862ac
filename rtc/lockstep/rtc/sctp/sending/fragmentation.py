"""Cuts messages into chunks, and numbers both (RFC 9260 6.5 and 6.9, RFC 8260 2.2)."""

from lockstep.rtc.sctp.sending.outgoing import ABANDONED, Outgoing
from lockstep.rtc.sctp.sending.send_queue import Message
from lockstep.rtc.sctp.serial import MASK_16, MASK_32
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import (
    BEGIN,
    DATA_HEADER,
    END,
    INTERLEAVED_HEADER,
    UNORDERED,
    encode_data,
    encode_interleaved,
)
from lockstep.rtc.sctp.wire.packet import COMMON_HEADER

__all__ = ["WHOLE", "Fragmentation"]

WHOLE = BEGIN | END


class Fragmentation:
    """The counterpart of the peer's `Reassembly`. `next_tsn` is unwrapped; `largest`: payload of a chunk that fills a
    packet."""

    def __init__(self, settings: SctpSettings, initial_tsn: int) -> None:
        self.next_tsn = initial_tsn
        self.interleaving = False
        self.header = DATA_HEADER
        self._room = settings.max_packet - COMMON_HEADER
        self.largest = self._room - self.header
        self._sequences: dict[tuple[int, bool], int] = {}  # numbers of the next messages

    def peer_is(self, *, interleaving: bool) -> None:
        self.interleaving = interleaving
        self.header = INTERLEAVED_HEADER if interleaving else DATA_HEADER
        self.largest = self._room - self.header

    def chunks(self, message: Message, *, whole: bool) -> list[Outgoing]:
        """Return the message's next chunk, or all of them. They have their TSNs from here on."""
        payload, largest, newest = message.payload, self.largest, message.newest_wins
        if message.ordered or self.interleaving:
            self._number(message)
        unordered = 0 if message.ordered else UNORDERED
        if len(payload) <= largest:
            chunk = Outgoing(self.next_tsn, WHOLE | unordered, message, 0, payload, newest)
            self.next_tsn += 1
            return [chunk]
        chunks = []
        start = message.taken
        while start < len(payload):
            end = min(start + largest, len(payload))
            flags = (0 if start else BEGIN) | (END if end == len(payload) else 0) | unordered
            chunks.append(Outgoing(self.next_tsn, flags, message, start // largest, payload[start:end], newest))
            self.next_tsn += 1
            start = end
            if not whole:
                break
        message.chunks = [*(message.chunks or ()), *chunks]
        return chunks

    def _number(self, message: Message) -> None:
        """Give a message the next number on its stream, before its first fragment."""
        if not message.taken:
            key = message.stream, not message.ordered
            message.sequence = self._sequences.get(key, 0)
            self._sequences[key] = message.sequence + 1

    def abandoned_rest(self, message: Message, unordered: int) -> Outgoing:
        """Return a TSN in the place of the fragments that have none yet. The peer may have all others by now, and would
        take a FORWARD TSN that ends with them for an old one."""
        rest = Outgoing(self.next_tsn, END | unordered, message, 0, b"", message.newest_wins)
        rest.state = ABANDONED
        self.next_tsn += 1
        return rest

    def encode(self, chunk: Outgoing) -> bytes:
        message, tsn = chunk.message, chunk.tsn & MASK_32
        if self.interleaving:
            sequence = message.sequence & MASK_32
            either = message.protocol if chunk.flags & BEGIN else chunk.fragment
            return encode_interleaved(tsn, chunk.flags, message.stream, sequence, either, chunk.payload)
        return encode_data(
            tsn, chunk.flags, message.stream, message.sequence & MASK_16, message.protocol, chunk.payload
        )

    def reset(self, streams: tuple[int, ...]) -> None:
        """Number the messages of these streams from 0 again (RFC 6525 5.2.7)."""
        for stream in streams:
            for unordered in (False, True):
                self._sequences.pop((stream, unordered), None)

"""Resets streams, which is the way in which data channels close (RFC 6525, RFC 8831 6.7)."""

from dataclasses import dataclass
from struct import Struct

from lockstep.rtc.sctp.events import Event, OutgoingStreamsReset, StreamsReset
from lockstep.rtc.sctp.serial import MASK_32, unwrap
from lockstep.rtc.sctp.wire.chunks import Reconfig
from lockstep.rtc.sctp.wire.parameters import (
    ADD_INCOMING_STREAMS,
    ADD_OUTGOING_STREAMS,
    INCOMING_RESET_REQUEST,
    OUTGOING_RESET_REQUEST,
    RECONFIG_RESPONSE,
    TSN_RESET_REQUEST,
    Parameter,
)

__all__ = ["StreamReset"]

MOST_STREAMS = 128  # in one request
MOST_ANSWERS = 16  # to one packet

# Results, RFC 6525 4.4
NOTHING_TO_DO = 0
PERFORMED = 1
DENIED = 2
REQUEST_IN_PROGRESS = 4
BAD_SEQUENCE_NUMBER = 5
IN_PROGRESS = 6

_request = Struct("!LLL")
_response = Struct("!LL")
_word = Struct("!L")


@dataclass(slots=True)
class _Request:
    """A request to reset the sender's outgoing streams. Numbers are unwrapped."""

    number: int
    last_tsn: int
    streams: tuple[int, ...]


class StreamReset:
    """Requests of this end, one at a time (5.1.1), and answers to the peer. `answers` are due at once; drained."""

    def __init__(self, own_initial_tsn: int, peer_initial_tsn: int) -> None:
        self._wanted: list[int] = []
        self._request: _Request | None = None
        self._next_number = own_initial_tsn  # RFC 6525 4.1
        self._tries = 0
        self._peer_number = peer_initial_tsn  # of the next request of this end (RFC 6525 4.1)
        self._last_result = NOTHING_TO_DO
        self._deferred: _Request | None = None  # of the peer, until its last message has come
        self.due_at: float | None = None
        self.answers: list[Parameter] = []

    def ask(self, streams: tuple[int, ...], now: float) -> None:
        """Reset these outgoing streams, whose messages have all been numbered."""
        self._wanted += [stream for stream in streams if stream not in self._wanted]
        if self._request is None:
            self.due_at = now

    def next_request(self, last_tsn: int, now: float) -> Reconfig | None:
        """Return the request that is due. `last_tsn` is the last that this end has assigned. Call `sent` afterwards."""
        if self.due_at is None or now < self.due_at:
            return None
        if self._request is None:
            streams, self._wanted = tuple(self._wanted[:MOST_STREAMS]), self._wanted[MOST_STREAMS:]
            self._request = _Request(self._next_number, last_tsn, streams)
            self._next_number += 1
        request = self._request
        body = _request.pack(request.number & MASK_32, (self._peer_number - 1) & MASK_32, request.last_tsn & MASK_32)
        streams_packed = b"".join(number.to_bytes(2, "big") for number in request.streams)
        return Reconfig([(OUTGOING_RESET_REQUEST, body + streams_packed)])

    def sent(self, due_again: float) -> None:
        self.due_at = due_again
        self._tries += 1

    @property
    def tries(self) -> int:
        """The number of times that the current request was sent."""
        return self._tries

    def receive(self, chunk: Reconfig, cumulative: int, now: float) -> list[Event]:
        """Take a RE-CONFIG chunk; `cumulative` is the last TSN before the first missing one."""
        events: list[Event] = []
        for kind, value in chunk.parameters:
            if kind == RECONFIG_RESPONSE and len(value) >= _response.size:
                number, result = _response.unpack_from(value)
                events += self._take_answer(number, result, now)
            elif kind == OUTGOING_RESET_REQUEST and len(value) >= _request.size:
                events += self._asked(value, cumulative)
            elif kind in (INCOMING_RESET_REQUEST, TSN_RESET_REQUEST, ADD_INCOMING_STREAMS) and len(value) >= 4:
                self._take_turn(_word.unpack_from(value)[0], DENIED)
            elif kind == ADD_OUTGOING_STREAMS and len(value) >= 4:
                # Streams cost nothing before they are used, and their number has its own bound.
                self._take_turn(_word.unpack_from(value)[0], PERFORMED)
        return events

    def _take_answer(self, number: int, result: int, now: float) -> list[Event]:
        request = self._request
        if request is None or number != request.number & MASK_32:
            return []
        if result in (IN_PROGRESS, REQUEST_IN_PROGRESS):
            return []  # 5.2.7: asked again when the time has come
        self._request = None
        self._tries = 0
        self.due_at = now if self._wanted else None
        return [OutgoingStreamsReset(request.streams, result in (NOTHING_TO_DO, PERFORMED))]

    def _take_turn(self, wire_number: int, result: int) -> bool:
        """Answer a request. Return True if it is the next one. The last one is answered again as it was (5.2.1)."""
        number = unwrap(wire_number, self._peer_number)
        is_next = number == self._peer_number and self._deferred is None
        if is_next:
            self._peer_number += 1
            self._last_result = result
        elif number == self._peer_number:
            result = REQUEST_IN_PROGRESS
        elif number == self._peer_number - 1:
            result = self._last_result
        else:
            result = BAD_SEQUENCE_NUMBER
        if len(self.answers) < MOST_ANSWERS:
            self.answers.append((RECONFIG_RESPONSE, _response.pack(wire_number, result)))
        return is_next

    def _asked(self, value: bytes, cumulative: int) -> list[Event]:
        number, _, last_tsn = _request.unpack_from(value)
        numbers = value[_request.size :]
        streams = tuple(int.from_bytes(numbers[at : at + 2], "big") for at in range(0, len(numbers) - 1, 2))
        last = unwrap(last_tsn, cumulative)
        complete = cumulative >= last
        if not self._take_turn(number, PERFORMED if complete else IN_PROGRESS):
            return []
        if complete:
            return [StreamsReset(streams)]
        self._deferred = _Request(number, last, streams)
        return []

    def advanced(self, cumulative: int) -> list[Event]:
        """Note that all chunks up to `cumulative` have arrived: the peer's request may be complete now (5.2.2 E2)."""
        request = self._deferred
        if request is None or cumulative < request.last_tsn:
            return []
        self._deferred = None
        self._last_result = PERFORMED
        self.answers.append((RECONFIG_RESPONSE, _response.pack(request.number, PERFORMED)))
        return [StreamsReset(request.streams)]

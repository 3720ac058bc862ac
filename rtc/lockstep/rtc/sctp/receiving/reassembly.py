"""Joins fragments into messages, and puts ordered messages into their order (RFC 9260 6.5, 6.6, 6.9; RFC 8260 2.2)."""

from dataclasses import dataclass, field

from lockstep.rtc.sctp.errors import ProtocolViolation
from lockstep.rtc.sctp.events import MessageReceived
from lockstep.rtc.sctp.serial import MASK_16, MASK_32, unwrap
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import BEGIN, END, UNORDERED, Data, InterleavedData, Skip

__all__ = ["Reassembly"]

OVERHEAD = 256  # bytes that a chunk costs beyond its payload, so that many small ones are no way around the bound

# The place of a fragment, apart from its number: DATA's number is its TSN, I-DATA's counts within its message.
_Space = tuple[int, bool, int] | None
_DATA: _Space = None


@dataclass(slots=True, eq=False)
class _Run:
    """Fragments of one message without a hole between them."""

    first: int
    last: int
    begins: bool
    ends: bool
    size: int
    protocol: int
    sequence: int  # unwrapped
    chunk: Data | InterleavedData  # any of them
    payloads: list[bytes] = field(default_factory=list)


@dataclass(slots=True)
class _Stream:
    """A stream's ordered messages. `expected` is unwrapped; `held` are complete ones that wait for an earlier one."""

    expected: int = 0
    unordered: int = 0  # identifiers of I-DATA's unordered messages are near this
    skipped: int = -1  # the last ordered message that the peer has given up
    skipped_unordered: int = -1  # the last of I-DATA's unordered ones
    held: dict[int, MessageReceived] = field(default_factory=dict)


class Reassembly:
    """Joins fragments into messages, which leave by `delivered`. `held`: bytes of incomplete and early ones."""

    def __init__(self, settings: SctpSettings, interleaving: bool) -> None:
        self._max_message = settings.max_receive_message
        self._sequence_mask = MASK_32 if interleaving else MASK_16
        self._streams: dict[int, _Stream] = {}
        self._starts: dict[tuple[_Space, int], _Run] = {}
        self._ends: dict[tuple[_Space, int], _Run] = {}
        self.held = 0
        self.delivered: list[MessageReceived] = []

    @property
    def waits_in_order(self) -> bool:
        """True if a complete message waits for an earlier one of its stream."""
        return any(stream.held for stream in self._streams.values())

    def push(self, chunk: Data | InterleavedData, tsn: int) -> None:
        """Take a chunk that had not come before; `tsn` is unwrapped.

        Raises:
            ProtocolViolation: the message is larger than the peer was told.
        """
        flags = chunk.flags
        if flags & (BEGIN | END) == BEGIN | END:
            if flags & UNORDERED:
                self.delivered.append(MessageReceived(chunk.stream, chunk.protocol, chunk.payload))
                return
            sequence = self._unwrap(chunk)
            self._complete(MessageReceived(chunk.stream, chunk.protocol, chunk.payload), False, sequence)
            return
        if self._is_late(chunk):
            return
        run = self._join(chunk, tsn)
        if run.size > self._max_message:
            raise ProtocolViolation("message_too_large")
        if run.begins and run.ends:
            self._drop(run)
            message = MessageReceived(chunk.stream, run.protocol, b"".join(run.payloads))
            self._complete(message, bool(flags & UNORDERED), run.sequence)

    def _unwrap(self, chunk: Data | InterleavedData) -> int:
        stream = self._streams.get(chunk.stream)
        if stream is None:
            stream = self._streams[chunk.stream] = _Stream()
        if chunk.flags & UNORDERED:
            if isinstance(chunk, Data):
                return 0  # RFC 9260 3.3.1: it has no sequence
            stream.unordered = max(stream.unordered, found := unwrap(chunk.sequence, stream.unordered))
            return found
        return unwrap(chunk.sequence, stream.expected, self._sequence_mask)

    def _is_late(self, chunk: Data | InterleavedData) -> bool:
        """True for a fragment of a message that the peer has given up, which overtook it: it would wait for ever."""
        sequence = self._unwrap(chunk)
        stream = self._streams[chunk.stream]
        if not chunk.flags & UNORDERED:
            return sequence <= stream.skipped
        return isinstance(chunk, InterleavedData) and sequence <= stream.skipped_unordered

    def _join(self, chunk: Data | InterleavedData, tsn: int) -> _Run:
        """Return the run that this fragment is in now, joined with the one before it and the one after it."""
        sequence = self._unwrap(chunk)
        if isinstance(chunk, Data):
            space, number = _DATA, tsn
        else:
            space, number = (chunk.stream, bool(chunk.flags & UNORDERED), sequence), chunk.fragment
        begins, ends = bool(chunk.flags & BEGIN), bool(chunk.flags & END)
        run = _Run(number, number, begins, ends, len(chunk.payload), chunk.protocol, sequence, chunk, [chunk.payload])
        if (space, number) in self._starts or (space, number) in self._ends:
            return run  # a number that was given twice; it joins nothing, and is not kept
        self.held += run.size + OVERHEAD
        before = None if begins else self._ends.get((space, number - 1))
        if before is not None and not before.ends and _same_message(before.chunk, chunk):
            run = self._append(before, run, space)
        else:
            self._starts[space, number] = run
            self._ends[space, number] = run
        after = None if ends else self._starts.get((space, number + 1))
        if after is not None and not after.begins and _same_message(after.chunk, chunk):
            del self._starts[space, after.first]
            run = self._append(run, after, space)
        return run

    def _append(self, run: _Run, after: _Run, space: _Space) -> _Run:
        del self._ends[space, run.last]
        run.payloads += after.payloads
        run.size += after.size
        run.last, run.ends = after.last, after.ends
        self._ends[space, run.last] = run
        return run

    def _drop(self, run: _Run) -> None:
        space = _DATA
        if isinstance(run.chunk, InterleavedData):
            space = (run.chunk.stream, bool(run.chunk.flags & UNORDERED), run.sequence)
        del self._starts[space, run.first], self._ends[space, run.last]
        self.held -= run.size + OVERHEAD * len(run.payloads)

    def _complete(self, message: MessageReceived, unordered: bool, sequence: int) -> None:
        if unordered:
            self.delivered.append(message)
            return
        stream = self._streams[message.stream]
        if sequence == stream.expected:
            stream.expected += 1
            self.delivered.append(message)
            if stream.held:
                self._release(stream)
        elif sequence > stream.expected and sequence not in stream.held:
            stream.held[sequence] = message
            self.held += len(message.payload) + OVERHEAD

    def _release(self, stream: _Stream) -> None:
        while (message := stream.held.pop(stream.expected, None)) is not None:
            stream.expected += 1
            self.held -= len(message.payload) + OVERHEAD
            self.delivered.append(message)

    def forward(self, cumulative: int, skips: list[Skip]) -> None:
        """Drop messages that the peer has given up: nothing up to TSN `cumulative` comes any more (RFC 3758 3.6)."""
        latest: dict[tuple[int, bool], int] = {}
        for skip in skips:
            latest[skip.stream, skip.unordered] = skip.sequence  # one each; a peer's repeats cost nothing
        for (number, unordered), sequence in latest.items():
            stream = self._streams.setdefault(number, _Stream())
            if not unordered:
                self._skip(stream, sequence)
            else:
                stream.skipped_unordered = max(stream.skipped_unordered, unwrap(sequence, stream.unordered))
        given_up = [run for run in self._starts.values() if _is_given_up(run, cumulative, latest)]
        for run in given_up:
            self._drop(run)

    def _skip(self, stream: _Stream, sequence: int) -> None:
        """Skip ordered messages up to this one, which do not arrive any more; those that have arrived are delivered."""
        expected = unwrap(sequence, stream.expected, self._sequence_mask) + 1
        stream.skipped = max(stream.skipped, expected - 1)
        if expected <= stream.expected:
            return
        for early in sorted(each for each in stream.held if each < expected):
            message = stream.held.pop(early)
            self.held -= len(message.payload) + OVERHEAD
            self.delivered.append(message)
        stream.expected = expected
        self._release(stream)

    def reset(self, streams: tuple[int, ...]) -> None:
        """Begin these streams anew (RFC 6525 5.2.2); an empty list means all."""
        for number in streams or tuple(self._streams):
            stream = self._streams.pop(number, None)
            if stream is not None:
                self.held -= sum(len(message.payload) + OVERHEAD for message in stream.held.values())
        chosen = set(streams)
        for run in [run for run in self._starts.values() if not chosen or run.chunk.stream in chosen]:
            self._drop(run)


def _same_message(one: Data | InterleavedData, other: Data | InterleavedData) -> bool:
    """True if both are fragments of one message, which share stream, sequence and order (RFC 9260 6.9)."""
    return one.stream == other.stream and one.sequence == other.sequence and (one.flags ^ other.flags) & UNORDERED == 0


def _is_given_up(run: _Run, cumulative: int, latest: dict[tuple[int, bool], int]) -> bool:
    """True if the rest of it comes no more. `latest` are the last messages given up, by stream and order."""
    if isinstance(run.chunk, InterleavedData):  # RFC 8260 2.3.1: by message
        last = latest.get((run.chunk.stream, bool(run.chunk.flags & UNORDERED)))
        return last is not None and run.sequence <= unwrap(last, run.sequence)
    if run.begins:
        # Its next fragment is beyond `cumulative`, and comes, when nothing up to there is missing.
        return run.last < cumulative
    return run.first <= cumulative + 1

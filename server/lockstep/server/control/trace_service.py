"""Sends spans to the peers that ask for them, and takes those of the operator's client (docs/traces.md).

Nothing is kept or sent for a peer that has not asked. A message with spans leaves only if nothing waits on its way, so
it delays neither feedback nor pictures; what it did not carry is forgotten.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple, Protocol

from lockstep.protocol.console import encode_console_message
from lockstep.protocol.traces.trace import (
    CommandSpans,
    PictureSpans,
    join_spans,
    remainder_ms,
    span_ms,
    spans_at_bridge,
    sum_of_spans,
)
from lockstep.protocol.traces.trace_messages import (
    MAX_TRACED_COMMANDS,
    CommandTrace,
    EventTrace,
    PictureTrace,
    TraceReport,
    Traces,
)
from lockstep.rtc.token_bucket import TokenBucket
from lockstep.server.util.cooperative_scheduler import turns_of_loop

__all__ = ["TracedPeer", "TraceService", "command_spans"]

TURN_SECONDS = 0.25  # between two messages to a peer that may drive
OBSERVER_TURNS = 4  # of those turns an observer gets one
NEWEST_PICTURES = 4  # of one camera in a message
REPORTED_EVENTS_HZ = 100.0  # that the operator's client may report; events come at half of that at most
KEPT_COMMANDS = 128  # that the client's reports are completed with


class TracedPeer(Protocol):
    """The part of a peer that is needed here; `Peer` has it."""

    @property
    def ended(self) -> str: ...
    @property
    def role(self) -> str: ...

    def want_traces(self, wanted: bool) -> None: ...
    def take_traces(self, most: int) -> list[PictureTrace]: ...
    def send_spare(self, text: str) -> None: ...


class _Asked(NamedTuple):
    """A peer that asks for traces."""

    turn: int  # in which an observer is served, 0 to OBSERVER_TURNS - 1
    seen: int  # commands that it was told of


class TraceService:
    """Run `run`; everything else is called on the loop and returns at once."""

    def __init__(self) -> None:
        self._asked: dict[TracedPeer, _Asked] = {}
        self._has_asked = asyncio.Event()
        self._commands: deque[CommandTrace] = deque(maxlen=KEPT_COMMANDS)
        self._count = 0  # commands so far
        self._reports = TokenBucket(REPORTED_EVENTS_HZ, 2 * REPORTED_EVENTS_HZ)

    def request(self, peer: TracedPeer, wanted: bool) -> None:
        """Take a peer's request."""
        if wanted == (peer in self._asked):
            return
        peer.want_traces(wanted)
        if wanted:
            self._asked[peer] = _Asked(len(self._asked) % OBSERVER_TURNS, self._count)
            self._has_asked.set()
        else:
            del self._asked[peer]

    def forget(self, peer: TracedPeer) -> None:
        """Forget a peer that has ended."""
        self._asked.pop(peer, None)

    def epoch_ends(self) -> None:
        """Forget the commands: event references of another epoch are never compared with them."""
        self._commands.clear()

    def executed(self, event: int, spans: CommandSpans) -> None:
        """Take the spans of a command whose feedback has come."""
        self._commands.append(CommandTrace(event=event, spans=spans))
        self._count += 1

    def reported(self, report: TraceReport, streams: Collection[str], now: float) -> list[EventTrace]:
        """Return the reported events, completed with what the console knows better; too many are left out.

        `streams`: that the client gets; it has shown no picture of any other.
        """
        known = {each.event: each.spans for each in self._commands}
        return [
            EventTrace(
                event=each.event,
                command=join_spans(each.command, known.get(each.event, CommandSpans())),
                stream=each.stream if each.stream in streams else "",
                picture=each.picture if each.stream in streams else PictureSpans(),
            )
            for each in report.events
            if self._reports.take(now)
        ]

    async def run(self) -> None:
        """Send, until cancelled. While nobody asks, this does nothing."""
        turn = 0
        while True:
            self._has_asked.clear()
            if not self._asked:
                await self._has_asked.wait()
            await asyncio.sleep(TURN_SECONDS)
            turn = (turn + 1) % OBSERVER_TURNS
            waiting = deque(self._due(turn))
            if waiting:
                turns_of_loop().ask(_in_slices(waiting, self._serve))

    def _due(self, turn: int) -> Sequence[TracedPeer]:
        return [peer for peer, asked in self._asked.items() if peer.role != "observer" or asked.turn == turn]

    def _serve(self, peer: TracedPeer) -> None:
        asked = self._asked.get(peer)
        if asked is None or peer.ended:
            return
        pictures = peer.take_traces(NEWEST_PICTURES)
        new = min(self._count - asked.seen, MAX_TRACED_COMMANDS, len(self._commands))
        commands = list(self._commands)[len(self._commands) - new :]
        self._asked[peer] = asked._replace(seen=self._count)
        if pictures or commands:
            peer.send_spare(encode_console_message(Traces(pictures=pictures, commands=commands)))


def _in_slices(waiting: deque[TracedPeer], serve: Callable[[TracedPeer], None]) -> Callable[[], None]:
    """Return work for the observers' turns of the loop: it serves peers until its slice is over."""
    turns = turns_of_loop()

    def work() -> None:
        while waiting:
            serve(waiting.popleft())
            if turns.is_over():
                break
        if waiting:
            turns.ask(work)

    return work


def command_spans(robot: CommandSpans, *, forward: float, link: float, back: float) -> CommandSpans:
    """Return the spans of a command that the console knows once its feedback has come; durations in s.

    Args:
        robot: as the bridge has measured them
        forward: from the command's arrival until it was on the robot link
        link: from there to the feedback's arrival
        back: from there until the feedback was sent to the operator
    """
    at_robot = spans_at_bridge(robot)
    return join_spans(
        at_robot,
        CommandSpans(
            forward_ms=span_ms(forward),
            back_ms=span_ms(back),
            link_ms=remainder_ms(link * 1000, sum_of_spans(at_robot)),
        ),
    )

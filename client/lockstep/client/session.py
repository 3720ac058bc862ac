"""The control seat, participants and notes of a connection, and the requests that get an answer."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable

from lockstep.client.errors import CommandRefused, ConsoleLost, SeatRefused
from lockstep.client.transport.webrtc_peer import ChannelName
from lockstep.protocol.console import (
    ClientMessage,
    Note,
    Participants,
    Seat,
    SeatDecline,
    SeatGrant,
    SeatRelease,
    SeatRequest,
    SeatTake,
    SharedNote,
    Welcome,
)
from lockstep.protocol.messages import Refusal, Reset, StopState, StopTaken

__all__ = ["Session"]

RESET_AGAIN = 0.5  # s between two tries while the stop is too new
ANSWER_SECONDS = 5.0  # time for the console to answer a request
KEPT_NOTES = 100


class Session:
    """The shared state of a connection, and its requests. Pass every message to `hear`; the requests wait with `until`
    for a message that answers them.

    Attributes:
        welcome: this connection's id and role; None before the console sent it
        seated: called when this connection becomes the holder of the seat
        unseated: called when it is the holder no longer
    """

    def __init__(
        self,
        send: Callable[[ChannelName, ClientMessage], None],
        until: Callable[[Callable[[], bool]], Awaitable[None]],
    ) -> None:
        self.welcome: Welcome | None = None
        self.seat = Seat()
        self.stop_state = StopState()
        self.taken: dict[str, StopTaken] = {}  # answers to presses of this connection
        self.newest_stop = 0  # number of the newest stop that this connection knows
        self.participants = Participants(participants=[])
        self.notes: deque[SharedNote] = deque(maxlen=KEPT_NOTES)
        self.seated: Callable[[], None] = _ignore
        self.unseated: Callable[[], None] = _ignore
        self._send = send
        self._until = until
        self._refusals: deque[Refusal] = deque(maxlen=16)  # of requests, not of commands

    @property
    def peer(self) -> str:
        return "" if self.welcome is None else self.welcome.peer

    @property
    def holds_seat(self) -> bool:
        return bool(self.peer) and self.seat.holder == self.peer

    @property
    def claims_seat(self) -> bool:
        return any(claim.peer == self.peer for claim in self.seat.claims)

    def hear(self, message: Welcome | Seat | Participants | SharedNote) -> None:
        match message:
            case Welcome():
                self.welcome = message
            case Participants():
                self.participants = message
            case SharedNote():
                self.notes.append(message)
            case Seat():
                held, self.seat = self.holds_seat, message
                if self.holds_seat and not held:
                    self.seated()
                elif held and not self.holds_seat:
                    self.unseated()

    def stop_shown(self, stop: StopState) -> None:
        """Take the robot's present stop state."""
        self.stop_state = stop
        self.newest_stop = max(self.newest_stop, stop.number)

    def stop_taken(self, taken: StopTaken) -> None:
        """Take the robot's answer to a press."""
        if len(self.taken) >= KEPT_NOTES:
            del self.taken[next(iter(self.taken))]
        self.taken[taken.press] = taken
        self.newest_stop = max(self.newest_stop, taken.number)

    def confirmed(self, press: str) -> StopState | None:
        """Return the stop that `press` became; None as long as no message about this press names it."""
        taken, shown = self.taken.get(press), self.stop_state
        if shown.press == press:
            return shown
        return None if taken is None else StopState(stopped=True, number=taken.number, press=press, kept=taken.kept)

    def refused(self, refusal: Refusal) -> None:
        """Take a refusal that names no event."""
        self._refusals.append(refusal)

    async def take_seat(self) -> None:
        """Take the control seat. Raises SeatRefused."""
        takes = self.welcome is not None and self.welcome.role == "supervisor"
        await self._seat(SeatTake() if takes else SeatRequest(only_if_free=True), ANSWER_SECONDS)

    async def request_seat(self, seconds: float) -> None:
        """Ask for the control seat; withdraw the request unless granted. Raises SeatRefused, also after `seconds`."""
        try:
            await self._seat(SeatRequest(), seconds)
        except ConsoleLost:
            if not self.claims_seat:
                raise
            raise SeatRefused("declined", f"no answer within {seconds:g} s") from None
        finally:
            if not self.holds_seat:
                self.release_seat()

    def release_seat(self) -> None:
        self._send("session", SeatRelease())

    def answer(self, peer: str, *, grant: bool) -> None:
        self._send("session", SeatGrant(peer=peer) if grant else SeatDecline(peer=peer))

    async def note(self, text: str) -> SharedNote:
        """Write a note and return it. Raises CommandRefused: too many notes, or nothing in this one can be printed."""
        newest = self.notes[-1].id if self.notes else 0

        def mine() -> SharedNote | None:
            return next((note for note in self.notes if note.id > newest and note.peer == self.peer), None)

        refusal = await self._ask(lambda: mine() is not None, "session", Note(text=text), ANSWER_SECONDS)
        note = mine()
        if note is None:
            raise CommandRefused(*(("declined", "") if refusal is None else (refusal.reason, refusal.detail)))
        return note

    async def reset(self, by: str, number: int) -> StopState:
        """Release stop `number`, and no later one; wait while it is too soon. Raises CommandRefused."""
        reset = Reset(by=by, number=number)
        loop = asyncio.get_running_loop()
        until = loop.time() + ANSWER_SECONDS
        while True:
            refusal = await self._ask(lambda: self._is_released(number), "stop", reset, ANSWER_SECONDS)
            if refusal is None:
                return self.stop_state
            if refusal.reason != "too_soon" or loop.time() > until:
                raise CommandRefused(refusal.reason, refusal.detail)
            await asyncio.sleep(RESET_AGAIN)

    def _is_released(self, number: int) -> bool:
        return not self.stop_state.stopped and self.stop_state.number == number

    async def _seat(self, message: SeatRequest | SeatTake, seconds: float) -> None:
        refusal = await self._ask(lambda: self.holds_seat, "session", message, seconds)
        if refusal is not None:
            raise SeatRefused(
                refusal.reason, refusal.detail or (f"{self.seat.name} holds it" if self.seat.name else "")
            )

    async def _ask(
        self, granted: Callable[[], bool], channel: ChannelName, message: ClientMessage, seconds: float
    ) -> Refusal | None:
        """Send a request; return None if it was granted, otherwise the refusal."""
        self._refusals.clear()
        self._send(channel, message)
        try:
            async with asyncio.timeout(seconds):
                await self._until(lambda: granted() or bool(self._refusals))
        except TimeoutError:
            raise ConsoleLost(f"no answer from the console within {seconds:g} s") from None
        return None if granted() else self._refusals.popleft()


def _ignore() -> None:
    pass

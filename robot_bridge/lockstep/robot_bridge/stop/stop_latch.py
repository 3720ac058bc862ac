"""The latched stop: its numbers, the presses behind them, and which reset releases it. No I/O, no clock.

Call `stop`, `reset`, `lock_out` and `let_in` in any order, `may_move` when the robot may move again, and `shown` with
every stop state that was fed back, twice a second at least. Where the latch is kept on a disk, each change raises
`version`: write `record` away from the loop, and call `written` with the version that was written, or could not be.
Without a disk a reset takes effect at once and no state is kept. Rules and reasons: docs/robot-link.md, "Stop and
reset".
"""

import math
from typing import Literal, NamedTuple

import msgspec

from lockstep.protocol.messages import StopState

__all__ = [
    "LEAST_STOP",
    "MAX_NUMBER",
    "MAX_PRESSES",
    "OVERTAKEN",
    "ResetNeedless",
    "ResetOutcome",
    "ResetRefused",
    "ResetTaken",
    "ResetWaits",
    "StopGiven",
    "StopLatch",
    "StopRecord",
    "WriteOutcome",
]

LEAST_STOP = 1.0  # s between the newest stop and the first reset that may release it
HELD_UP = 1.5  # s without a feedback: a reset that comes then may have waited for as long as the bridge was held up
MAX_PRESSES = 256  # remembered until the robot may move; a forgotten one counts as a new stop, which is the safe side
MAX_NUMBER = 2**53 - 1
TEXT = 500  # characters of `by` and `reason`, as on the link
OVERTAKEN = "a newer stop arrived"
UNKEPT = "the reset could not be written to the robot's disk"


class StopRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The part of the latch that is kept over a restart."""

    stopped: bool = False
    by: str = ""  # name with the first stop since the last reset
    reason: str = ""
    number: int = 0  # of the newest stop; 0 before the first
    press: str = ""  # the press that became the newest stop
    presses: list[tuple[str, int]] = []  # the newest ones and their numbers, oldest first


class StopGiven(NamedTuple):
    """The number of a press."""

    number: int
    is_new: bool  # False for a repeat of a press that is known
    latched: bool  # True if the robot was not stopped before
    overtaken: int = 0  # number of a reset that waited for the disk and is void now; 0 for none


class ResetTaken(NamedTuple):
    """The stop is released."""

    number: int


class ResetWaits(NamedTuple):
    """The stop will be released once the reset is on the disk."""

    number: int


class ResetNeedless(NamedTuple):
    """A repeat of a reset that was taken or waits for the disk."""

    number: int


class ResetRefused(NamedTuple):
    number: int
    reason: Literal["stale_reset", "too_soon", "locked_out", "not_kept"]
    detail: str


ResetOutcome = ResetTaken | ResetWaits | ResetNeedless | ResetRefused
WriteOutcome = ResetTaken | ResetRefused | None


class StopLatch:
    """Gives every new press the next number, and releases only for a reset that names the newest."""

    def __init__(
        self,
        record: StopRecord | None = None,
        *,
        numbers_after: int = 0,
        keeps: bool = False,
        now: float = -math.inf,
    ) -> None:
        """`record`: the latch as it was left; None before the first run. `numbers_after`: new numbers are higher.

        `keeps`: whether `record` is written to a disk. `now`: a stop that was left counts as new, since its age is
        unknown.
        """
        record = record or StopRecord()
        self.version = 0  # of `record`; raised by each change that has to be written
        self._state = StopState(
            stopped=record.stopped, by=record.by, reason=record.reason, number=record.number, press=record.press
        )
        self._keeps = keeps
        self._presses: dict[str, int] = dict(record.presses)  # oldest first
        self._last_number = max(record.number, numbers_after)
        self._stopped_at = now  # s, when the newest stop came
        self._shown = 0  # newest stop that a feedback has shown
        self._shown_at = math.inf  # s, when the last feedback was; infinite before the first
        self._resetting: tuple[int, int] | None = None  # number of the reset that waits for the disk, and its version
        self._written = 0  # newest version on the disk

    @property
    def state(self) -> StopState:
        """The state of the stop for feedback."""
        return msgspec.structs.replace(self._state, kept=self._keeps and self._written == self.version)

    @property
    def keeps(self) -> bool:
        return self._keeps

    @property
    def last_number(self) -> int:
        """The highest number given so far; no number up to it is given again."""
        return self._last_number

    @property
    def record(self) -> StopRecord:
        """The record that has to be on the disk at `version`, with the reset that waits for the disk already in it."""
        state, released = self._state, self._resetting is not None
        return StopRecord(
            stopped=state.stopped and not released,
            by="" if released else state.by,
            reason="" if released else state.reason,
            number=state.number,
            press=state.press,
            presses=list(self._presses.items()),
        )

    def stop(self, press: str, by: str, reason: str, now: float) -> StopGiven:
        """Latch a stop, from any client. A known press is no new stop, even after a reset; "" is never known."""
        if press and press in self._presses:
            return StopGiven(self._presses[press], is_new=False, latched=False)
        number = self._next_number()
        if press:
            while len(self._presses) >= MAX_PRESSES:
                del self._presses[next(iter(self._presses))]
            self._presses[press] = number
        overtaken = 0 if self._resetting is None else self._resetting[0]
        latched = not self._state.stopped
        first = self._state if not latched else StopState(by=by[:TEXT], reason=reason[:TEXT])
        self._resetting = None
        self._stopped_at = now
        self._state = msgspec.structs.replace(
            self._state, stopped=True, by=first.by, reason=first.reason, number=number, press=press
        )
        self.version += 1
        return StopGiven(number, is_new=True, latched=latched, overtaken=overtaken)

    def may_move(self) -> None:
        """Forget the presses, because the robot may move from now on.

        Every later press is a new stop, even with a known id, so no choice of ids keeps a stop from stopping. The disk
        may still have the old ids: a bridge that starts does not move before this is called again.
        """
        self._presses.clear()

    def shown(self, state: StopState, now: float) -> None:
        """Note that a feedback with this state is sent now."""
        self._look(now)
        self._shown_at = now
        if state.stopped:
            self._shown = max(self._shown, state.number)

    def reset(self, number: int, now: float) -> ResetOutcome:
        """Decide about a reset. `number`: the newest stop that the sender has seen."""
        newest = self._state.number
        if number != newest:
            return ResetRefused(number, "stale_reset", f"the newest stop is {newest}")
        if not self._state.stopped or self._resetting is not None:
            return ResetNeedless(number)
        if self._state.locked_out:
            return ResetRefused(number, "locked_out", self._state.locked_out)
        self._look(now)
        if now - self._stopped_at < LEAST_STOP or self._shown < newest:
            return ResetRefused(number, "too_soon", f"a stop lasts at least {LEAST_STOP:g} s")
        self.version += 1
        if self._keeps:
            self._resetting = number, self.version
            return ResetWaits(number)
        return self._release(number)

    def written(self, version: int, error: str = "") -> WriteOutcome:
        """Note that the record of `version` is on the disk, or could not be written because of `error`."""
        if error:
            self._written = min(self._written, version - 1)  # also a latch that was on the disk and has gone from there
        else:
            self._written = max(self._written, version)
        if self._resetting is None or version < self._resetting[1]:
            return None
        number, _ = self._resetting
        if not error:
            return self._release(number)
        self._resetting = None
        self.version += 1  # the disk may or may not hold the reset: the stop has to be written again
        return ResetRefused(number, "not_kept", f"{UNKEPT}: {error}"[:TEXT])

    def lock_out(self, reason: str, now: float) -> StopGiven | None:
        """Lock the robot for a person at it, with a stop; None if it was locked already."""
        if reason == self._state.locked_out:
            return None
        begins = not self._state.locked_out
        self._state = msgspec.structs.replace(self._state, locked_out=reason[:TEXT])
        return self.stop("", "at the robot", reason, now) if begins else None

    def let_in(self) -> bool:
        """End the lock-out; the stop stays latched. False if the robot was not locked out."""
        if not self._state.locked_out:
            return False
        self._state = msgspec.structs.replace(self._state, locked_out="")
        return True

    def _look(self, now: float) -> None:
        """Count the stop as new if the bridge was held up: the age of the waiting resets is unknown."""
        if now - self._shown_at > HELD_UP:
            self._stopped_at = now

    def _next_number(self) -> int:
        self._last_number = min(self._last_number + 1, MAX_NUMBER)
        return self._last_number

    def _release(self, number: int) -> ResetTaken:
        self._resetting = None
        self._state = msgspec.structs.replace(self._state, stopped=False, by="", reason="")
        return ResetTaken(number)

"""A bridge without I/O, around the real cores: what a state machine drives, alone or together with a console's desk.

`BridgeModel` does what the shells do, with a disk that can fail and a process that can be killed. `MotionWitness` keeps
books of its own, by other rules than the cores', and raises as soon as something moves that must not.
"""

from collections.abc import Callable

from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal, Reset, Rest, Stop, StopTaken
from lockstep.robot_bridge.control.event_core import Answered, EventCore, Executed, Refused
from lockstep.robot_bridge.stop.stop_latch import LEAST_STOP, ResetRefused, ResetTaken, ResetWaits, StopLatch
from lockstep.robot_bridge.stop.stop_store import Found, Kept, start_of
from tests.robot_bridge.control.core_helpers import AXES, MAX_AGE, MEASURED

__all__ = ["BridgeModel", "MotionWitness"]

EXACT = 1e-9  # s


class MotionWitness:
    """What has to have happened before a robot may move, in the order in which it happened."""

    def __init__(self) -> None:
        self.given: list[int] = []  # numbers of stops, in order
        self.stopped_at = 0.0
        self.shown = 0  # newest stop that a feedback has said to hold
        self.holds = False  # a stop holds
        self.locked = False
        self.neutral = False  # a neutral command executed since the last cause, as an answer to what came after it
        self.caused_at = 0  # issues seen when the last cause came
        self.seen = 0  # issues

    def stop(self, number: int, now: float) -> None:
        assert number not in self.given, f"the number {number} is given twice"
        assert not self.given or number > self.given[-1], "numbers go back"
        self.given.append(number)
        self.holds, self.stopped_at = True, now
        self.cause()

    def reset(self, number: int, now: float) -> None:
        """A reset takes effect."""
        assert number == self.given[-1], "a reset that does not name the newest stop took effect"
        assert now - self.stopped_at >= LEAST_STOP - EXACT, "a stop was shorter than it may be"
        assert self.shown == number, "a reset took effect before a feedback had shown its stop"
        assert not self.locked, "a reset took effect while the robot was locked"
        self.holds = False
        self.cause()

    def cause(self) -> None:
        """From now on motion has to be a decision of its own."""
        self.neutral, self.caused_at = False, self.seen

    def executed(self, *, moving: bool, answers: int) -> None:
        """`answers`: how many issues there had been when the one that it answers was sent."""
        assert not self.holds, "executed while a stop holds"
        if moving:
            assert self.neutral, "moved without a neutral command after what had brought it to rest"
            return
        if answers > self.caused_at:
            self.neutral = True


class BridgeModel:
    """One robot over several runs of its bridge. Every method returns what the bridge sends to its operator link."""

    def __init__(self, *, first_event: int = 1, keeps: bool = True, wall: Callable[[], int] = lambda: 0) -> None:
        """`wall`: microseconds by a clock that need not go on."""
        self.now = 1000.0  # s, monotonic
        self.witness = MotionWitness()
        self.driven = False  # the axes are driven by an executed command that moves
        self.disk_fails = False
        self.issued: dict[int, int] = {}  # nonce -> how many issues there had been with it
        self.acknowledged: dict[str, int] = {}  # press -> number, of all that were answered
        self._wall = wall
        self._keeps = keeps
        self._first_event = first_event
        self._disk: Kept | None = None
        self._used = False
        self._reserved = 0
        self._nonce = 0
        self._waiting: list[tuple[str, int, int]] = []  # press, number, version
        self._on_disk = -1
        self._begin()

    # what comes in

    def receive(self, message: Command | Rest | Stop | Reset) -> list[LinkMessage]:
        match message:
            case Command():
                return self._command(message)
            case Rest():
                if self.core.rest(message.event):
                    self.driven = False
                return []
            case Stop():
                return self._stop(message)
            case Reset():
                return self._reset(message)

    def tick(self) -> list[LinkMessage]:
        """The feedback that is due after a tick."""
        if not self.core.issue_due(self.now):
            return []
        feedback = self.core.issue(MEASURED, self.now)
        self.witness.seen += 1
        if feedback.stop.stopped:
            self.witness.shown = feedback.stop.number
        self.issued[feedback.nonce] = self.witness.seen
        assert feedback.stop.stopped == self.witness.holds, "the feedback says something else than what holds"
        assert feedback.neutral_needed != self.witness.neutral, "the feedback is wrong about the neutral command"
        return [feedback]

    def write(self) -> list[LinkMessage]:
        """The disk has done what it was asked for, or has failed."""
        if not self._keeps or self._on_disk == self.core_latch.version:
            return []
        version = self.core_latch.version
        if not self.disk_fails:
            self._disk = Kept(latch=self.core_latch.record, ended=False)
            self._on_disk = version
        outcome = self.core.stops.written(version, "the disk is full" if self.disk_fails else "")
        out: list[LinkMessage] = []
        if isinstance(outcome, ResetTaken):
            self._released(outcome.number)
        elif isinstance(outcome, ResetRefused):
            out.append(self._refused_reset(outcome))
        for press, number, _ in self._waiting:
            out.append(StopTaken(press=press, number=number, kept=not self.disk_fails))
        self._waiting.clear()
        return out

    def operator_lost(self) -> None:
        self.driven = False

    def operator_comes(self) -> None:
        self._need_neutral()

    def held_up(self) -> None:
        """A fault, a watchdog's act, or the process was suspended."""
        self._need_neutral()

    def lock(self, reason: str) -> None:
        self.witness.locked = True
        given = self.core.stops.lock_out(reason, self.now)
        if given is not None:
            self._note_stop(given.number)

    def unlock(self) -> None:
        self.witness.locked = False
        if self.core.stops.let_in():
            self._cause()

    def restart(self, *, in_order: bool, file_lost: bool = False) -> None:
        """The bridge ends, or is killed, and another begins on the same disk."""
        held = self.witness.holds
        if in_order and self._keeps and not self.disk_fails:
            self._disk = Kept(latch=self.core_latch.record, ended=True)
        elif self._disk is not None:
            self._disk = Kept(latch=self._disk.latch, ended=False)
        if file_lost:
            self._disk = None
        self._waiting.clear()
        self.driven = False
        self.acknowledged = {} if self._disk is None else dict(self._disk.latch.presses)
        if not self._keeps:
            self.witness.holds = False
        resets = self._disk is not None and not self._disk.latch.stopped  # a reset had reached the disk
        self._begin()
        if self._keeps and held:
            assert self.witness.holds or (in_order and resets), "a restart released a stop"

    # inside

    def _begin(self) -> None:
        latch = StopLatch(numbers_after=max(self._wall(), self.witness.given[-1] if self.witness.given else 0))
        reason = ""
        if self._keeps:
            start = start_of(Found(self._used, self._disk, "", self._reserved), self._wall())
            latch = StopLatch(start.record, numbers_after=start.numbers_after, keeps=True, now=self.now)
            self.witness.holds = start.record.stopped
            reason = start.stop_reason
            self._used, self._reserved = True, latch.last_number + 1000
        self.core_latch, self._on_disk = latch, -1
        self.core = EventCore(AXES, max_event_age=MAX_AGE, first_event=self._first_event, nonces=self._draw)
        if reason:
            self.witness.stop(latch.stop("", "bridge", reason, self.now).number, self.now)
        self.core.stops.latch = latch
        self.issued.clear()
        self._cause()
        if self._keeps:  # a bridge does not start where it cannot write
            self._disk, self._on_disk = Kept(latch=latch.record, ended=False), latch.version
            latch.written(latch.version)
        self.tick()

    def _draw(self) -> int:
        self._nonce += 1
        return self._nonce

    def _command(self, command: Command) -> list[LinkMessage]:
        outcome = self.core.command(command, self.now)
        if isinstance(outcome, Executed):
            moving = self.core.values.moves(outcome.values)
            assert command.nonce in self.issued, "executed without having seen what it answers"
            self.witness.executed(moving=moving, answers=self.issued[command.nonce])
            self.driven = moving
            if self.witness.neutral:
                self.acknowledged.clear()  # it may move: a press of any id is a new stop
        elif isinstance(outcome, Answered):
            return [outcome.feedback]
        elif isinstance(outcome, Refused):
            return [outcome.refusal]
        return []

    def _stop(self, stop: Stop) -> list[LinkMessage]:
        given = self.core.stops.stop(stop.press, stop.by, stop.reason, self.now)
        if given.is_new:
            self._note_stop(given.number)
        if stop.press:
            assert self.acknowledged.setdefault(stop.press, given.number) == given.number or not self._keeps
        assert not self.driven, "a press had no effect on a robot that moves"
        out: list[LinkMessage] = []
        if given.overtaken:
            refused = ResetRefused(given.overtaken, "stale_reset", "a newer stop arrived")
            out.append(self._refused_reset(refused))
        if self._on_disk == self.core_latch.version:
            return [*out, StopTaken(press=stop.press, number=given.number)]
        if not self._keeps:
            return [*out, StopTaken(press=stop.press, number=given.number, kept=False)]
        self._waiting.append((stop.press, given.number, self.core_latch.version))
        return out

    def _reset(self, reset: Reset) -> list[LinkMessage]:
        outcome = self.core.stops.reset(reset.number, self.now)
        if isinstance(outcome, ResetTaken):
            self._released(outcome.number)
        elif isinstance(outcome, ResetRefused):
            return [self._refused_reset(outcome)]
        else:
            assert not isinstance(outcome, ResetWaits) or self._keeps
        return []

    def _refused_reset(self, refused: ResetRefused) -> Refusal:
        return self.core.refusal(0, refused.reason, refused.detail, stop=refused.number)

    def _note_stop(self, number: int) -> None:
        self.driven = False
        self.witness.stop(number, self.now)

    def _released(self, number: int) -> None:
        self.witness.reset(number, self.now)

    def _need_neutral(self) -> None:
        self.driven = False
        self.core.interlock.require()
        self._cause()

    def _cause(self) -> None:
        self.witness.cause()

    @property
    def disk(self) -> Kept | None:
        """What is on it."""
        return self._disk

    @property
    def feedback(self) -> Feedback:
        newest = self.core.feedback
        assert newest is not None
        return newest

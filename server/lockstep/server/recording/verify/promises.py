"""Checks a recording against Lockstep's promises (DESIGN: exactly once, never late, only from the seat). No I/O.

Show a `Verifier` every record in the order of the file, then ask for its `verdict`. It goes by events and by the robot
bridge's own clock; the console's clock decides nothing.
"""

from typing import Literal

import msgspec

from lockstep.protocol.console import StreamReport
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_after, event_gap, is_newer
from lockstep.server.recording.format.records import (
    ActionRecord,
    CommandRecord,
    Degraded,
    FeedbackRecord,
    OwnRecord,
    RefusalRecord,
    ReportRecord,
    RobotRecord,
    SeatRecord,
    StopRecord,
    TraceRecord,
)
from lockstep.server.recording.verify.command_ages import CommandAges
from lockstep.server.recording.verify.goals import GoalChecks
from lockstep.server.recording.verify.stamps import StampChecks
from lockstep.server.recording.verify.verify_signature import SignatureReport
from lockstep.server.recording.verify.violation import Violation

__all__ = ["CHECKS", "Check", "CheckName", "Verdict", "Verifier"]

CheckName = Literal[
    "readable",  # the file is whole, and its checksums fit
    "complete",  # no event is missing, and the recorder left nothing out
    "monotonic",  # `s` never decreases, and everything is of one epoch
    "once",  # every event comes from one forwarded command, and executes once
    "in_time",  # no command executes later than max_event_age after the feedback that it answers, and has seen; or may
    "seat",  # commands are forwarded for the seat's holder alone
    "stopped",  # no command is forwarded while the robot is stopped, or a stop is on its way to it
    "actions",  # each begins once, one moves the robot at a time, and only while commands name it
    "goals",  # goal axes move no faster than they may, and no goal out of reach executes
    "stamps",  # no picture or sound is stamped newer than it is
    "rendered",  # the operator's page rendered nothing beyond its tolerance
    "signed",  # the file is as it was signed, to its end; or nothing is signed
]
CHECKS: tuple[CheckName, ...] = (
    "readable",
    "complete",
    "monotonic",
    "once",
    "in_time",
    "seat",
    "stopped",
    "actions",
    "goals",
    "stamps",
    "rendered",
    "signed",
)
LEAVE = 1.0  # s on top of hold until the end of an action is told
MANY_ACTIONS = 1000  # whose end is remembered
MANY_PRESSES = 64  # on their way; beyond that some share an answer, and the oldest may have none
MOST = 50  # violations of a check that are listed


class Check(msgspec.Struct):
    """The check of one promise."""

    looked: int = 0  # number of cases that were checked
    count: int = 0  # of violations
    violations: list[Violation] = []  # the first ones

    @property
    def ok(self) -> bool:
        return self.count == 0


class Verdict(msgspec.Struct, kw_only=True):
    ok: bool
    checks: dict[CheckName, Check]
    events: int  # that were executed
    commands: int  # forwarded
    pictures_and_sounds: int
    signature: SignatureReport


class _Answered(msgspec.Struct):
    """Feedback of one event, by the issues that were recorded."""

    times: dict[int, float]  # s, the bridge's clock
    stopped: dict[int, bool]
    nonces: dict[int, int]  # 0 in recordings from before there were nonces


class _Stops:
    """The stops on their way to the robot. In recordings from before stops had numbers, a stop has no press."""

    def __init__(self) -> None:
        self.shown = 0  # number of the newest stop that a feedback has shown
        self._asked: dict[str, None] = {}  # presses that the robot has not taken, oldest first
        self._taken = 0  # number of the newest stop that the robot has taken
        self._asked_without_id = False

    @property
    def coming(self) -> bool:
        return bool(self._asked) or self._asked_without_id or self._taken > self.shown

    def record(self, record: StopRecord) -> str:
        """Take a record and return its fault, or ""."""
        if record.kind == "stop":
            if record.press:
                self._asked[record.press] = None
            else:
                self._asked_without_id = True
        elif record.kind == "taken":
            self._take(record)
        elif not record.number:
            self._asked_without_id = False
        elif record.number < self.shown:
            return f"a reset of stop {record.number} took effect, although stop {self.shown} is newer"
        return ""

    def _take(self, taken: StopRecord) -> None:
        self._taken = max(self._taken, taken.number)
        while len(self._asked) > MANY_PRESSES and (oldest := next(iter(self._asked))) != taken.press:
            del self._asked[oldest]
        self._asked.pop(taken.press, None)

    def feedback(self, feedback: FeedbackRecord) -> str:
        """Take a feedback and return its fault, or ""."""
        stop, shown = feedback.stop, self.shown
        self.shown = max(shown, stop.number)
        if stop.stopped:
            self._asked_without_id = False
        return f"stop {stop.number} is shown after stop {shown}" if stop.number < shown else ""


class _Actions:
    """The actions that began in the recording. What began before it is not judged."""

    def __init__(self) -> None:
        self._ended: dict[str, None] = {}  # ids, oldest first
        self._running: dict[str, bool] = {}  # ids, and whether they move the robot
        self._renewed: dict[str, int] = {}  # ids that move the robot -> event of the newest command that names them
        self._times: dict[str, float] = {}  # of that event's feedback, s, the bridge's clock

    def record(self, record: ActionRecord) -> str:
        """Take a record and return its fault, or ""."""
        if record.state in ("asked", "cancel"):
            return ""
        if record.state == "running":
            if record.id in self._ended:
                return f"action {record.name} ran again after its end"
            others = [id for id, moves in self._running.items() if moves and id != record.id]
            self._running[record.id] = record.moves
            return f"action {record.name} moves the robot beside another one" if record.moves and others else ""
        self._running.pop(record.id, None)
        self._renewed.pop(record.id, None)
        self._times.pop(record.id, None)
        self._ended[record.id] = None
        if len(self._ended) > MANY_ACTIONS:
            del self._ended[next(iter(self._ended))]
        return ""

    def command(self, command: CommandRecord) -> None:
        if self._running.get(command.action):
            self._renewed[command.action] = command.event

    def feedback(self, feedback: FeedbackRecord, description: RobotDescription | None) -> str:
        """Take a feedback and return its fault, or ""."""
        hold = 0.0 if description is None else description.hold
        for id, moves in self._running.items():
            if not moves:
                continue
            if id not in self._times or self._renewed.get(id) == feedback.event:
                self._times[id] = feedback.time
            elif feedback.time - self._times[id] > hold + LEAVE:
                self._times[id] = feedback.time
                return "an action moves the robot, and no command has named it for longer than hold"
        return ""


class Verifier:
    def __init__(self, epoch: str) -> None:
        self._epoch = epoch
        self._checks: dict[CheckName, Check] = {name: Check() for name in CHECKS}
        self._description: RobotDescription | None = None
        self._newest: FeedbackRecord | None = None
        self._answered: dict[int, _Answered] = {}  # by event: the newest two
        self._holder: str | None = None  # None: not known yet
        self._stops = _Stops()
        self._actions = _Actions()
        self._ages = CommandAges()
        self._goals = GoalChecks()
        self._stamps = StampChecks()
        self._stopped = False
        self._in_flight: CommandRecord | None = None
        self._linked = True
        self._rendered: dict[tuple[str, str], StreamReport] = {}  # newest, by peer and stream
        self._events = self._commands = self._media = 0
        self._signature = SignatureReport()

    def fail(self, check: CheckName, text: str, event: int = 0, time: int = 0) -> None:
        """Note a broken promise."""
        self._fail(check, Violation(event, time, text))

    def _fail(self, check: CheckName, found: Violation) -> None:
        broken = self._checks[check]
        broken.count += 1
        if len(broken.violations) < MOST:
            broken.violations.append(found)

    def signed(self, report: SignatureReport) -> None:
        """Take the report on the file's signatures."""
        self._signature = report
        self._checks["signed"].looked += report.signatures
        for fault in report.faults:
            self.fail("signed", fault.text, fault.event, fault.time)

    def record(self, record: OwnRecord, arrived: int, captured: int) -> None:
        """Check one of Lockstep's own records; times in ns since 1970."""
        micros = arrived // 1000
        if record.epoch != self._epoch:
            self.fail("monotonic", f"a record of another epoch, {record.epoch!r}", record.event, micros)
        match record:
            case RobotRecord():
                self._description = record.description
                self._goals.describe(record.description)
                self._linked = record.link == "up"
                self._in_flight = None
            case SeatRecord():
                self._holder = record.holder
            case StopRecord():
                if wrong := self._stops.record(record):
                    self.fail("stopped", wrong, record.event, micros)
            case ActionRecord():
                self._checks["actions"].looked += record.state not in ("asked", "cancel")
                if wrong := self._actions.record(record):
                    self.fail("actions", wrong, record.event, micros)
            case RefusalRecord(by="robot", refused=refused) if self._in_flight is not None:
                if refused in (0, self._in_flight.event):
                    self._in_flight = None
            case CommandRecord(outcome="forwarded"):
                self._command(record, micros)
            case FeedbackRecord():
                self._feedback(record, micros, captured)
            case ReportRecord():
                self._report(record, micros)
            case TraceRecord():
                self._ages.trace(record)
            case Degraded(lost=lost):
                self.fail("complete", f"the recorder left out {lost} records", record.event, micros)

    def _command(self, command: CommandRecord, micros: int) -> None:
        self._commands += 1
        for check in (self._checks["seat"], self._checks["stopped"], self._checks["once"]):
            check.looked += 1
        if self._holder is not None and command.peer != self._holder:
            holds = f"{self._holder!r} holds the seat" if self._holder else "nobody holds the seat"
            self.fail("seat", f"a command of {command.peer!r} went to the robot while {holds}", command.event, micros)
        if self._stops.coming or self._stopped:
            self.fail("stopped", "a command went to the robot while it was stopped", command.event, micros)
        if self._in_flight is not None:
            self.fail("once", f"a command overtook that of event {self._in_flight.event}", command.event, micros)
        if self._newest is not None and command.event != event_after(self._newest.event):
            self.fail("once", f"a command is not the next after event {self._newest.event}", command.event, micros)
        self._judge_nonce(command, micros)
        self._actions.command(command)
        if wrong := self._goals.command(command):
            self.fail("goals", wrong, command.event, micros)
        self._in_flight = command

    def _judge_nonce(self, command: CommandRecord, micros: int) -> None:
        """Check that the driver has seen the feedback that the command answers."""
        known = None if self._newest is None else self._answered.get(self._newest.event)
        nonce = 0 if known is None else known.nonces.get(command.issue, 0)
        if nonce and command.nonce != nonce:
            text = f"the command has another nonce than issue {command.issue}, which it answers"
            self.fail("in_time", text, command.event, micros)

    def _feedback(self, feedback: FeedbackRecord, micros: int, captured: int) -> None:
        before, in_flight = self._newest, self._in_flight
        self._checks["monotonic"].looked += 1
        for wrong_stamp in self._stamps.feedback(feedback, captured):
            self._fail("stamps", wrong_stamp)
        if before is None:
            self._answered = {feedback.event: _Answered({}, {}, {})}  # the past is not known
        elif feedback.event == before.event:
            self._again(before, feedback, micros)
        elif is_newer(feedback.event, before.event):
            self._executed(before, feedback, micros)
        else:
            self.fail("monotonic", f"event {feedback.event} after event {before.event}", feedback.event, micros)
            return
        self._newest = feedback
        self._stopped = feedback.stop.stopped
        if wrong := self._stops.feedback(feedback):
            self.fail("stopped", wrong, feedback.event, micros)
        if wrong := self._actions.feedback(feedback, self._description):
            self.fail("actions", wrong, feedback.event, micros)
        executed = in_flight is not None and in_flight.event == feedback.event
        self._checks["goals"].looked += self._goals.looking
        if wrong := self._goals.feedback(feedback, in_flight if executed else None):
            self.fail("goals", wrong, feedback.event, micros)
        known = self._answered[feedback.event]
        known.times[feedback.issue] = feedback.time
        known.stopped[feedback.issue] = feedback.stop.stopped
        known.nonces[feedback.issue] = feedback.nonce

    def _again(self, before: FeedbackRecord, feedback: FeedbackRecord, micros: int) -> None:
        if feedback.issue <= before.issue:
            text = f"issue {feedback.issue} after issue {before.issue}: the event was executed again"
            self.fail("once", text, feedback.event, micros)
        if feedback.time < before.time:
            self.fail("monotonic", "the robot bridge's clock went back", feedback.event, micros)

    def _executed(self, before: FeedbackRecord, feedback: FeedbackRecord, micros: int) -> None:
        event = feedback.event
        self._events += 1
        self._settle_age()
        self._checks["complete"].looked += 1
        if event != event_after(before.event):
            missing = event_gap(event, before.event) - 1
            self.fail("complete", f"{missing} events are missing before event {event}", event, micros)
        if feedback.time < before.time:
            self.fail("monotonic", "the robot bridge's clock went back", event, micros)
        command, self._in_flight = self._in_flight, None
        if command is not None and command.event == event:
            self._judge_age(before, command, feedback, micros)
        elif self._commands > 0 or self._events > 1:  # the very first command may have been sent before the file began
            self.fail("once", f"event {event} was executed without a forwarded command", event, micros)
        self._answered = {
            before.event: self._answered.get(before.event, _Answered({}, {}, {})),
            event: _Answered({}, {}, {}),
        }

    def _judge_age(self, before: FeedbackRecord, command: CommandRecord, feedback: FeedbackRecord, micros: int) -> None:
        known = self._answered.get(before.event)
        if known is None or self._description is None:
            return
        check = self._checks["in_time"]
        check.looked += 1
        issued = known.times.get(command.issue)
        if issued is None:
            if self._events > 1:
                text = f"the command answers issue {command.issue}, which is not recorded"
                self.fail("in_time", text, command.event, micros)
            return
        self._ages.executed(feedback, feedback.time - issued, self._description.max_event_age, micros)
        if known.stopped.get(command.issue):
            self.fail("stopped", "the command answers a feedback that says stopped", command.event, micros)

    def _settle_age(self) -> None:
        if (late := self._ages.settle()) is not None:
            self._fail("in_time", late)

    def medium(self, stream: str, stamp: int, arrived: int, captured: int) -> None:
        """Check a picture or a sound of the robot; times in ns since 1970."""
        self._media += 1
        self._checks["stamps"].looked += 1
        for wrong in self._stamps.medium(stream, stamp, arrived, captured):
            self._fail("stamps", wrong)

    def _report(self, record: ReportRecord, micros: int) -> None:
        for stream in record.report.streams:
            key = record.peer, stream.stream
            before = self._rendered.get(key)
            self._rendered[key] = stream
            if before is None or "off" in (before.gate, stream.gate):
                continue  # its earlier rendering is not known, or was not promised
            self._checks["rendered"].looked += 1
            more = stream.violations - before.violations
            if more > 0:
                text = f"{record.name}'s page rendered {stream.stream} {more} times beyond the tolerance"
                self.fail("rendered", text, record.event, micros)

    def verdict(self, ended: int) -> Verdict:
        """Return the verdict, after the last record, which arrived at `ended` (µs)."""
        self._settle_age()
        for wrong in self._stamps.end(ended):
            self._fail("stamps", wrong)
        return Verdict(
            ok=all(check.ok for check in self._checks.values()),
            checks=self._checks,
            events=self._events,
            commands=self._commands,
            pictures_and_sounds=self._media,
            signature=self._signature,
        )

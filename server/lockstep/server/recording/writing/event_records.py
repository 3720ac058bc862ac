"""The record that an event of a session becomes, of events that need nothing else for it. No I/O, no clock."""

from typing import Literal, TypedDict

from lockstep.protocol.console import driver_kind
from lockstep.protocol.messages import Command, RefusalReason
from lockstep.server.audit.records import Actor
from lockstep.server.recording.format.records import (
    ActionRecord,
    CommandOutcome,
    CommandRecord,
    NoteRecord,
    OwnRecord,
    ParticipantsRecord,
    RefusalRecord,
    ReportRecord,
    RestRecord,
    SeatRecord,
    StatusRecord,
    StopRecord,
)
from lockstep.server.recording.writing.episode_written import EpisodeWritten
from lockstep.server.session_events import (
    ActionAsked,
    ActionCancelled,
    ActionUpdated,
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    NoteWritten,
    ParticipantsChanged,
    Refused,
    ResetDone,
    RestForwarded,
    SeatChanged,
    SpeedReported,
    StatusReceived,
    StopAnswered,
    StopSent,
)

__all__ = ["RecordedEvent", "record_of"]

RecordedEvent = (
    ActionAsked
    | ActionCancelled
    | ActionUpdated
    | CommandForwarded
    | CommandRefused
    | CommandRepeated
    | EpisodeWritten
    | NoteWritten
    | ParticipantsChanged
    | Refused
    | ResetDone
    | RestForwarded
    | SeatChanged
    | SpeedReported
    | StatusReceived
    | StopAnswered
    | StopSent
)


class _Now(TypedDict):
    epoch: str
    event: int


def record_of(event: RecordedEvent, epoch: str, current: int) -> OwnRecord:
    """Return the record of what happens in `epoch` while the event `current` holds."""
    now: _Now = {"epoch": epoch, "event": current}
    match event:
        case CommandForwarded(by, command):
            return _command(epoch, by, command, "forwarded")
        case CommandRefused(by, command, reason):
            return _command(epoch, by, command, "undelivered" if reason == "link_down" else "refused", reason)
        case CommandRepeated(by, command):
            return _command(epoch, by, command, "repeated")
        case RestForwarded(by, rest, why):
            return RestRecord(epoch=epoch, event=rest.event, peer=by.peer, why=why)
        case Refused():
            return _refusal(epoch, event)
        case StopSent() | StopAnswered() | ResetDone():
            return _stop(now, event)
        case ActionAsked() | ActionCancelled() | ActionUpdated():
            return _action(now, event)
        case EpisodeWritten(record):
            return record
        case SpeedReported(by, report):
            return ReportRecord(**now, peer=by.peer, name=by.name, report=report)
        case StatusReceived(status):
            return StatusRecord(epoch=epoch, event=status.event, items=status.items)
        case SeatChanged(seat, holder):
            return SeatRecord(**now, holder=seat.holder, name=seat.name, role=holder.role, why=seat.why)
        case ParticipantsChanged(message):
            return ParticipantsRecord(**now, participants=message.participants)
        case NoteWritten(note=note):
            return NoteRecord(**now, peer=note.peer, name=note.name, role=note.role, text=note.text)


def _command(
    epoch: str, by: Actor, command: Command, outcome: CommandOutcome, reason: RefusalReason | Literal[""] = ""
) -> CommandRecord:
    return CommandRecord(
        epoch=epoch,
        event=command.event,
        issue=command.issue,
        values=list(command.values),
        nonce=command.nonce,
        action=command.action,
        speed=command.speed,
        peer=by.peer,
        name=by.name,
        outcome=outcome,
        reason=reason,
        kind=driver_kind(by.role),
    )


def _refusal(epoch: str, event: Refused) -> RefusalRecord:
    refusal = event.refusal
    return RefusalRecord(
        epoch=epoch,
        event=refusal.current,
        refused=max(0, refusal.event),
        reason=refusal.reason,
        detail=refusal.detail,
        by=event.by,
        peer=event.to.peer,
        name=event.to.name,
    )


def _stop(now: _Now, event: StopSent | StopAnswered | ResetDone) -> StopRecord:
    match event:
        case StopSent(press, delivered):
            return StopRecord(
                **now,
                kind="stop",
                by=press.by.name,
                where=press.where,
                reason=press.reason,
                press=press.id,
                delivered=delivered,
            )
        case StopAnswered(press, taken):
            return StopRecord(
                **now,
                kind="taken",
                by=press.by.name,
                where="robot",
                press=taken.press,
                number=taken.number,
                kept=taken.kept,
            )
        case ResetDone(by, where, number):
            return StopRecord(**now, kind="reset", by=by.name, where=where, number=number)


def _action(now: _Now, event: ActionAsked | ActionCancelled | ActionUpdated) -> ActionRecord:
    match event:
        case ActionAsked(by, act):
            return ActionRecord(
                **now,
                id=act.id,
                name=act.name,
                state="asked",
                by=by.name,
                peer=by.peer,
                parameters=act.parameters,
                nonce=act.nonce,
            )
        case ActionCancelled(by, id):
            return ActionRecord(**now, id=id, name="", state="cancel", by=by.name, peer=by.peer)
        case ActionUpdated(update):
            return ActionRecord(
                epoch=now["epoch"],
                event=update.event,
                id=update.id,
                name=update.name,
                state=update.state,
                by=update.by,
                reason=update.reason,
                progress=update.progress,
                text=update.text,
                moves=update.moves,
            )

"""The events of a robot's session, and their subscribers: metrics, audit, recorder, notices and 3D scene.

The console decides and acts first: STOP, seat and commands need no subscriber. Then it publishes what has happened.
"""

from collections.abc import Callable
from typing import Literal, TypeVar

import msgspec

from lockstep.protocol.actions import Act, ActionUpdate, Status
from lockstep.protocol.console import Participants, Report, RobotState, Seat, ShadowVerdict, SharedNote, SpeedCapState
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeRequest
from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.protocol.messages import Command, Feedback, Refusal, RefusalReason, Rest, StopState, StopTaken
from lockstep.protocol.traces.trace import CommandSpans
from lockstep.protocol.traces.trace_messages import EventTrace
from lockstep.server.audit.records import Actor
from lockstep.server.stop.stop_presses import Press
from lockstep.server.telemetry.faults import Faults

__all__ = [
    "ActionAsked",
    "ActionCancelled",
    "ActionRefused",
    "ActionUpdated",
    "CommandForwarded",
    "CommandRefused",
    "CommandRepeated",
    "EpisodeAsked",
    "EpochBegan",
    "EventsTraced",
    "FeedbackReceived",
    "InputRefused",
    "RobotLinkDown",
    "RobotLinkUp",
    "MapReceived",
    "NavigationReceived",
    "NewcomerWelcomed",
    "NoteWritten",
    "ParticipantsChanged",
    "PeerJoined",
    "PeerLeft",
    "PeerRenamed",
    "Refused",
    "ResetDone",
    "ResetRefused",
    "RestForwarded",
    "RobotTaken",
    "SeatChanged",
    "SessionBegan",
    "SessionEvent",
    "SessionEvents",
    "ShadowJudged",
    "SilenceChanged",
    "SpeedCapChanged",
    "SpeedReported",
    "StatusReceived",
    "StopAnswered",
    "StopAsked",
    "StopRepeated",
    "StopSent",
    "StopShown",
    "StopSilenced",
    "StopUndelivered",
    "StopsDiskChanged",
]


class SessionEvent(msgspec.Struct, frozen=True):
    """Something that has happened. `Actor()` is the console itself."""


# commands


class CommandForwarded(SessionEvent, frozen=True):
    by: Actor
    command: Command  # as the robot got it


class CommandRefused(SessionEvent, frozen=True):
    """A `Refused` comes with it."""

    by: Actor
    command: Command
    reason: RefusalReason


class CommandRepeated(SessionEvent, frozen=True):
    by: Actor
    command: Command
    answered: bool  # with the current feedback; False: it was absorbed


class RestForwarded(SessionEvent, frozen=True):
    by: Actor
    rest: Rest
    why: str  # the change of the seat that the console rests for; "": `by` asked for it


class Refused(SessionEvent, frozen=True):
    """A peer was sent a refusal."""

    to: Actor  # Actor(): the robot refused, and there is no peer to tell
    channel: str
    refusal: Refusal
    by: Literal["console", "robot"]


class InputRefused(SessionEvent, frozen=True):
    """A peer has sent something that is no message, or the robot something that the console does not take."""

    channel: str  # "robot": of the robot
    error: str  # its name


class SpeedReported(SessionEvent, frozen=True):
    """The seat's holder has sent a report."""

    by: Actor
    report: Report


class SpeedCapChanged(SessionEvent, frozen=True):
    state: SpeedCapState


class ShadowJudged(SessionEvent, frozen=True):
    """The values that a shadow policy wanted for an event were judged; they did not reach the robot."""

    by: Actor
    verdict: ShadowVerdict


# the robot


class SessionBegan(SessionEvent, frozen=True):
    pass


class EpochBegan(SessionEvent, frozen=True):
    """The bridge was started anew. The peers of the last epoch are still there."""

    description: RobotDescription


class RobotLinkUp(SessionEvent, frozen=True):
    state: RobotState | None


class RobotLinkDown(SessionEvent, frozen=True):
    """The link for commands is down, or could not be opened again for another reason than before."""

    state: RobotState | None  # None: the robot was never reached
    detail: str
    was_up: bool


class RobotTaken(SessionEvent, frozen=True):
    """Another console has taken the robot."""

    detail: str


class FeedbackReceived(SessionEvent, frozen=True):
    feedback: Feedback
    now: float  # s on the monotonic clock
    turnaround: float | None  # s since the command that it answers was forwarded; None: it answers none
    spans: CommandSpans = CommandSpans()  # of that command, as bridge and console have measured them


class EventsTraced(SessionEvent, frozen=True):
    """The seat's holder has reported where the time of these events went."""

    by: Actor
    events: list[EventTrace]


class StopShown(SessionEvent, frozen=True):
    """A feedback has shown another state of the stop."""

    stop: StopState
    event: int


# actions and status


class ActionAsked(SessionEvent, frozen=True):
    """A request for an action went to the robot for the first time."""

    by: Actor
    act: Act


class ActionRefused(SessionEvent, frozen=True):
    """The console has refused an action; the robot's refusals are in `ActionUpdated`."""

    by: Actor
    update: ActionUpdate


class ActionCancelled(SessionEvent, frozen=True):
    """A cancel went to the robot for an action that runs."""

    by: Actor  # Actor(): the console, because the seat changes hands
    id: str  # "": the action that moves the robot


class ActionUpdated(SessionEvent, frozen=True):
    """The robot has said how an action does, or the console knows it because the link was lost."""

    update: ActionUpdate
    new_state: bool  # False: only its progress is new


class StatusReceived(SessionEvent, frozen=True):
    status: Status


class MapReceived(SessionEvent, frozen=True):
    map: OccupancyMap


class NavigationReceived(SessionEvent, frozen=True):
    """The robot has said where it is on its map, and where it is going."""

    navigation: Navigation


# episodes


class EpisodeAsked(SessionEvent, frozen=True):
    """A peer asks for something to be done with an episode."""

    by: Actor
    request: EpisodeRequest


# stops and resets


class StopAsked(SessionEvent, frozen=True):
    """Somebody asks for a STOP: a new press, a repeat, or one of a silenced link."""

    by: Actor
    where: str


class StopSilenced(SessionEvent, frozen=True):
    """A STOP was refused, because a supervisor has silenced its link."""

    by: Actor


class StopRepeated(SessionEvent, frozen=True):
    by: Actor
    where: str


class StopSent(SessionEvent, frozen=True):
    press: Press
    delivered: bool  # there was a link to send it on
    alone: bool  # no other press waits for the bridge's answer


class StopUndelivered(SessionEvent, frozen=True):
    """The bridge has not answered in time, or there is no link. The press is sent again."""

    press: Press


class StopAnswered(SessionEvent, frozen=True):
    press: Press
    taken: StopTaken
    again: bool  # it was undelivered before
    released: bool  # it was reset before


class ResetDone(SessionEvent, frozen=True):
    """The robot says that the stop is released."""

    by: Actor
    where: str
    number: int


class ResetRefused(SessionEvent, frozen=True):
    by: Actor
    where: str
    reason: RefusalReason


class SilenceChanged(SessionEvent, frozen=True):
    """A supervisor has silenced the stops of a link, or ended that."""

    by: Actor
    name: str
    link: str
    silent: bool


class StopsDiskChanged(SessionEvent, frozen=True):
    trouble: str  # why stops cannot be kept on disk; "": they can again


# people


class SeatChanged(SessionEvent, frozen=True):
    """The holder, the claims, the countdown or a name have changed."""

    seat: Seat
    holder: Actor  # Actor(): nobody
    by: Actor


class PeerJoined(SessionEvent, frozen=True):
    peer: Actor
    carriers: str  # of its media


class NewcomerWelcomed(SessionEvent, frozen=True):
    """A peer's channel of the session is open, and the console has told it what the console itself knows."""

    peer: Actor


class PeerLeft(SessionEvent, frozen=True):
    peer: Actor
    why: str


class PeerRenamed(SessionEvent, frozen=True):
    peer: Actor
    before: str


class ParticipantsChanged(SessionEvent, frozen=True):
    participants: Participants


class NoteWritten(SessionEvent, frozen=True):
    by: Actor
    note: SharedNote


Event = TypeVar("Event", bound=msgspec.Struct)


class SessionEvents:
    """Passes each event to the subscribers of its type, at once and in the order in which they have subscribed.

    A subscriber returns at once. An event that it publishes itself is heard before the next subscriber hears the first
    one. Its exceptions are counted as faults of the console and reach neither the publisher nor another subscriber.
    """

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._subscribers: dict[type[msgspec.Struct], tuple[Callable[[msgspec.Struct], None], ...]] = {}

    def subscribe(self, kind: type[Event], hear: Callable[[Event], None]) -> None:
        """Call `hear` with each event of exactly this type."""
        # `publish` looks up the event's own type, so `hear` gets no other.
        self._subscribers[kind] = (*self._subscribers.get(kind, ()), hear)  # type: ignore[arg-type]

    def publish(self, event: msgspec.Struct) -> None:
        for hear in self._subscribers.get(type(event), ()):
            try:
                hear(event)
            except Exception as error:
                self._faults.caught(f"hearing {type(event).__name__}", error)

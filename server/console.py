"""The console: the one owner of its state. Hears the robot and the peers, decides by the cores, tells everyone."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Protocol

import structlog

from robot_bridge.protocol.console import (
    ClientMessage,
    Note,
    Notice,
    Rename,
    Report,
    RobotState,
    SeatDecline,
    SeatGrant,
    SeatRelease,
    SeatRequest,
    SeatTake,
    ServerMessage,
    StopStateNotice,
    Welcome,
    encode_console_message,
)
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.protocol.messages import (
    PROTOCOL_VERSION,
    Command,
    Feedback,
    Media,
    Ping,
    Pong,
    Refusal,
    RefusalReason,
    Reset,
    Rest,
    Stop,
    StopState,
)
from server.audit import Actor
from server.audit_trail import AuditTrail, RecordKeeper
from server.channels import ChannelName
from server.command_desk import Absorbed, Answer, CommandDesk, Forward, Outcome, Refuse
from server.errors import ChannelError, Flood, LinkDown
from server.event_clock import EventClock
from server.feedback_fanout import FeedbackFanout
from server.feedback_viewer import FeedbackViewer, NoViewer
from server.metrics import Metrics
from server.peer import Peer
from server.peers import Peers
from server.people import People
from server.robot_connection import RobotConnection
from server.seat import SeatRefusal, SeatTimes
from server.seat_keeper import SeatKeeper
from server.session_tap import SessionTap
from server.settings import Settings
from server.speed_cap import SpeedCap
from server.versions import console_version, description_hash, page_build

__all__ = ["Console", "FeedbackViewer", "MediaFeed"]

log = structlog.get_logger(__name__)

UNDELIVERED = "The stop could not be delivered: there is no link to the robot. It is sent first when the link is back."
UNWRITTEN = "The audit log cannot be written ({}). The console goes on; what happens now may be missing from the log."
RESTART_AFTER = 1.0  # s until a background task that failed runs again


class MediaFeed(Protocol):
    """What the console needs of the media plane."""

    def configure(self, description: RobotDescription) -> None: ...
    def feed(self, media: Media, now: float) -> None: ...


class Console:
    """Enter `run` once; it returns when cancelled, with all peers and links closed."""

    def __init__(
        self,
        settings: Settings,
        metrics: Metrics,
        media: MediaFeed,
        viewer: FeedbackViewer | None,
        audit_log: RecordKeeper,
        clock: EventClock | None = None,
        tap: SessionTap | None = None,
    ) -> None:
        self.clock = clock or EventClock()
        self._tap = tap or SessionTap()
        self.audit = AuditTrail(self.clock, audit_log)
        self.robot = RobotConnection(settings, self)
        self.peers = Peers(settings, metrics, lambda peer: self.people.joined(peer), self._tap.told)
        times = SeatTimes(settings.seat_timeout, settings.seat_idle_seconds, settings.seat_claim_seconds)
        self.seat = SeatKeeper(times, self.peers, self, self.audit)
        self.people = People(self.peers, self.clock, self.audit, self.seat.renamed, self._refuse_request)
        self.people.remember(audit_log)
        self.further_news: list[Callable[[], ServerMessage]] = []  # what else newcomers are told
        self._metrics = metrics
        self._media = media
        self._viewer = viewer or NoViewer()
        self.speed_cap = SpeedCap(settings.speed_cap)
        self._desk = CommandDesk(self.clock, self.seat.rules, self.speed_cap)
        self._fanout = FeedbackFanout(settings.observer_feedback_hz, self.peers.drivers, self.peers.observers)
        self._forwarded_at = 0.0  # when the command in flight left
        self._shown_stop = StopState()  # what everyone was told last
        self._link_was_up = False
        self._audit_trouble = ""

    async def run(self) -> None:
        """Until cancelled. The peers end before the links: the last thing that leaves is the rest."""
        self.audit.started(console_version(), page_build(), PROTOCOL_VERSION)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._guard("feedback", self._fanout.run))
            tasks.create_task(self._guard("seat", self.seat.watch))
            tasks.create_task(self._guard("audit", self.audit.run))
            tasks.create_task(self._guard("participants", self.people.share))
            tasks.create_task(self._guard("robot", self.robot.run))
            try:
                await asyncio.Event().wait()
            finally:
                await self.peers.close()

    def state_of_robot(self, description: RobotDescription) -> RobotState:
        return RobotState(
            link="up" if self.robot.up else "down",
            epoch=self.robot.epoch,
            description=description,
            detail=self.robot.detail,
        )

    # what peers and HTTP ask for

    def link_holds_seat(self, link: str) -> bool:
        """Whether a peer with the link of this id drives."""
        holder = self.peers.by_id(self.seat.rules.holder)
        return holder is not None and holder.identity.token_id == link

    @property
    def latched_stop(self) -> Stop | None:
        return self._desk.latched

    def stop(self, by: Actor, where: str, reason: str) -> bool:
        """Latch the stop. False when no link lives: then it is sent as soon as one does, before all else."""
        self._metrics.stops.labels(where).inc()
        outcome = self._desk.stop(by.name, reason, time.monotonic())
        if isinstance(outcome, Absorbed):
            return True
        stop = outcome.message
        if not isinstance(stop, Stop):
            raise TypeError(stop)
        delivered = self.robot.send_stop(stop)
        if not delivered:
            self.peers.tell("session", Notice(level="error", text=UNDELIVERED))
        if self.clock.stop.stopped:
            self.audit.again("stop", by, f"{where}, again")
        else:
            self.audit.record("stop", by, where if delivered else f"{where}, not delivered yet", reason)
        self._tap.stop_asked(by, where, reason, delivered=delivered)
        log.warning("stop", by=by.name, where=where, reason=reason, delivered=delivered)
        return delivered

    def reset(self, by: Actor, where: str, number: int) -> None:
        """Release the latched stop; the caller has checked the role. `number`: of the newest stop that they have seen.

        Raises:
            LinkDown: the robot cannot be told.
        """
        outcome = self._desk.reset(by.name, number)
        if not isinstance(outcome, Forward) or not self._forward(outcome):
            raise LinkDown(self.robot.detail)
        self._metrics.resets.inc()
        self.audit.record("reset", by, where)
        self._tap.reset_asked(by, where)
        log.warning("reset", by=by.name, where=where)

    def audit_trouble(self, trouble: str, lost: int) -> None:
        """The audit log cannot be written, for a reason, or can again: "". `lost`: records that never will be."""
        self._audit_trouble = trouble
        self._metrics.audit_failing.set(bool(trouble))
        if trouble:
            self.peers.tell("session", Notice(level="warning", text=UNWRITTEN.format(trouble)))
            return
        self.audit.record("audit", what="written again", detail=f"{lost} records lost since the start")
        self.peers.tell("session", Notice(level="info", text="The audit log is written again."))

    # PeerHost

    def channel_opened(self, peer: Peer, channel: ChannelName) -> None:
        """A newcomer is told all there is to know on this channel."""
        if channel == "control" and self.clock.feedback is not None:
            peer.send_feedback(encode_console_message(self.clock.feedback))
        elif channel == "stop":
            peer.send("stop", StopStateNotice(stop=self.clock.stop, event=self.clock.event))
        elif channel == "session":
            peer.send(
                "session", Welcome(peer=peer.id, role=peer.role, name=peer.name, streams=peer.streams, voice=peer.voice)
            )
            if self.robot.description is not None:
                peer.send("session", self.state_of_robot(self.robot.description))
            peer.send("session", self.seat.message())
            peer.send("session", self.speed_cap.state(time.monotonic()))
            for news in self.further_news:
                peer.send("session", news())
            self.people.welcome(peer)
            if self._audit_trouble:
                peer.send("session", Notice(level="warning", text=UNWRITTEN.format(self._audit_trouble)))

    def message_received(self, peer: Peer, channel: ChannelName, message: ClientMessage) -> None:
        now = time.monotonic()
        self.seat.heard(peer)
        match message:
            case Command():
                self._settle(peer, "control", self._desk.command(peer.id, message, now), message)
            case Rest():
                self._settle(peer, "control", self._desk.rest(peer.id, message))
            case Ping():
                peer.send("control", Pong(id=message.id))
            case Stop():
                self.stop(peer.actor, channel, message.reason)
            case SeatRelease():
                self.seat.handle(peer, message)
            case Note():
                self.people.write(peer, message.text)
            case Reset() | SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | Rename() if not peer.asks.take(
                now
            ):
                self._refuse_request(peer, "too_often")
            case Reset():
                self._reset_by(peer, message.number)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake():
                self.seat.handle(peer, message)
            case Rename():
                self.people.rename(peer, message.name)
            case Report():  # the peer keeps it
                if message.ping is not None:
                    peer.send("control", Pong(id=message.ping))
                self._report_speed(peer, message)

    def input_refused(self, peer: Peer, channel: str, error: ChannelError) -> None:
        self._metrics.bad_input.labels(channel, error.name).inc()
        if channel in ("other", "transport") or isinstance(error, Flood):
            return  # no answer: there is no channel for it, or it would feed the flood
        answer = Refusal(
            event=0, reason="malformed", current=self.clock.event, detail=f"{error.name}: {error.detail}"[:500]
        )
        peer.send("control" if channel == "control" else "session", answer)

    def peer_ended(self, peer: Peer) -> None:
        self.seat.gone(peer)
        self.people.left(peer)

    def peer_failed(self, peer: Peer, stage: str, error: Exception) -> None:
        self._metrics.faults.caught(f"peer {stage}", error, peer=peer.id)

    # SeatHost

    def rest_robot(self, why: str) -> None:
        """Before anybody else drives: what the last holder has under way is void too."""
        rest = self._desk.abandon()
        if isinstance(rest, Forward) and self._forward(rest):
            self._metrics.rests.labels(why).inc()
            if isinstance(rest.message, Rest):
                self._tap.rest(Actor(), rest.message, why)

    def refuse(self, peer: Peer, refusal: SeatRefusal) -> None:
        self._refuse_request(peer, refusal.reason, refusal.detail)

    # RobotHost

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        """References of different epochs are never compared: every peer starts anew."""
        self._desk.epoch_ends()
        self.clock.begin(epoch)
        self.speed_cap.forget()
        self.audit.epoch(description.label, description_hash(description))
        self._shown_stop = StopState()
        self.peers.end_all("new epoch")
        self._media.configure(description)
        self._viewer.configure(description)

    def link_up(self) -> None:
        if self.robot.description is None:
            raise TypeError("a link is up only after its hello")
        self._link_was_up = True
        self._metrics.link_up.set(1)
        stop = self._desk.link_up(self.robot.description)
        if stop is not None:
            self.robot.send_stop(stop)
            self.audit.record("stop", Actor(stop.by), "sent again", stop.reason)
        self.audit.record("link_up")
        self.peers.tell("session", self.state_of_robot(self.robot.description))

    def link_down(self, detail: str) -> None:
        if self._link_was_up:
            self._metrics.link_losses.inc()
            self.audit.record("link_down", detail=detail)
        self._link_was_up = False
        self._metrics.link_up.set(0)
        self._desk.link_down()
        if self.robot.description is not None:
            self.peers.tell("session", self.state_of_robot(self.robot.description))

    def feedback_received(self, feedback: Feedback) -> None:
        now = time.monotonic()
        if not self.clock.observe(feedback, now):
            return
        answered = self._desk.in_flight
        self._desk.feedback(feedback)
        self._tap.feedback(feedback, now)
        self._fanout.publish(encode_console_message(feedback))
        self.speed_cap.fed_back(feedback, now)
        if answered is not None and self._desk.in_flight is None:
            self._metrics.robot_turnaround.observe(now - self._forwarded_at)
        self._metrics.feedback.inc()
        self._metrics.event.set(feedback.event)
        self._metrics.stopped.set(feedback.stop.stopped)
        for limit in feedback.limits:
            self._metrics.limited.labels(limit).inc()
        if feedback.stop != self._shown_stop:
            self._shown_stop = feedback.stop
            self.peers.tell("stop", StopStateNotice(stop=feedback.stop, event=feedback.event))
        self._viewer.feedback(feedback)

    def refusal_received(self, refusal: Refusal) -> None:
        self._metrics.refusals.labels(refusal.reason).inc()
        peer = self.peers.by_id(self._desk.refused(refusal))
        self._tap.refused(Actor() if peer is None else peer.actor, refusal, "robot")
        if peer is not None:
            self.audit.refused(peer.actor, refusal.reason)
            peer.send("control", refusal)

    def media_received(self, media: Media) -> None:
        self._media.feed(media, time.monotonic())

    # what follows from the cores' outcomes

    def _settle(self, peer: Peer, channel: ChannelName, outcome: Outcome, command: Command | None = None) -> None:
        if isinstance(outcome, Forward) and not self._forward(outcome):
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self.clock.event))
        if isinstance(outcome, Answer) and not peer.may_be_answered_again():
            outcome = Absorbed()
        match outcome:
            case Answer(feedback):
                peer.send_feedback(encode_console_message(feedback))
            case Refuse(refusal):
                self._refuse(peer, channel, refusal)
                if refusal.reason == "out_of_order" and self.clock.feedback is not None:
                    peer.send_feedback(encode_console_message(self.clock.feedback))
            case Forward(Command() as forwarded) if self._desk.moves(forwarded):
                self.seat.moved(peer)
            case Forward(Rest() as rest):
                self._tap.rest(peer.actor, rest, "")
        if command is not None:
            self._tap.command(peer.actor, command, outcome)
            self._metrics.commands.labels(type(outcome).__name__.lower()).inc()

    def _refuse_request(self, peer: Peer, reason: RefusalReason, detail: str = "") -> None:
        self._refuse(peer, "session", Refusal(event=0, reason=reason, current=self.clock.event, detail=detail))

    def _refuse(self, peer: Peer, channel: ChannelName, refusal: Refusal) -> None:
        self._metrics.refusals.labels(refusal.reason).inc()
        self.audit.refused(peer.actor, refusal.reason)
        self._tap.refused(peer.actor, refusal, "console")
        peer.send(channel, refusal)

    def _forward(self, outcome: Forward) -> bool:
        message = outcome.message
        if isinstance(message, Stop):
            return self.robot.send_stop(message)
        if isinstance(message, Command):
            self._forwarded_at = time.monotonic()
            self._viewer.command(message)
        return self.robot.send(message)

    def _report_speed(self, peer: Peer, report: Report) -> None:
        if not self.seat.rules.holds(peer.id):
            return
        self._tap.report(peer.actor, report)
        now = time.monotonic()
        self.speed_cap.reported(peer.id, report, now)
        news = self.speed_cap.news(now)
        if news is not None:
            self._metrics.speed_share.set(news.share)
            self.peers.tell("session", news)

    def _reset_by(self, peer: Peer, number: int) -> None:
        refusal = Refusal(event=0, reason="not_allowed", current=self.clock.event, detail="observers do not reset")
        if peer.role != "observer":
            try:
                self.reset(peer.actor, "stop", number)
                return
            except LinkDown as error:
                refusal = Refusal(event=0, reason="link_down", current=self.clock.event, detail=error.detail[:500])
        self._refuse(peer, "stop", refusal)

    # background tasks

    async def _guard(self, name: str, task: Callable[[], Awaitable[None]]) -> None:
        """Runs `task` again when it fails: a fault of ours in one place must not take the seat's watchdog with it."""
        while True:
            try:
                await task()
            except Exception as error:
                self._metrics.faults.caught(name, error, what="a background task, which runs again")
            await asyncio.sleep(RESTART_AFTER)

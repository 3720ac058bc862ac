"""The console, sole owner of its state: takes messages of the robot and the peers, decides, and tells everyone."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Protocol

import structlog

from lockstep.protocol.console import (
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
    SilenceStops,
    StopStateNotice,
    Welcome,
    encode_console_message,
)
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import (
    PROTOCOL_VERSION,
    Command,
    Feedback,
    LinkRole,
    Media,
    Ping,
    Pong,
    Refusal,
    RefusalReason,
    Reset,
    Rest,
    Stop,
    StopState,
    StopTaken,
)
from lockstep.server.audit.audit_trail import AuditTrail, RecordKeeper
from lockstep.server.audit.records import Actor
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.control.command_arbiter import (
    Absorbed,
    Answer,
    CommandArbiter,
    Forward,
    ForwardRest,
    Refuse,
    RestOutcome,
)
from lockstep.server.control.participants import ParticipantList
from lockstep.server.control.scene_feed import NoSceneFeed, SceneFeed
from lockstep.server.control.seat import SeatRefusal, SeatTimes
from lockstep.server.control.seat_keeper import SeatKeeper
from lockstep.server.control.session_listener import SessionListener
from lockstep.server.control.speed_cap import SpeedCap
from lockstep.server.control.stop_service import StopService
from lockstep.server.errors import ChannelError, Flood, Silenced
from lockstep.server.event_clock import EventClock
from lockstep.server.http.versions import console_version, description_hash, page_build
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.feedback_fanout import FeedbackFanout, FeedbackReceiver
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.robot.robot_connection import RobotConnection
from lockstep.server.settings import Settings
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import new_press
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.uncancelled import attempt

__all__ = ["Console", "SceneFeed", "MediaFeed"]

log = structlog.get_logger(__name__)

TAKEN = "Another console has taken the robot. This console cannot drive it; STOP works while its media link is up."
UNWRITTEN = "The audit log cannot be written ({}). The console goes on; what happens now may be missing from the log."
RESTART_AFTER = 1.0  # s until a background task that failed runs again


class MediaFeed(Protocol):
    """The part of the media hub that the console uses."""

    def configure(self, description: RobotDescription) -> None: ...
    def feed(self, media: Media, now: float) -> None: ...


class Console:
    """The console of one robot. Call `run` once; it returns when cancelled, with all peers and links closed."""

    def __init__(
        self,
        settings: Settings,
        metrics: Metrics,
        media: MediaFeed,
        scene: SceneFeed | None,
        audit_log: RecordKeeper,
        clock: EventClock | None = None,
        listener: SessionListener | None = None,
        *,
        stops: StopKeeper,
        silenced: SilencedLinks | None = None,
    ) -> None:
        """`silenced`: the silenced links of all robots of this console; None: this robot has its own."""
        self.clock = clock or EventClock()
        self._listener = listener or SessionListener()
        self.audit = AuditTrail(self.clock, audit_log)
        self.robot = RobotConnection(settings, self)
        self.peers = PeerRegistry(settings, metrics, self._joined, self._listener.told)
        times = SeatTimes(settings.seat_timeout, settings.seat_idle_seconds, settings.seat_claim_seconds)
        self.seat = SeatKeeper(times, self.peers, self, self.audit)
        self.people = ParticipantList(self.peers, self.clock, self.audit, self.seat.renamed, self._refuse_request)
        self.further_news: list[Callable[[], ServerMessage]] = []  # further messages to newcomers
        self._metrics = metrics
        self._media = media
        self._scene = scene or NoSceneFeed()
        self.speed_cap = SpeedCap(settings.speed_cap)
        self._arbiter = CommandArbiter(self.clock, self.seat.rules, stops.presses, self.speed_cap)
        self.stops = StopService(
            self.robot, stops, self.peers, self.clock, self._holder, self.audit, metrics, self._listener, silenced
        )
        self._fanout = FeedbackFanout(
            settings.observer_feedback_hz, self._is_driven_by, self.peers.drivers, self.peers.observers
        )
        self._forwarded_at = 0.0  # departure of the command in flight
        self._shown_stop = StopState()  # state that everyone was told last
        self._link_was_up = False
        self._robot_is_taken = False  # another console has the robot, and everyone was told
        self._audit_trouble = ""

    async def run(self) -> None:
        """Run until cancelled. The peers end before the links, so the last message to the robot is the rest."""
        self.audit.started(console_version(), page_build(), PROTOCOL_VERSION)
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._guard("feedback", self._fanout.run))
            tasks.create_task(self._guard("seat", self.seat.watch))
            tasks.create_task(self._guard("stops", self.stops.run))
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

    def link_holds_seat(self, link: str) -> bool:
        """True if a peer with the link of this id holds the seat."""
        holder = self.peers.by_id(self.seat.rules.holder)
        return holder is not None and holder.identity.token_id == link

    def audit_trouble(self, trouble: str, lost: int) -> None:
        """Tell everyone why the audit log cannot be written; "": it can again. `lost`: records lost for good."""
        self._audit_trouble = trouble
        self._metrics.audit_failing.set(bool(trouble))
        if trouble:
            self.peers.tell("session", Notice(level="warning", text=UNWRITTEN.format(trouble)))
            return
        self.audit.record("audit", what="written again", detail=f"{lost} records lost since the start")
        self.peers.tell("session", Notice(level="info", text="The audit log is written again."))

    # PeerHost

    def channel_opened(self, peer: Peer, channel: ChannelName) -> None:
        """Send a newcomer the whole state that this channel carries."""
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
            if self.stops.trouble:
                peer.send("session", Notice(level="warning", text=self.stops.trouble))
            if self._audit_trouble:
                peer.send("session", Notice(level="warning", text=UNWRITTEN.format(self._audit_trouble)))

    def message_received(self, peer: Peer, channel: ChannelName, message: ClientMessage) -> None:
        now = time.monotonic()
        self.seat.heard(peer)
        match message:
            case Command():
                self._command(peer, message, now)
            case Rest():
                self._rest(peer, self._arbiter.rest(peer.id, message))
            case Ping():
                peer.send("control", Pong(id=message.id))
            case Stop():
                self._stop(peer, channel, message)
            case SeatRelease():
                self.seat.handle(peer, message)
            case Note():
                self.people.write(peer, message.text)
            case Reset():
                self.stops.reset_by_peer(peer, message.number)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | SilenceStops() | Rename() if (
                not peer.asks.take(now)
            ):
                self._refuse_request(peer, "too_often")
            case SilenceStops():
                self._silence(peer, message)
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
        """Rest the robot before anybody else drives: the last holder's command in flight is void too."""
        outcome = self._arbiter.abandon()
        if isinstance(outcome, ForwardRest) and self.robot.send(outcome.rest):
            self._metrics.rests.labels(why).inc()
            self._listener.rest(Actor(), outcome.rest, why)

    def refuse(self, peer: Peer, refusal: SeatRefusal) -> None:
        self._refuse_request(peer, refusal.reason, refusal.detail)

    # RobotHost

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        """Begin an epoch. References of different epochs are never compared, so every peer starts anew."""
        self.stops.epoch_ends(self.clock.stop)
        self._arbiter.epoch_ends()
        self.clock.begin(epoch)
        self.speed_cap.forget()
        self.audit.epoch(description.label, description_hash(description))
        self._shown_stop = StopState()
        self.peers.end_all("new epoch")
        self._media.configure(description)
        self._scene.configure(description)

    def link_up(self) -> None:
        if self.robot.description is None:
            raise TypeError("a link is up only after its hello")
        self._link_was_up = True
        self._metrics.link_up.set(1)
        self.stops.link_up()
        self._arbiter.link_up(self.robot.description)
        self.audit.record("link_up")
        self.peers.tell("session", self.state_of_robot(self.robot.description))

    def link_down(self, detail: str) -> None:
        if self._link_was_up:
            self._metrics.link_losses.inc()
            self.audit.record("link_down", detail=detail)
        if self._link_was_up or not detail.startswith("taken"):
            self._robot_is_taken = False
        if detail.startswith("taken") and not self._robot_is_taken:
            self._robot_is_taken = True
            self.audit.record("link_down", what="taken", detail=detail)
            self.peers.tell("session", Notice(level="error", text=TAKEN))
        self._link_was_up = False
        self._metrics.link_up.set(0)
        self._arbiter.link_down()
        self.stops.link_down(detail)
        if self.robot.description is not None:
            self.peers.tell("session", self.state_of_robot(self.robot.description))

    def feedback_received(self, feedback: Feedback) -> None:
        now = time.monotonic()
        if not self.clock.observe(feedback, now):
            return
        answered = self._arbiter.in_flight
        self._arbiter.feedback(feedback)
        self.stops.feedback(feedback.stop)
        self._listener.feedback(feedback, now)
        self._fanout.publish(encode_console_message(feedback))
        self.speed_cap.fed_back(feedback, now)
        if answered is not None and self._arbiter.in_flight is None:
            self._metrics.robot_turnaround.observe(now - self._forwarded_at)
        self._metrics.feedback.inc()
        self._metrics.event.set(feedback.event)
        self._metrics.stopped.set(feedback.stop.stopped)
        self._metrics.limits_acted(feedback.limits)
        if feedback.stop != self._shown_stop:
            self._shown_stop = feedback.stop
            self.peers.tell("stop", StopStateNotice(stop=feedback.stop, event=feedback.event))
        self._scene.feedback(feedback)

    def refusal_received(self, refusal: Refusal) -> None:
        if self.stops.refused(refusal):
            return
        self._metrics.refusals.labels(refusal.reason).inc()
        peer = self.peers.by_id(self._arbiter.refused(refusal))
        self._listener.refused(Actor() if peer is None else peer.actor, refusal, "robot")
        if peer is not None:
            self.audit.refused(peer.actor, refusal.reason)
            peer.send("control", refusal)

    def stop_taken(self, taken: StopTaken) -> None:
        self._arbiter.stop_taken(taken)
        self.stops.taken(taken)

    def media_received(self, media: Media) -> None:
        self._media.feed(media, time.monotonic())

    def link_failed(self, role: LinkRole, error: Exception) -> None:
        self._metrics.faults.caught(f"robot link {role}", error)

    # acting on outcomes

    def _command(self, peer: Peer, command: Command, now: float) -> None:
        outcome = self._arbiter.command(peer.id, command, now)
        if isinstance(outcome, Forward) and not self._forward(outcome):
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self.clock.event))
        if isinstance(outcome, Answer) and not peer.may_be_answered_again():
            outcome = Absorbed()
        match outcome:
            case Answer(feedback):
                peer.send_feedback(encode_console_message(feedback))
            case Refuse(refusal):
                self._refuse(peer, "control", refusal)
                if refusal.reason in ("out_of_order", "unseen", "late") and self.clock.feedback is not None:
                    peer.send_feedback(encode_console_message(self.clock.feedback))
            case Forward(forwarded) if self._arbiter.moves(forwarded):
                self.seat.moved(peer)
        self._listener.command(peer.actor, command, outcome)
        self._metrics.commands.labels(type(outcome).__name__.lower()).inc()

    def _rest(self, peer: Peer, outcome: RestOutcome) -> None:
        if isinstance(outcome, ForwardRest):
            if self.robot.send(outcome.rest):
                self._listener.rest(peer.actor, outcome.rest, "")
                return
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self.clock.event))
        if isinstance(outcome, Refuse):
            self._refuse(peer, "control", outcome.refusal)

    def _stop(self, peer: Peer, channel: ChannelName, stop: Stop) -> None:
        try:
            self.stops.stop(new_press(peer.actor, channel, stop.reason, stop.press), stop.press)
        except Silenced as error:
            self._metrics.refusals.labels("silenced").inc()
            refusal = Refusal(event=0, reason="silenced", current=self.clock.event, detail=error.detail)
            self._listener.refused(peer.actor, refusal, "console")
            peer.send("stop", refusal)

    def _silence(self, peer: Peer, message: SilenceStops) -> None:
        reason = self.stops.silence(peer, message.peer, silent=message.silent)
        if reason is not None:
            self._refuse_request(peer, reason, "a supervisor can silence only operators and observers")

    def _joined(self, peer: Peer) -> None:
        peer.silenced = self.stops.is_silenced(peer.identity.token_id)
        peer.drives(False)
        self.people.joined(peer)

    def _is_driven_by(self, peer: FeedbackReceiver) -> bool:
        return isinstance(peer, Peer) and self.seat.rules.holds(peer.id)

    def _holder(self) -> str:
        return self.seat.rules.holder

    def _refuse_request(self, peer: Peer, reason: RefusalReason, detail: str = "") -> None:
        self._refuse(peer, "session", Refusal(event=0, reason=reason, current=self.clock.event, detail=detail))

    def _refuse(self, peer: Peer, channel: ChannelName, refusal: Refusal) -> None:
        self._metrics.refusals.labels(refusal.reason).inc()
        self.audit.refused(peer.actor, refusal.reason)
        self._listener.refused(peer.actor, refusal, "console")
        peer.send(channel, refusal)

    def _forward(self, outcome: Forward) -> bool:
        self._forwarded_at = time.monotonic()
        self._scene.command(outcome.command)
        return self.robot.send(outcome.command)

    def _report_speed(self, peer: Peer, report: Report) -> None:
        if not self.seat.rules.holds(peer.id):
            return
        self._listener.report(peer.actor, report)
        now = time.monotonic()
        self.speed_cap.reported(peer.id, report, now)
        news = self.speed_cap.news(now)
        if news is not None:
            self._metrics.speed_share.set(news.share)
            self.peers.tell("session", news)

    # background tasks

    async def _guard(self, name: str, task: Callable[[], Awaitable[None]]) -> None:
        """Run `task` again when it fails: a fault in one place must not take the seat's watchdog with it."""
        while True:
            try:
                await attempt(task())
            except Exception as error:
                self._metrics.faults.caught(name, error, what="a background task, which runs again")
            await asyncio.sleep(RESTART_AFTER)

"""The console, sole owner of its state: takes messages of the robot and the peers, decides, and tells everyone."""

import asyncio
import time
from collections.abc import Sequence
from typing import Protocol

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate, Status
from lockstep.protocol.console import (
    ClientMessage,
    Note,
    Rename,
    Report,
    SeatDecline,
    SeatGrant,
    SeatOffer,
    SeatRelease,
    SeatRequest,
    SeatTake,
    Shadow,
    SilenceStops,
    StopStateNotice,
    Welcome,
    encode_console_message,
)
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeRequest
from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.protocol.messages import (
    Command,
    Feedback,
    LinkRole,
    Ping,
    Pong,
    Refusal,
    RefusalReason,
    Reset,
    Rest,
    Stop,
    StopState,
    StopTaken,
    plain_feedback,
    spans_of,
)
from lockstep.protocol.traces.trace_messages import TraceReport, TraceRequest
from lockstep.server.actions.action_service import ActionService
from lockstep.server.actions.navigation_service import NavigationService
from lockstep.server.actions.status_service import StatusService
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor
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
from lockstep.server.control.policies.shadow_service import ShadowService
from lockstep.server.control.seat import ControlSeat, SeatRefusal
from lockstep.server.control.seat_keeper import SeatKeeper
from lockstep.server.control.speed_cap import SpeedCap
from lockstep.server.control.stop.reset_service import ResetService
from lockstep.server.control.stop.stop_service import StopService
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.control.trace_service import TraceService, command_spans
from lockstep.server.errors import ChannelError, Flood, Silenced
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.feedback_fanout import FeedbackFanout, FeedbackReceiver
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.robot.robot_connection import MediaSink, RobotConnection
from lockstep.server.session_events import (
    CommandForwarded,
    CommandRefused,
    CommandRepeated,
    EpisodeAsked,
    EpochBegan,
    EventsTraced,
    FeedbackReceived,
    InputRefused,
    LinkDown,
    LinkUp,
    MapReceived,
    NavigationReceived,
    NewcomerWelcomed,
    Refused,
    RestForwarded,
    RobotTaken,
    SessionBegan,
    SessionEvents,
    SpeedCapChanged,
    SpeedReported,
    StatusReceived,
    StopShown,
)
from lockstep.server.settings import Settings
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import new_press
from lockstep.server.telemetry.background import keep_running
from lockstep.server.telemetry.faults import Faults

__all__ = ["Console", "MediaFeed"]


class MediaFeed(MediaSink, Protocol):
    """The part of the media hub that the console uses. The robot's media go there without passing the console."""

    def configure(self, description: RobotDescription) -> None: ...


class Console:
    """The console of one robot. Call `run` once; it returns when cancelled, with all peers and links closed."""

    def __init__(
        self,
        settings: Settings,
        events: SessionEvents,
        faults: Faults,
        media: MediaFeed,
        peers: PeerRegistry,
        seat: ControlSeat,
        audit: AuditTrail,
        clock: EventClock,
        *,
        stops: StopKeeper,
        silence: StopSilence,
        relays: Sequence[FeedbackReceiver] = (),
        dial_in: DialIn | None = None,
    ) -> None:
        """Make the console; it publishes to `events`, whether anybody subscribes or not.

        Args:
            audit: the trail that the console runs
            relays: get feedback as observers do
            dial_in: where the robot connects to this console; None: the console connects to it
        """
        self.clock = clock
        self.audit = audit
        self.peers = peers
        self._events = events
        self._faults = faults
        self._media = media
        self.robot = RobotConnection(settings, self, media, dial_in)
        self.seat = SeatKeeper(seat, peers, self, events)
        self.people = ParticipantList(peers, clock, events, self.seat.renamed)
        self.speed_cap = SpeedCap(settings.speed_cap)
        self._arbiter = CommandArbiter(clock, seat, stops.presses, self.speed_cap)
        self.silence = silence
        self.stops = StopService(self.robot, stops, peers, clock, silence, events)
        self.resets = ResetService(self.robot, self.stops, peers, clock, seat, events)
        self.actions = ActionService(self.robot, clock, self.seat.is_held_by, self.seat.may_move, events)
        self.status = StatusService()
        self.navigation = NavigationService()
        self.shadows = ShadowService(peers, events)
        self._fanout = FeedbackFanout(
            settings.observer_feedback_hz, self.seat.is_held_by, peers.drivers, peers.observers, relays
        )
        self.traces = TraceService()
        self._forwarded_at = 0.0  # departure of the command in flight
        self._forward_seconds = 0.0  # from its arrival to its departure
        self._shown_stop = StopState()  # state that was published last
        self._link_was_up = False
        self._robot_is_taken = False  # another console has the robot, and this was published

    async def run(self) -> None:
        """Run until cancelled. The peers end before the links, so the last message to the robot is the rest."""
        self._events.publish(SessionBegan())
        async with asyncio.TaskGroup() as tasks:
            for name, run in (
                ("feedback", self._fanout.run),
                ("seat", self.seat.watch),
                ("stops", self.stops.run),
                ("disk of stops", self.stops.watch_disk),
                ("resets", self.resets.run),
                ("actions", self.actions.run),
                ("audit", self.audit.run),
                ("participants", self.people.share),
                ("traces", self.traces.run),
                ("robot", self.robot.run),
            ):
                tasks.create_task(keep_running(name, run, self._faults))
            async with self.peers.running():
                await asyncio.Event().wait()

    # PeerHost

    def peer_joined(self, peer: Peer) -> None:
        peer.silenced = self.silence.holds(peer.identity.token_id)
        with peer.contained("media"):
            peer.media.drives(False)
        self.people.joined(peer)

    def channel_opened(self, peer: Peer, channel: ChannelName) -> None:
        """Send a newcomer the whole state that this channel carries."""
        if channel == "control" and self.clock.feedback is not None:
            peer.send_feedback(encode_console_message(self.clock.feedback))
        elif channel == "stop":
            peer.send("stop", StopStateNotice(stop=self.clock.stop, event=self.clock.event))
        elif channel == "session":
            streams, voice = peer.media.streams, peer.media.voice
            peer.send("session", Welcome(peer=peer.id, role=peer.role, name=peer.name, streams=streams, voice=voice))
            if (state := self.robot.state()) is not None:
                peer.send("session", state)
            peer.send("session", self.seat.message())
            peer.send("session", self.speed_cap.state(time.monotonic()))
            self.people.welcome(peer)
            for update in self.actions.newest():
                peer.send("session", update)
            if (status := self.status.message(time.monotonic())) is not None:
                peer.send("session", status)
            if (navigation := self.navigation.message(time.monotonic())) is not None:
                peer.send("session", navigation)
            self._events.publish(NewcomerWelcomed(peer=peer.actor))

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
            case Shadow():
                self._shadow(peer, message, now)
            case Act():
                self.actions.act_by_peer(peer, message)
            case ActionCancel():
                self.actions.cancel_by_peer(peer, message)
            case EpisodeRequest():
                self._events.publish(EpisodeAsked(peer.actor, message))
            case SeatRelease():
                self.seat.handle(peer, message)
            case Note():
                if (reason := self.people.write(peer, message.text)) is not None:
                    self._refuse_request(peer, reason, "note")
            case Reset():
                self.resets.reset_by_peer(peer, message.number)
            case SeatRequest() | SeatTake() | SeatOffer() if self.seat.waits_for_nothing(peer, message):
                self.seat.handle(peer, message)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | SeatOffer() | SilenceStops() | Rename() if (
                not peer.asks.take(now)
            ):
                self._refuse_request(peer, "too_often")
            case SeatOffer(offered=True) if (reason := self.why_no_offer()) is not None:
                self._refuse_request(peer, reason, "no policy may drive now")
            case SilenceStops():
                self._silence(peer, message)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | SeatOffer():
                self.seat.handle(peer, message)
            case Rename():
                self.people.rename(peer, message.name)
            case Report():  # the peer keeps it
                if message.ping is not None:
                    peer.send("control", Pong(id=message.ping))
                self._report_speed(peer, message)
            case TraceRequest():
                self.traces.request(peer, message.wanted)
            case TraceReport() if self.seat.is_held_by(peer):
                shown = {each.stream for each in peer.media.streams}
                self._events.publish(EventsTraced(peer.actor, self.traces.reported(message, shown, now)))

    def input_refused(self, peer: Peer, channel: str, error: ChannelError) -> None:
        self._events.publish(InputRefused(channel, error.name))
        if channel in ("other", "transport") or isinstance(error, Flood):
            return  # no answer: there is no channel for it, or it would feed the flood
        answer = Refusal(
            event=0, reason="malformed", current=self.clock.event, detail=f"{error.name}: {error.detail}"[:500]
        )
        peer.send("control" if channel == "control" else "session", answer)

    def peer_ended(self, peer: Peer) -> None:
        self.traces.forget(peer)
        self.shadows.gone(peer)
        self.seat.gone(peer)
        self.people.left(peer)

    def peer_failed(self, peer: Peer, stage: str, error: Exception) -> None:
        self._faults.caught(f"peer {stage}", error, peer=peer.id)

    # SeatHost

    def rest_robot(self, why: str) -> None:
        """Rest the robot before anybody else drives: the last holder's command in flight is void too."""
        self.actions.cancel("", Actor())
        outcome = self._arbiter.abandon()
        if isinstance(outcome, ForwardRest) and self.robot.send(outcome.rest):
            self._events.publish(RestForwarded(Actor(), outcome.rest, why))

    def why_no_offer(self) -> RefusalReason | None:
        """Return why no policy may be let drive now: after a stop or an outage a person decides anew."""
        if not self.robot.up or self.clock.feedback is None:
            return "link_down"
        return "stopped" if self.clock.stop.stopped or self.stops.unconfirmed else None

    def refuse(self, peer: Peer, refusal: SeatRefusal) -> None:
        self._refuse_request(peer, refusal.reason, refusal.detail)

    # RobotHost

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        """Begin an epoch. References of different epochs are never compared, so every peer starts anew."""
        self.stops.epoch_ends(self.clock.stop)
        self.resets.link_down("the robot bridge has restarted")
        self._arbiter.epoch_ends()
        self.actions.epoch_ends()
        self.shadows.epoch_ends()
        self.status.forget()
        self.navigation.forget()
        self.traces.epoch_ends()
        self.clock.begin(epoch)
        self.speed_cap.forget()
        self._events.publish(EpochBegan(description))
        self._shown_stop = StopState()
        self.peers.end_all("new epoch")
        self._media.configure(description)

    def link_up(self) -> None:
        if self.robot.description is None:
            raise TypeError("a link is up only after its hello")
        self._link_was_up = True
        self.stops.link_up()
        self._arbiter.link_up(self.robot.description)
        self.shadows.link_up(self.robot.description)
        self._events.publish(LinkUp(self.robot.state()))

    def link_down(self, detail: str) -> None:
        was_up, self._link_was_up = self._link_was_up, False
        self.seat.link_lost()
        self._arbiter.link_down()
        self.stops.link_down()
        self.resets.link_down(detail)
        self.actions.link_down()
        self._events.publish(LinkDown(self.robot.state(), detail, was_up))
        is_taken = detail.startswith("taken")
        if is_taken and (was_up or not self._robot_is_taken):
            self._events.publish(RobotTaken(detail))
        self._robot_is_taken = is_taken

    def feedback_received(self, feedback: Feedback) -> None:
        now = time.monotonic()
        robot, feedback = spans_of(feedback), plain_feedback(feedback)
        if not self.clock.observe(feedback, now):
            return
        self._fanout.publish(encode_console_message(feedback))  # first: the operator's next command waits for it
        back = time.monotonic() - now
        command = self._arbiter.in_flight
        stopped = feedback.stop.stopped or feedback.stop.number > self._shown_stop.number
        self._arbiter.feedback(feedback)
        if stopped:
            self.seat.stopped()
        self.resets.feedback(feedback.stop)
        self.speed_cap.fed_back(feedback, now)
        executed = command if self._arbiter.in_flight is None else None
        if executed is not None:
            turnaround = now - self._forwarded_at
            spans = command_spans(robot, forward=self._forward_seconds, link=turnaround, back=back)
            self.traces.executed(feedback.event, spans)
            self._events.publish(FeedbackReceived(feedback, now, turnaround, spans))
        else:
            self._events.publish(FeedbackReceived(feedback, now, None))
        self.shadows.feedback(feedback, executed)
        if feedback.stop != self._shown_stop:
            self._shown_stop = feedback.stop
            self._events.publish(StopShown(feedback.stop, feedback.event))

    def refusal_received(self, refusal: Refusal) -> None:
        if self.resets.refused(refusal):
            return
        peer = self.peers.by_id(self._arbiter.refused(refusal))
        if peer is not None:
            peer.send("control", refusal)
        self._events.publish(Refused(Actor() if peer is None else peer.actor, "control", refusal, "robot"))

    def stop_taken(self, taken: StopTaken) -> None:
        self.seat.stopped()
        self._arbiter.stop_taken(taken)
        self.stops.taken(taken)

    def action_updated(self, update: ActionUpdate) -> None:
        self.actions.updated(update)

    def status_received(self, status: Status) -> None:
        if self.status.take(status, time.monotonic()):
            self._events.publish(StatusReceived(status))

    def navigation_received(self, navigation: Navigation) -> None:
        if self.navigation.take(navigation, time.monotonic()):
            self._events.publish(NavigationReceived(navigation))

    def map_received(self, map: OccupancyMap) -> None:
        self.navigation.take_map(map)
        self._events.publish(MapReceived(map))

    def link_failed(self, role: LinkRole, error: Exception) -> None:
        self._faults.caught(f"robot link {role}", error)

    # acting on outcomes

    def _command(self, peer: Peer, command: Command, now: float) -> None:
        outcome = self._arbiter.command(peer.id, command, now)
        if isinstance(outcome, Forward) and not self._forward(outcome, now):
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self.clock.event))
        if isinstance(outcome, Answer) and not peer.answers.allows(now, queues=peer.media.queues):
            outcome = Absorbed()
        match outcome:
            case Forward(forwarded):
                if self._arbiter.moves(forwarded) or self.actions.renews(forwarded.action):
                    self.seat.moved(peer)
                self._events.publish(CommandForwarded(peer.actor, forwarded))
            case Refuse(refusal):
                self._refuse(peer, "control", refusal)
                if refusal.reason in ("out_of_order", "unseen", "late") and self.clock.feedback is not None:
                    peer.send_feedback(encode_console_message(self.clock.feedback))
                self._events.publish(CommandRefused(peer.actor, command, refusal.reason))
            case Answer(feedback):
                peer.send_feedback(encode_console_message(feedback))
                self._events.publish(CommandRepeated(peer.actor, command, answered=True))
            case Absorbed():
                self._events.publish(CommandRepeated(peer.actor, command, answered=False))

    def _shadow(self, peer: Peer, shadow: Shadow, now: float) -> None:
        reason = self.shadows.shadow(peer, shadow, drives=self.seat.is_held_by(peer))
        if reason in ("not_allowed", "too_often") and peer.asks.take(now):
            self._refuse_request(peer, reason, "shadow")

    def _rest(self, peer: Peer, outcome: RestOutcome) -> None:
        if isinstance(outcome, ForwardRest):
            if self.robot.send(outcome.rest):
                self._events.publish(RestForwarded(peer.actor, outcome.rest, ""))
                return
            outcome = Refuse(Refusal(event=0, reason="link_down", current=self.clock.event))
        if isinstance(outcome, Refuse):
            self._refuse(peer, "control", outcome.refusal)

    def _stop(self, peer: Peer, channel: ChannelName, stop: Stop) -> None:
        try:
            self.stops.stop(new_press(peer.actor, channel, stop.reason, stop.press), stop.press)
        except Silenced as error:
            self._refuse(
                peer, "stop", Refusal(event=0, reason="silenced", current=self.clock.event, detail=error.detail)
            )

    def _silence(self, peer: Peer, message: SilenceStops) -> None:
        reason = self.silence.silence(peer, message.peer, silent=message.silent)
        if reason is not None:
            self._refuse_request(peer, reason, "a supervisor can silence only operators and observers")

    def _refuse_request(self, peer: Peer, reason: RefusalReason, detail: str = "") -> None:
        self._refuse(peer, "session", Refusal(event=0, reason=reason, current=self.clock.event, detail=detail))

    def _refuse(self, peer: Peer, channel: ChannelName, refusal: Refusal) -> None:
        peer.send(channel, refusal)
        self._events.publish(Refused(peer.actor, channel, refusal, "console"))

    def _forward(self, outcome: Forward, arrived: float) -> bool:
        self._forwarded_at = time.monotonic()
        is_sent = self.robot.send(outcome.command)
        self._forward_seconds = self._forwarded_at - arrived
        return is_sent

    def _report_speed(self, peer: Peer, report: Report) -> None:
        if not self.seat.is_held_by(peer):
            return
        self._events.publish(SpeedReported(peer.actor, report))
        now = time.monotonic()
        self.speed_cap.reported(peer.id, report, now)
        news = self.speed_cap.news(now)
        if news is not None:
            self._events.publish(SpeedCapChanged(news))

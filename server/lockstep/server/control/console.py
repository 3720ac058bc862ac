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
    LinkMessage,
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
from lockstep.server.control.command_arbiter import CommandArbiter
from lockstep.server.control.command_service import CommandService
from lockstep.server.control.participants import ParticipantList
from lockstep.server.control.policies.shadow_service import ShadowService
from lockstep.server.control.refusals import Refusals
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_by_link import SeatByLink
from lockstep.server.control.seat.seat_keeper import SeatKeeper
from lockstep.server.control.seat.seat_table import SeatInput
from lockstep.server.control.speed_cap import SpeedCap
from lockstep.server.control.stop.reset_service import ResetService
from lockstep.server.control.stop.stop_service import StopService
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.control.stop.stops_disk import StopsDisk
from lockstep.server.control.trace_service import TraceService
from lockstep.server.errors import ChannelError, Flood, Silenced
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.channels import ChannelName
from lockstep.server.peers.feedback_fanout import FeedbackFanout, FeedbackReceiver
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.robot.robot_connection import MediaSink, RobotConnection
from lockstep.server.session_events import (
    EpisodeAsked,
    EpochBegan,
    EventsTraced,
    FeedbackReceived,
    InputRefused,
    MapReceived,
    NavigationReceived,
    NewcomerWelcomed,
    Refused,
    RobotLinkDown,
    RobotLinkUp,
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
        self.robot = RobotConnection(settings, self, media, faults, dial_in)
        self._refusals = Refusals(clock, events)
        self.seat = SeatKeeper(seat, peers, self, self._refusals, events)
        self.seat_by_link = SeatByLink(self.seat, peers)
        self.people = ParticipantList(peers, clock, events, self.seat.renamed)
        self.speed_cap = SpeedCap(settings.speed_cap)
        arbiter = CommandArbiter(clock, seat, stops.presses, self.speed_cap)
        self.silence = silence
        self.stops = StopService(self.robot, stops, peers, clock, silence, events)
        self._stops_disk = StopsDisk(stops, events)
        self.resets = ResetService(self.robot, self.stops, peers, clock, seat, events)
        self.actions = ActionService(self.robot, clock, self.seat.is_held_by, self.seat.may_move, events)
        self._commands = CommandService(arbiter, self.robot, self.seat, self.actions, clock, self._refusals, events)
        self.status = StatusService()
        self.navigation = NavigationService()
        self.shadows = ShadowService(peers, events)
        self._fanout = FeedbackFanout(
            settings.observer_feedback_hz, self.seat.is_held_by, peers.drivers, peers.observers, relays
        )
        self.traces = TraceService()
        self._shown_stop = StopState()  # state that was published last
        self._robot_link_was_up = False
        self._robot_is_taken = False  # another console has the robot, and this was published

    async def run(self) -> None:
        """Run until cancelled. The peers end before the links, so the last message to the robot is the rest."""
        self._events.publish(SessionBegan())
        async with asyncio.TaskGroup() as tasks:
            for name, run in (
                ("feedback", self._fanout.run),
                ("seat", self.seat.watch),
                ("stops", self.stops.run),
                ("disk of stops", self._stops_disk.run),
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
        peer.drives(False)
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
                self._commands.command(peer, message, now)
            case Rest():
                self._commands.rest(peer, message)
            case Ping():
                peer.send("control", Pong(id=message.id))
            case Stop():
                try:
                    self.stops.stop(new_press(peer.actor, channel, message.reason, message.press), message.press)
                except Silenced as error:
                    self._refusals.refuse(peer, "stop", "silenced", error.detail)
            case Shadow():
                refused = self.shadows.shadow(peer, message, drives=self.seat.is_held_by(peer))
                if refused in ("not_allowed", "too_often") and peer.asks.take(now):
                    self._refusals.refuse(peer, "session", refused, "shadow")
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
                    self._refusals.refuse(peer, "session", reason, "note")
            case Reset():
                self.resets.reset_by_peer(peer, message.number)
            case SeatRequest() | SeatTake() | SeatOffer() if self.seat.waits_for_nothing(peer, message):
                self.seat.handle(peer, message)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | SeatOffer() | SilenceStops() | Rename() if (
                not peer.asks.take(now)
            ):
                self._refusals.refuse(peer, "session", "too_often")
            case SeatOffer(offered=True) if (reason := self.why_no_offer()) is not None:
                self._refusals.refuse(peer, "session", reason, "no policy may drive now")
            case SilenceStops():
                if (reason := self.silence.silence(peer, message.peer, silent=message.silent)) is not None:
                    detail = "a supervisor can silence only operators and observers"
                    self._refusals.refuse(peer, "session", reason, detail)
            case SeatRequest() | SeatGrant() | SeatDecline() | SeatTake() | SeatOffer():
                self.seat.handle(peer, message)
            case Rename():
                self.people.rename(peer, message.name)
            case Report():  # the peer keeps it
                if message.ping is not None:
                    peer.send("control", Pong(id=message.ping))
                if self.seat.is_held_by(peer):
                    self._events.publish(SpeedReported(peer.actor, message))
                    self.speed_cap.reported(peer.id, message, now)
                    if (news := self.speed_cap.news(now)) is not None:
                        self._events.publish(SpeedCapChanged(news))
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
        """Rest the robot before anybody else drives."""
        self.actions.cancel("", Actor())
        self._commands.abandon(why)

    def why_no_offer(self) -> RefusalReason | None:
        """Return why no policy may be let drive now: after a stop or an outage a person decides anew."""
        if not self.robot.up or self.clock.feedback is None:
            return "link_down"
        return "stopped" if self.clock.stop.stopped or self.stops.unconfirmed else None

    # RobotHost

    def epoch_began(self, epoch: str, description: RobotDescription) -> None:
        """Begin an epoch. References of different epochs are never compared, so every peer starts anew."""
        self.stops.epoch_ends(self.clock.stop)
        self.resets.robot_link_down("the robot bridge has restarted")
        self._commands.epoch_ends()
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

    def robot_link_up(self) -> None:
        if self.robot.description is None:
            raise TypeError("a link is up only after its hello")
        self._robot_link_was_up = True
        self.stops.robot_link_up()
        self._commands.robot_link_up(self.robot.description)
        self.shadows.robot_link_up(self.robot.description)
        self._events.publish(RobotLinkUp(self.robot.state()))

    def robot_link_down(self, detail: str) -> None:
        was_up, self._robot_link_was_up = self._robot_link_was_up, False
        self.seat.end_offer(SeatInput.LINK_LOST)
        self._commands.robot_link_down()
        self.stops.robot_link_down()
        self.resets.robot_link_down(detail)
        self.actions.robot_link_down()
        self._events.publish(RobotLinkDown(self.robot.state(), detail, was_up))
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
        stopped = feedback.stop.stopped or feedback.stop.number > self._shown_stop.number
        executed = self._commands.feedback(feedback)
        if stopped:
            self.seat.end_offer(SeatInput.STOPPED)
        self.resets.feedback(feedback.stop)
        self.speed_cap.fed_back(feedback, now)
        if executed is not None:
            turnaround, spans = self._commands.timing(robot, now, back)
            self.traces.executed(feedback.event, spans)
            self._events.publish(FeedbackReceived(feedback, now, turnaround, spans))
        else:
            self._events.publish(FeedbackReceived(feedback, now, None))
        self.shadows.feedback(feedback, executed)
        if feedback.stop != self._shown_stop:
            self._shown_stop = feedback.stop
            self._events.publish(StopShown(feedback.stop, feedback.event))

    def link_message_received(self, message: LinkMessage) -> None:
        now = time.monotonic()
        match message:
            case Refusal():
                if not self.resets.refused(message):
                    peer = self.peers.by_id(self._commands.refused(message))
                    if peer is not None:
                        peer.send("control", message)
                    self._events.publish(Refused(Actor() if peer is None else peer.actor, "control", message, "robot"))
            case StopTaken():
                self.seat.end_offer(SeatInput.STOPPED)
                self._commands.stop_taken(message)
                self.stops.taken(message)
            case ActionUpdate():
                self.actions.updated(message)
            case Status():
                if self.status.take(message, now):
                    self._events.publish(StatusReceived(message))
            case Navigation():
                if self.navigation.take(message, now):
                    self._events.publish(NavigationReceived(message))
            case OccupancyMap():
                self.navigation.take_map(message)
                self._events.publish(MapReceived(message))

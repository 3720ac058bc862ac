"""The session of one robot: console, media, seat, recorder, scene, audit, and all else that robots do not share."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from lockstep.protocol.console import ServerMessage
from lockstep.server.audit.audit_log import AuditLog, open_audit_log
from lockstep.server.audit.audit_trail import AuditTrail
from lockstep.server.audit.records import Actor
from lockstep.server.control.console import Console
from lockstep.server.control.notices import Notices
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.control.session_audit import SessionAudit
from lockstep.server.control.session_metrics import SessionMetrics
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.event_clock import EventClock
from lockstep.server.evidence.anchors import anchor_text
from lockstep.server.foxglove.service import FoxgloveService
from lockstep.server.http.transport.tls import own_pin
from lockstep.server.media.frame_takers import FrameTakers
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.sources.source_manager import SourceManager
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.peers.token_revocation import TokenRevocation
from lockstep.server.publishing.publishers import Publishers
from lockstep.server.recording.episodes.episode_service import EpisodeService
from lockstep.server.recording.episodes.metrics import count_episodes
from lockstep.server.recording.episodes.reset_action import ResetAction
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.library import ConsoleLibrary
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.service import RecordingService
from lockstep.server.recording.settings import recordings_directory
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.rerun.service import RerunService
from lockstep.server.robot.credentials import link_access
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.scene.view import SceneView
from lockstep.server.session_events import SessionEvents
from lockstep.server.settings import Settings
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.sfu.janus_engine import JanusEngine
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.talkback.talkback import Talkback
from lockstep.server.telemetry.background import keep_running
from lockstep.server.telemetry.log_context import follow_clock
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.state_dir import StateDir

__all__ = ["running_session"]


@asynccontextmanager
async def running_session(
    settings: Settings,
    context: ConsoleContext,
    metrics: Metrics,
    directory: StateDir,
    robot: str = "",
    stops: StopKeeper | None = None,
) -> AsyncIterator[Dependencies]:
    """Run the session while entered. A fault of the console ends it, and is raised as an ExceptionGroup.

    Args:
        directory: for the session's own files
        robot: its name in a fleet; "" is the only robot of a console
        stops: known stops that outlive the session, run by their owner; None: the session has its own
    """
    events = SessionEvents(metrics.faults)
    with open_audit_log(directory, settings, robot, context.state.signer, events.publish) as audit:
        async with (
            _running_stops(settings, context, directory, stops, metrics) as keeper,
            _session(settings, context, metrics, directory, robot, events, audit, keeper) as made,
        ):
            context.revocations.append(made.revocation)
            try:
                yield made
            finally:
                context.revocations.remove(made.revocation)


@asynccontextmanager
async def _running_stops(
    settings: Settings, context: ConsoleContext, directory: StateDir, stops: StopKeeper | None, metrics: Metrics
) -> AsyncIterator[StopKeeper]:
    if stops is not None:
        yield stops
        return
    keeper = StopKeeper(directory.path, settings.robot, lasts=context.state.lasts)
    await keeper.load()
    async with asyncio.TaskGroup() as tasks:
        running = tasks.create_task(keep_running("kept stops", keeper.run, metrics.faults), name="kept stops")
        yield keeper
        running.cancel()


@asynccontextmanager
async def _session(
    settings: Settings,
    context: ConsoleContext,
    metrics: Metrics,
    directory: StateDir,
    robot: str,
    events: SessionEvents,
    audit: AuditLog,
    stops: StopKeeper,
) -> AsyncIterator[Dependencies]:
    access = context.state.access.at(robot)
    clock = EventClock()
    trail = AuditTrail(clock, audit)
    seat = ControlSeat(SeatTimes(settings.seat_timeout, settings.seat_idle_seconds, settings.seat_claim_seconds))
    peers = PeerRegistry(settings, metrics, [context.check_room])
    silence = StopSilence(context.silenced, peers, events)
    media = MediaHub(settings.media, metrics.registry, settings.sources, on_fault=metrics.faults.caught)
    scene = SceneView(settings.scene_hz, settings.max_scene_viewers, metrics) if settings.scene else None
    shelf = RecordingStore(recordings_directory(settings.recording, directory.path), settings.recording)
    signing = RecordingSigning(context.state.signer, lambda: anchor_text(audit.newest_anchor()))
    takers = FrameTakers(media)
    recorder = Recorder(settings.recording, shelf, clock, takers.add(), peers.announce, trail, signing)
    foxglove = _foxglove(settings, clock, takers, metrics) if settings.foxglove.port is not None else None
    rerun = _rerun(settings, clock, takers, metrics) if settings.rerun.to is not None else None
    engine = JanusEngine(settings, context.endpoint, media, context.state.signing_key(settings) + robot)
    relays = SfuCoordinator(settings, engine, peers, context.state.invitations.has_ended)
    sources = SourceManager(settings.sources, clock, media, metrics.registry, peers.announce)
    voice = Talkback(settings.speaker_spec, seat.holds, metrics.registry, peers.announce)
    dial_in = _dial_in(settings, context, directory) if settings.dials_in else None
    console = Console(
        settings,
        events,
        metrics.faults,
        media,
        peers,
        seat,
        trail,
        clock,
        stops=stops,
        silence=silence,
        relays=[relays],
        dial_in=dial_in,
    )
    has_ended = context.state.invitations.has_ended
    episodes = _episodes(settings, clock, events, recorder, media, console, seat, has_ended, peers, trail)
    states: list[Callable[[], ServerMessage]] = [recorder.state]
    if sources.sources:
        states.append(sources.state)
    if voice.enabled:
        states.append(voice.state)
    states.append(episodes.state)
    notices = Notices(peers, states, stops.trouble)
    media.robot_encoding.ask_by(console.robot.ask_for_encoding)
    SessionMetrics(metrics).subscribe(events)
    count_episodes(events, metrics)
    SessionAudit(trail).subscribe(events)
    notices.subscribe(events)
    recorder.subscribe(events)
    if foxglove is not None:
        foxglove.subscribe(events)
    if rerun is not None:
        rerun.subscribe(events)
    episodes.subscribe(events)  # behind those who write: what an event does to an episode follows that event
    if scene is not None:
        scene.subscribe(events)
    revocation = TokenRevocation(context.state.invitations, peers, trail, silence, robot)
    publishers = Publishers(sources.published, revocation.ended, trail, metrics.faults, metrics.registry)
    follow_clock(clock, robot)
    made = Dependencies(
        robot=robot,
        settings=settings,
        metrics=metrics,
        events=events,
        console=console,
        media=media,
        context=context,
        access=access,
        audit=audit,
        revocation=revocation,
        scene=scene,
        recorder=recorder,
        foxglove=foxglove,
        rerun=rerun,
        relays=relays,
        voice=voice,
        publishers=publishers,
        dial_in=dial_in,
        recordings=RecordingService(
            ConsoleLibrary(recorder),
            access,
            trail,
            console.seat.is_held_with,
            lambda: console.clock.is_driven(time.monotonic()),
        ),
        episodes=episodes,
    )
    try:
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(console.run(), name="console"),
                *(
                    tasks.create_task(keep_running(name, run, metrics.faults), name=name)
                    for name, run in (
                        ("media", media.run),
                        ("sources", sources.run),
                        ("voice", voice.run),
                        ("publishers", publishers.run),
                        ("episodes", episodes.run),
                        ("recorder", recorder.run),
                        ("relays", relays.run),
                    )
                ),
            ]
            if scene is not None:
                running.append(tasks.create_task(keep_running("scene", scene.run, metrics.faults), name="scene"))
            if foxglove is not None:
                serving = keep_running("foxglove", foxglove.run, metrics.faults)
                running.append(tasks.create_task(serving, name="foxglove"))
            if rerun is not None:
                running.append(tasks.create_task(keep_running("rerun", rerun.run, metrics.faults), name="rerun"))
            yield made
            for task in running:
                task.cancel()
    finally:
        await made.recordings.close()
        if scene is not None:
            await scene.close()


def _foxglove(settings: Settings, clock: EventClock, takers: FrameTakers, metrics: Metrics) -> FoxgloveService:
    dropped = metrics.dropped.labels("foxglove")
    keyframe_seconds = settings.recording.keyframe_seconds
    return FoxgloveService(settings.foxglove, clock, takers.add(), keyframe_seconds, dropped.inc, metrics.faults.caught)


def _rerun(settings: Settings, clock: EventClock, takers: FrameTakers, metrics: Metrics) -> RerunService:
    dropped = metrics.dropped.labels("rerun")
    return RerunService(settings.rerun, clock, takers.add(), settings.recording.keyframe_seconds, dropped.inc)


def _dial_in(settings: Settings, context: ConsoleContext, directory: StateDir) -> DialIn:
    return DialIn(directory, link_access(settings).secret, lambda: own_pin(settings, context.state.directory.path))


def _episodes(
    settings: Settings,
    clock: EventClock,
    events: SessionEvents,
    recorder: Recorder,
    media: MediaHub,
    console: Console,
    seat: ControlSeat,
    has_ended: Callable[[str, float], bool],
    peers: PeerRegistry,
    trail: AuditTrail,
) -> EpisodeService:
    def may_ask(by: Actor) -> bool:
        """Return True for supervisors, the operator who holds the seat, and the one who lets a policy drive.

        Nobody else has a say, a policy neither.
        """
        if by.role == "supervisor":
            return True
        lets_drive = seat.offer is not None and bool(by.link) and seat.offer.link == by.link
        holds = seat.holds(by.peer) if by.peer else console.seat.is_held_with(by.link)
        return by.role == "operator" and (holds or lets_drive)

    reset = ResetAction(settings.episodes.reset_action, console.robot, clock, console.actions.act_by_console)
    return EpisodeService(
        settings.episodes,
        settings.recording,
        clock,
        events,
        recorder,
        media.recorded_codecs,
        console.robot,
        reset,
        may_ask,
        has_ended,
        peers,
        trail,
    )

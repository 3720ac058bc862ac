"""The session of one robot: console, media, seat, recorder, scene, audit, and all else that robots do not share."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from lockstep.server.audit.audit_log import AuditLog, open_audit_log
from lockstep.server.control.console import Console
from lockstep.server.event_clock import EventClock
from lockstep.server.evidence.anchors import anchor_text
from lockstep.server.media.hub import MediaHub
from lockstep.server.media.sources.source_manager import SourceManager
from lockstep.server.peers.token_revocation import TokenRevocation
from lockstep.server.publishing.publishers import Publishers
from lockstep.server.recording.format.signature import RecordingSigning
from lockstep.server.recording.library import ConsoleLibrary
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.service import RecordingService
from lockstep.server.recording.settings import recordings_directory
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.scene.view import SceneView
from lockstep.server.settings import Settings
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.sfu.janus_engine import JanusEngine
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.talkback.talkback import Talkback
from lockstep.server.telemetry.faults import Faults
from lockstep.server.telemetry.log_context import follow_clock
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.state_dir import StateDir
from lockstep.server.util.uncancelled import attempt

__all__ = ["run_on", "running_session"]

RESTART_AFTER = 1.0  # s until a background task that failed runs again


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
    with open_audit_log(directory, settings, robot, context.state.signer) as audit:
        async with (
            _running_stops(settings, context, directory, stops, metrics) as keeper,
            _session(settings, context, metrics, directory, robot, audit, keeper) as made,
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
        running = tasks.create_task(run_on("kept stops", keeper.run, metrics.faults), name="kept stops")
        yield keeper
        running.cancel()


async def run_on(name: str, run: Callable[[], Awaitable[None]], faults: Faults) -> None:
    """Run a side task until cancelled or done, and again after a fault, which must not affect control or STOP."""
    while True:
        try:
            await attempt(run())
        except Exception as error:
            faults.caught(name, error, what="a background task, which runs again")
            await asyncio.sleep(RESTART_AFTER)
        else:
            return


@asynccontextmanager
async def _session(
    settings: Settings,
    context: ConsoleContext,
    metrics: Metrics,
    directory: StateDir,
    robot: str,
    audit: AuditLog,
    stops: StopKeeper,
) -> AsyncIterator[Dependencies]:
    access = context.state.access.at(robot)
    media = MediaHub(settings.media, metrics.registry, settings.sources, on_fault=metrics.faults.caught)
    scene = SceneView(settings.scene_hz, settings.max_scene_viewers, metrics) if settings.scene else None
    clock = EventClock()
    shelf = RecordingStore(recordings_directory(settings.recording, directory.path), settings.recording)
    signing = RecordingSigning(context.state.signer, lambda: anchor_text(audit.newest_anchor()))
    recorder = Recorder(
        settings.recording,
        shelf,
        clock,
        media,
        lambda news: console.peers.tell("session", news),
        signing,
        lambda what, detail: console.audit.record("recording", what=what, detail=detail),
    )
    engine = JanusEngine(settings, context.endpoint, media, context.state.signing_key(settings) + robot)
    relays = SfuCoordinator(settings, engine, lambda: console.peers, context.state.invitations.has_ended)
    console = Console(
        settings,
        metrics,
        media,
        scene,
        audit,
        clock,
        recorder,
        stops=stops,
        silenced=context.silenced,
    )
    console.peers.relays.append(relays)
    console.peers.further_bounds.append(context.check_room)
    console.further_news.append(recorder.state)
    sources = SourceManager(
        settings.sources, console.clock, media, metrics.registry, lambda news: console.peers.tell("session", news)
    )
    if sources.sources:
        console.further_news.append(sources.state)
    voice = Talkback(
        settings.speaker_spec,
        console.seat.rules.holds,
        metrics.registry,
        lambda news: console.peers.tell("session", news),
    )
    if voice.enabled:
        console.further_news.append(voice.state)
    revocation = TokenRevocation(
        context.state.invitations, console.peers, console.audit, robot, console.stops.show_silence
    )
    publishers = Publishers(sources.published, revocation.ended, console.audit, metrics.faults, metrics.registry)
    follow_clock(console.clock, robot)
    audit.on_trouble = lambda trouble: console.audit_trouble(trouble, audit.lost)
    made = Dependencies(
        robot=robot,
        settings=settings,
        metrics=metrics,
        console=console,
        media=media,
        context=context,
        access=access,
        audit=audit,
        revocation=revocation,
        scene=scene,
        recorder=recorder,
        relays=relays,
        voice=voice,
        publishers=publishers,
        recordings=RecordingService(ConsoleLibrary(recorder), access, console.audit, console.link_holds_seat),
    )
    try:
        async with asyncio.TaskGroup() as tasks:
            running = [
                tasks.create_task(console.run(), name="console"),
                *(
                    tasks.create_task(run_on(name, run, metrics.faults), name=name)
                    for name, run in (
                        ("media", media.run),
                        ("sources", sources.run),
                        ("voice", voice.run),
                        ("publishers", publishers.run),
                        ("recorder", recorder.run),
                        ("relays", relays.run),
                    )
                ),
            ]
            if scene is not None:
                running.append(tasks.create_task(run_on("scene", scene.run, metrics.faults), name="scene"))
            yield made
            for task in running:
                task.cancel()
    finally:
        made.recordings.close()
        if scene is not None:
            await scene.close()

"""The 3D scene: viser on a loopback port, started for the first viewer, posed while somebody watches."""

import asyncio
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import structlog

from lockstep.protocol.console import ShadowVerdict
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.auth.tokens import SceneTicket
from lockstep.server.errors import SceneUnavailable
from lockstep.server.scene.commanded_path import CommandedPath
from lockstep.server.scene.page import ScenePage
from lockstep.server.scene.scale import SceneScale
from lockstep.server.scene.shadows.wishes import ShadowWishes
from lockstep.server.session_events import CommandForwarded, EpochBegan, FeedbackReceived, SessionEvents, ShadowJudged
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.rate_limits import RateLimits
from lockstep.server.util.uncancelled import to_the_end

if TYPE_CHECKING:
    import viser

    from lockstep.server.scene.model import SceneModel

__all__ = ["SceneView", "pause"]

Result = TypeVar("Result")

log = structlog.get_logger(__name__)

START_TIMEOUT = 20.0  # s, on a busy machine
STOP_TIMEOUT = 5.0  # s
SHARE = 0.25  # share of the time for building and posing: whatever the robot, their thread holds up all others
LINK_PART = 4  # one link gets 1 / LINK_PART of the places
RESERVED_PART = 5  # 1 / RESERVED_PART of the places is not for observers
OPENS, OPEN_RATE = 10, 0.5  # Hz, scenes that one link opens: viser tells each the whole scene


class SceneView:
    """Run `run` as a task. Starting, building and posing happen in threads; the newest feedback wins.

    Attributes:
        port: port of viser on loopback; 0 before somebody opens the scene
    """

    def __init__(self, rate: float, max_viewers: int, metrics: Metrics) -> None:
        self.port = 0
        self._interval = 1 / rate
        self._max_viewers = max_viewers
        self._metrics = metrics
        self._wanted = False  # True if somebody opens the scene and viser must start
        self._started = asyncio.Event()
        self._server: viser.ViserServer | None = None
        self._model: SceneModel | None = None
        self._scale: SceneScale | None = None
        self._description: RobotDescription | None = None  # not built yet
        self._feedback: Feedback | None = None  # not shown yet
        self._path: CommandedPath | None = None
        self._shadows = ShadowWishes()
        self._viewers = 0
        self._worked = 0.0  # s of thread time for the picture that is being made
        self._of_link: Counter[str] = Counter()
        self._opens = RateLimits(OPEN_RATE, OPENS)
        self._page: ScenePage | None = None
        self._news = asyncio.Event()

    def subscribe(self, events: SessionEvents) -> None:
        events.subscribe(EpochBegan, self._epoch_began)
        events.subscribe(CommandForwarded, self._command_forwarded)
        events.subscribe(FeedbackReceived, self._feedback_received)
        events.subscribe(ShadowJudged, self._shadow_judged)

    def _epoch_began(self, event: EpochBegan) -> None:
        self._description = event.description
        self._path = CommandedPath(event.description)
        self._shadows = ShadowWishes()
        self._news.set()

    def _command_forwarded(self, event: CommandForwarded) -> None:
        if self._path is not None:
            self._path.command(event.command.event, event.command.values)

    def _shadow_judged(self, event: ShadowJudged) -> None:
        self._shadows.take(event.verdict, time.monotonic())

    def _feedback_received(self, event: FeedbackReceived) -> None:
        self._feedback = event.feedback
        if self._path is not None:
            self._path.feedback(event.feedback)
        if self._viewers:
            self._news.set()

    @property
    def page(self) -> ScenePage:
        """viser's client. Raises SceneUnavailable before `open`."""
        if self._page is None:
            raise SceneUnavailable("the 3D scene has not started")
        return self._page

    @contextmanager
    def viewer(self, ticket: SceneTicket) -> Iterator[None]:
        """Count a viewer while entered. One link gets a quarter of the places; observers do not get the last ones.

        Raises:
            SceneUnavailable: there are too many viewers, or this link opens 3D scenes too often.
        """
        if not self._opens.spend(ticket.link, time.monotonic()):
            raise SceneUnavailable("this link opens 3D scenes too often; wait a moment")
        bound = self._max_viewers
        if ticket.role in ("observer", "policy"):
            bound = max(1, bound - max(1, bound // RESERVED_PART))
        if self._viewers >= bound:
            raise SceneUnavailable(f"all {bound} places of the 3D scene are taken")
        own = max(1, self._max_viewers // LINK_PART)
        if self._of_link[ticket.link] >= own:
            raise SceneUnavailable(f"one link may open at most {own} 3D scenes")
        self._of_link[ticket.link] += 1
        self._viewers += 1
        self._metrics.scene_viewers.set(self._viewers)
        self._news.set()
        try:
            yield
        finally:
            self._of_link[ticket.link] -= 1
            self._of_link += Counter()  # forgets links without a scene
            self._viewers -= 1
            self._metrics.scene_viewers.set(self._viewers)

    async def open(self) -> None:
        """Wait until viser listens; `run` starts it for the first viewer.

        Raises:
            SceneUnavailable: it does not start.
        """
        if self._started.is_set():
            return
        self._wanted = True
        self._news.set()
        try:
            async with asyncio.timeout(START_TIMEOUT):
                await self._started.wait()
        except TimeoutError as error:
            raise SceneUnavailable("the 3D scene does not start") from error

    async def run(self) -> None:
        """Run until cancelled."""
        while True:
            await self._news.wait()
            self._news.clear()
            if self._wanted and self._server is None:
                self._wanted = False
                await to_the_end(self._start())
            self._worked = 0.0
            if self._description is not None and self._server is not None:
                description, self._description = self._description, None
                self._scale = SceneScale(description)
                magnified = self._scale.description(description)
                self._model = await self._built(self._server, magnified, self._scale.factor)
            if self._viewers and self._feedback is not None and self._model is not None and self._scale is not None:
                feedback, self._feedback = self._feedback, None
                path = None if self._path is None else self._path.as_of_now()
                wishes = self._shadows.of_now(feedback.event, time.monotonic())
                await self._pose(partial(_pose, self._model, self._scale, feedback, path, wishes))
            await asyncio.sleep(pause(self._worked, self._interval))

    async def _start(self) -> None:
        server, self._page = await asyncio.to_thread(_start_viser)
        self._server, self.port = server, server.get_port()
        self._started.set()

    async def _built(
        self, server: "viser.ViserServer", description: RobotDescription, factor: float
    ) -> "SceneModel | None":
        """Build the model; None if it fails: a shape that viser does not take must not end the console."""
        try:
            return await asyncio.to_thread(self._timed, partial(_build, server, description, factor))
        except Exception as error:
            self._failed("built", error)
            return None

    async def _pose(self, pose: Callable[[], None]) -> None:
        try:
            await asyncio.to_thread(self._timed, pose)
        except Exception as error:
            self._failed("posed", error)
            self._model = None  # rather no picture than one that stands still

    def _timed(self, work: Callable[[], Result]) -> Result:
        """Run `work` in a thread and add its CPU time, which delays others; waiting on a busy machine does not."""
        began = time.thread_time()
        try:
            return work()
        finally:
            self._worked += time.thread_time() - began

    def _failed(self, what: str, error: Exception) -> None:
        self._metrics.bad_input.labels(where="scene", reason=type(error).__name__).inc()
        log.warning("the 3D scene cannot be " + what, error=f"{type(error).__name__}: {error}")

    async def close(self) -> None:
        """Stop viser. Idempotent."""
        server, self._server = self._server, None
        if server is not None:
            async with asyncio.timeout(STOP_TIMEOUT):
                await asyncio.to_thread(server.stop)


def pause(worked: float, interval: float) -> float:
    """Return the seconds to the next picture of the scene, after a thread has worked `worked` s for the last one."""
    return max(interval, worked * (1 / SHARE - 1))


def _pose(
    model: "SceneModel",
    scale: SceneScale,
    feedback: Feedback,
    path: CommandedPath | None,
    wishes: Sequence[ShadowVerdict],
) -> None:
    if path is None:
        model.pose(scale.feedback(feedback))
        return
    shadows = []
    for wish in wishes:
        # What one policy wants cannot end the picture for all: a turn may be too large for a sine, say.
        with suppress(ArithmeticError, ValueError):
            if (poses := scale.poses(path.wanted(wish.values))) is not None:
                shadows.append((wish.name, poses))
    model.pose(scale.feedback(feedback), scale.poses(path.poses()), shadows)


def _start_viser() -> "tuple[viser.ViserServer, ScenePage]":
    from lockstep.server.scene.server import start_viser

    return start_viser()


def _build(server: "viser.ViserServer", description: RobotDescription, factor: float) -> "SceneModel":
    from lockstep.server.scene.server import build_model

    return build_model(server, description, factor)

"""The 3D scene: viser on a loopback port, started for the first viewer, posed while somebody watches."""

import asyncio
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.auth.tokens import SceneTicket
from lockstep.server.errors import SceneUnavailable
from lockstep.server.scene.commanded_path import CommandedPath
from lockstep.server.scene.page import ScenePage
from lockstep.server.scene.renderer import SceneRenderer
from lockstep.server.scene.shadows.wishes import ShadowWishes
from lockstep.server.session_events import CommandForwarded, EpochBegan, FeedbackReceived, SessionEvents, ShadowJudged
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.rate_limits import RateLimits
from lockstep.server.util.uncancelled import to_the_end

__all__ = ["SceneView", "pause"]

START_TIMEOUT = 20.0  # s, on a busy machine
SHARE = 0.25  # share of the time for building and posing: whatever the robot, their thread holds up all others
LINK_PART = 4  # one link gets 1 / LINK_PART of the places
RESERVED_PART = 5  # 1 / RESERVED_PART of the places is not for observers
OPENS, OPEN_RATE = 10, 0.5  # Hz, scenes that one link opens: viser tells each the whole scene


class SceneView:
    """Shows the newest feedback. Run `run` as a task.

    Attributes:
        renderer: viser, not started before somebody opens the scene
    """

    def __init__(self, rate: float, max_viewers: int, metrics: Metrics) -> None:
        self.renderer = SceneRenderer(metrics)
        self._interval = 1 / rate
        self._max_viewers = max_viewers
        self._metrics = metrics
        self._wanted = False  # True if somebody opens the scene and viser must start
        self._description: RobotDescription | None = None  # not built yet
        self._feedback: Feedback | None = None  # not shown yet
        self._path: CommandedPath | None = None
        self._shadows = ShadowWishes()
        self._viewers = 0
        self._of_link: Counter[str] = Counter()
        self._opens = RateLimits(OPEN_RATE, OPENS)
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
        if self.renderer.page is None:
            raise SceneUnavailable("the 3D scene has not started")
        return self.renderer.page

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
        if self.renderer.started.is_set():
            return
        self._wanted = True
        self._news.set()
        try:
            async with asyncio.timeout(START_TIMEOUT):
                await self.renderer.started.wait()
        except TimeoutError as error:
            raise SceneUnavailable("the 3D scene does not start") from error

    async def run(self) -> None:
        """Run until cancelled."""
        renderer = self.renderer
        while True:
            await self._news.wait()
            self._news.clear()
            if self._wanted and not renderer.started.is_set():
                self._wanted = False
                await to_the_end(renderer.start())
            worked_before = renderer.worked
            if self._description is not None and renderer.started.is_set():
                description, self._description = self._description, None
                await renderer.build(description)
            if self._viewers and self._feedback is not None and renderer.model is not None:
                feedback, self._feedback = self._feedback, None
                path = None if self._path is None else self._path.as_of_now()
                await renderer.pose(feedback, path, self._shadows.of_now(feedback.event, time.monotonic()))
            await asyncio.sleep(pause(renderer.worked - worked_before, self._interval))

    async def close(self) -> None:
        """Stop viser. Idempotent."""
        await self.renderer.close()


def pause(worked: float, interval: float) -> float:
    """Return the seconds to the next picture of the scene, after a thread has worked `worked` s for the last one."""
    return max(interval, worked * (1 / SHARE - 1))

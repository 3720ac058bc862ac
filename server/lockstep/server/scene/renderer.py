"""viser with one robot in it, on a loopback port."""

import asyncio
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import structlog

from lockstep.protocol.console import ShadowVerdict
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.scene.commanded_path import CommandedPath
from lockstep.server.scene.page import ScenePage
from lockstep.server.scene.scale import SceneScale
from lockstep.server.telemetry.metrics import Metrics

if TYPE_CHECKING:
    import viser

    from lockstep.server.scene.model import SceneModel

__all__ = ["SceneRenderer"]

Result = TypeVar("Result")

log = structlog.get_logger(__name__)

STOP_TIMEOUT = 5.0  # s


class SceneRenderer:
    """Starts viser, builds a robot and poses it, in threads. What fails is counted, and shows no robot.

    Attributes:
        started: set once viser listens
        port: port of viser on loopback; 0 before
        page: viser's client; None before
        model: the robot; None before `build`, and after a failure
        worked: s of thread time for building and posing, since the beginning
    """

    def __init__(self, metrics: Metrics) -> None:
        self.started = asyncio.Event()
        self.port = 0
        self.page: ScenePage | None = None
        self.model: SceneModel | None = None
        self.worked = 0.0
        self._metrics = metrics
        self._server: viser.ViserServer | None = None
        self._scale: SceneScale | None = None  # of the robot

    async def start(self) -> None:
        server, self.page = await asyncio.to_thread(_start_viser)
        self._server, self.port = server, server.get_port()
        self.started.set()

    async def build(self, description: RobotDescription) -> None:
        """Replace the robot; by none if it fails: a shape that viser does not take must not end the console."""
        if self._server is None:
            return
        self._scale = SceneScale(description)
        magnified = self._scale.description(description)
        try:
            self.model = await asyncio.to_thread(
                self._timed, partial(_build, self._server, magnified, self._scale.factor)
            )
        except Exception as error:
            self.model = None
            self._failed("built", error)

    async def pose(self, feedback: Feedback, path: CommandedPath | None, wishes: Sequence[ShadowVerdict]) -> None:
        if self.model is None or self._scale is None:
            return
        try:
            await asyncio.to_thread(self._timed, partial(_pose, self.model, self._scale, feedback, path, wishes))
        except Exception as error:
            self._failed("posed", error)
            self.model = None  # rather no picture than one that stands still

    def _timed(self, work: Callable[[], Result]) -> Result:
        """Run `work` in a thread and add its CPU time, which delays others; waiting on a busy machine does not."""
        began = time.thread_time()
        try:
            return work()
        finally:
            self.worked += time.thread_time() - began

    def _failed(self, what: str, error: Exception) -> None:
        self._metrics.bad_input.labels(where="scene", reason=type(error).__name__).inc()
        log.warning("the 3D scene cannot be " + what, error=f"{type(error).__name__}: {error}")

    async def close(self) -> None:
        """Stop viser. Idempotent."""
        server, self._server = self._server, None
        if server is not None:
            async with asyncio.timeout(STOP_TIMEOUT):
                await asyncio.to_thread(server.stop)


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

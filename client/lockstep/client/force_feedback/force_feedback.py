"""The contact force on the operator's hand, from each feedback, within the robot's hold."""

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from lockstep.client.force_feedback.effect_core import EffectCore, EffectKind, ForceSettings, Order
from lockstep.client.force_feedback.errors import ForceFeedbackError
from lockstep.client.force_feedback.stick_force import StickForce, stick_force
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback

__all__ = ["ForceFeedback", "PushingDevice"]

RENEW_SECONDS = 0.05


class PushingDevice(Protocol):
    """A stick whose effects can be uploaded, played and stopped; `EvdevStick` is one."""

    kinds: frozenset[EffectKind]

    def carry_out(self, order: Order) -> None: ...


class _Measured(NamedTuple):
    force: StickForce
    at: float  # s, the clock's


class ForceFeedback:
    """Lets one stick push with what the robot measures. A context manager; leaving frees the stick.

    A thread of its own tells the device, with the newest feedback alone. The force ends when `felt` is called with
    `driving` False, when the robot is stopped, and when the newest feedback is older than the robot's `hold`. No effect
    lasts longer than `hold`, so a program that hangs frees the stick.
    """

    def __init__(
        self,
        device: PushingDevice,
        description: RobotDescription,
        settings: ForceSettings | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._device = device
        self._description = description
        self._core = EffectCore(ForceSettings() if settings is None else settings, device.kinds)
        self._clock = clock
        self._changed = threading.Condition()
        self._measured: _Measured | None = None
        self._ends = False
        self._failure: ForceFeedbackError | None = None
        self._thread = threading.Thread(target=self._run, name="force-feedback", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._changed:
            self._measured = None
            self._ends = True
            self._changed.notify()
        self._thread.join()

    @property
    def failure(self) -> ForceFeedbackError | None:
        """Why the stick pushes no more; None while it can."""
        return self._failure

    def felt(self, feedback: Feedback, *, driving: bool) -> None:
        """Take a new feedback. It never waits for the device.

        Args:
            feedback: what `Console.drive` or `Console.feedbacks` gave
            driving: the operator holds this stick and its button for hold to move. A stick that nobody holds would be
                moved by its own force, and the robot with it.
        """
        stopped = feedback.stop.stopped or feedback.stop.locked_out != ""
        force = stick_force(feedback.wrench, self._description) if driving and not stopped else None
        with self._changed:
            self._measured = None if force is None else _Measured(force, self._clock())
            self._changed.notify()

    def stop(self) -> None:
        """End the force at once: the operator let go, or the seat or the connection is lost."""
        with self._changed:
            self._measured = None
            self._changed.notify()

    def step(self) -> None:
        """Tell the device what holds now. The thread calls it after each change, and again every 0.05 s."""
        measured, now = self._measured, self._clock()
        hold = self._description.hold
        if measured is None or now - measured.at > hold:
            orders = self._core.stop()
        else:
            orders = self._core.step(measured.force, hold, now)
        for order in orders:
            self._device.carry_out(order)

    def _run(self) -> None:
        try:
            while not self._ends:
                seen = self._measured
                self.step()
                with self._changed:
                    if not self._ends:
                        self._changed.wait_for(
                            lambda seen=seen: self._ends or self._measured is not seen,  # type: ignore[misc]
                            RENEW_SECONDS if self._core.plays else None,
                        )
            self._measured = None
            self.step()
        except ForceFeedbackError as error:
            self._failure = error

"""The thread that talks to the robot: LeRobot's calls block, and the bridge's tick must not.

It sends the newest goals and reads the state, `rate` times a second. Everything that crosses between the threads is one
reference to something that does not change, so no lock is held while a motor bus answers.
"""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from lockstep.robot_bridge.robots.lerobot.device import Device
from lockstep.robot_bridge.thread_name import name_thread

__all__ = ["BusLoop", "State"]

JOIN_SECONDS = 2.0  # for the call under way when the bridge ends
STILL_SECONDS = 0.2  # over which an axis has to stay where it is to count as at rest
BAD_SHOWN = 3.0  # s for which a fault is shown after the last failed reading

_logger = logging.getLogger(__name__)


class State(NamedTuple):
    """One reading of the robot."""

    time: float  # s, monotonic, when the reading began: the state is no older
    values: tuple[float, ...]  # in the order of the axes; NaN if the robot did not say it
    at_rest: bool
    pictures: dict[str, Any]  # of the cameras that are read with the state


class BusLoop:
    """Owns the device from `start` to `close`.

    Attributes:
        newest: the last reading; None before the first
        failure: the exception that ended the thread; None while it runs
    """

    def __init__(
        self,
        device: Device,
        names: Sequence[str],
        *,
        rate: float,
        still: float,
        torque_off_at_end: bool,
        pictures: Sequence[str] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`names`: the entries of the action, in the axes' order. `rate`: Hz."""
        self.newest: State | None = None
        self.failure: Exception | None = None
        self.on_state: Callable[[], None] = _nothing  # called in the thread after each reading
        self._device = device
        self._names = tuple(names)
        self._pictures = tuple(pictures)
        self._period = 1 / rate
        self._still = still
        self._torque_off_at_end = torque_off_at_end
        self._clock = clock
        self._wanted: tuple[float, ...] | None = None  # None: nothing to send
        self._torque_wanted: bool | None = None  # a switch that is not made yet
        self._is_limp = False  # the motors are switched off
        self._is_gone = False
        self._began: float | None = None  # when the call under way began; None between calls
        self._misread: tuple[str, float] | None = None  # the last failed reading and its time
        self._misreadings = 0
        self._trail: deque[tuple[float, tuple[float, ...]]] = deque()
        self._leave = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lerobot", daemon=True)

    # From the bridge's loop

    def start(self) -> None:
        """Read the state once, here, so that the bridge begins with a measured robot; then run.

        Raises:
            Exception: the robot could not be read.
        """
        self._read()
        self._thread.start()

    def want(self, values: Sequence[float]) -> None:
        """Send these from now on; the newest values win."""
        self._wanted = tuple(values)

    def switch_torque(self, on: bool) -> None:
        """Switch the motors. Switched on, they are told to be where they are; the goals from before count no more."""
        self._wanted = None
        self._torque_wanted = on

    def held_up(self, now: float) -> float:
        """Return for how long the call under way has not returned, in s; 0 between calls."""
        began = self._began
        return 0.0 if began is None else now - began

    def faults(self, now: float) -> list[str]:
        """Return what is wrong with the readings, in words for a person."""
        misread = self._misread
        if misread is None or now - misread[1] > BAD_SHOWN:
            return []
        return [f"state: {self._misreadings} × {misread[0]}"]

    def close(self) -> None:
        """End the thread and let the robot go; blocks shortly. May be called again."""
        self._leave.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_SECONDS)
        if self._thread.is_alive():
            _logger.error("the robot does not answer: it keeps its last goals, and its motors stay as they are")
            return
        if not self._is_gone:
            self._is_gone = True
            self._device.disconnect(torque_off=self._torque_off_at_end)

    # In the thread

    def _run(self) -> None:
        name_thread("lerobot")
        due = self._clock()
        try:
            while not self._leave.wait(max(0.0, due - self._clock())):
                due = max(due + self._period, self._clock())
                self._step()
            self._send()  # once more: the axes came to rest with these values
        except Exception as error:
            _logger.error("the robot failed: %s", error, exc_info=error)
            self.failure = error

    def _step(self) -> None:
        if (torque := self._torque_wanted) is not None:
            self._torque_wanted = None
            self._timed(self._switch, torque)
        self._send()
        try:
            self._timed(self._read)
        except Exception as error:  # a motor bus loses an answer now and then; the state grows old meanwhile
            self._misreadings += 1
            self._misread = (f"{type(error).__name__}: {error}"[:200], self._clock())

    def _send(self) -> None:
        if (wanted := self._wanted) is not None and not self._is_limp:
            self._timed(self._device.act, dict(zip(self._names, wanted, strict=True)))

    def _timed(self, call: Callable[..., None], *arguments: Any) -> None:
        self._began = self._clock()
        try:
            call(*arguments)
        finally:
            self._began = None

    def _switch(self, on: bool) -> None:
        """A motor that is switched on goes to its goal: it has to be where the motor is."""
        if on:
            self._read()
            state = self.newest
            assert state is not None  # it was read just now
            if not all(math.isfinite(value) for value in state.values):
                raise ValueError("the motors cannot be switched on while their positions are unknown")
            self._device.act(dict(zip(self._names, state.values, strict=True)))
        self._device.torque(on)
        self._is_limp = not on

    def _read(self) -> None:
        began = self._clock()
        observed = self._device.observe()
        values = tuple(_number(observed.get(name)) for name in self._names)
        self._trail.append((began, values))
        while self._trail[0][0] < began - STILL_SECONDS:
            self._trail.popleft()
        pictures = {name: observed[name] for name in self._pictures if observed.get(name) is not None}
        self.newest = State(began, values, self._is_still(), pictures)
        self.on_state()

    def _is_still(self) -> bool:
        """An axis whose position is unknown is not still."""
        columns = zip(*(values for _, values in self._trail), strict=True)
        return all(all(map(math.isfinite, column)) and max(column) - min(column) <= self._still for column in columns)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _nothing() -> None:
    pass

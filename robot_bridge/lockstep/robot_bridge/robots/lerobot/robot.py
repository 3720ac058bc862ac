"""A robot of LeRobot, as the bridge sees it."""

import logging
import math
import time
from collections.abc import Sequence

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.lerobot.bus_loop import BusLoop, State
from lockstep.robot_bridge.robots.lerobot.camera import ApartCamera, LeRobotCamera, TogetherCamera
from lockstep.robot_bridge.robots.lerobot.description import DEGREES, camera_latency
from lockstep.robot_bridge.robots.lerobot.device import Device
from lockstep.robot_bridge.robots.lerobot.settings import CameraSettings, LeRobotSettings

__all__ = ["LeRobotRobot"]

HUNG_SECONDS = 2.0  # that one call of the robot may take before the bridge gives the robot up

_logger = logging.getLogger(__name__)


class LeRobotRobot(Robot):
    """Hands the goals to the bus' thread, and reports what that thread has read.

    At rest the applied goals go on being sent: a position servo holds the arm there. `stop` does no more than that,
    unless the settings say `torque_off`: an arm without torque falls.
    """

    tick_seconds = 0.01
    rests_from_thread = True

    def __init__(self, device: Device, settings: LeRobotSettings, description: RobotDescription) -> None:
        """Begin to read the connected robot.

        Raises:
            Exception: the robot could not be read.
        """
        facts = device.facts
        self._settings = settings
        self._description = description
        self._rest = [None if axis.kind == "goal" else axis.rest for axis in description.axes]
        self._in_degrees = [
            number for number, axis in enumerate(description.axes) if axis.kind == "goal" and axis.unit == DEGREES
        ]
        self._wanted: tuple[float, ...] | None = None
        self._held: tuple[float, ...] | None = None  # goals that the motors have; None: none since they had no torque
        self._is_stopped = False
        together = [camera.name for camera in facts.cameras if not camera.apart]
        self._bus = BusLoop(
            device,
            [axis.name for axis in description.axes],
            rate=settings.rate,
            still=settings.still,
            torque_off_at_end=settings.stop == "torque_off",
            pictures=together,
        )
        self._cameras: list[LeRobotCamera] = []
        beside: list[TogetherCamera] = []
        try:
            self._bus.start()
            self._stay()
            for known, camera in zip(facts.cameras, description.cameras, strict=True):
                given = settings.cameras.get(known.name, CameraSettings())
                latency = camera_latency(known, given)
                if known.apart:
                    self._cameras.append(ApartCamera(camera, latency, given.timeout, device.camera(known.name)))
                else:
                    beside.append(TogetherCamera(camera, latency, given.timeout))
                    self._cameras.append(beside[-1])
        except BaseException:
            self.close()
            raise

        def take() -> None:
            for each in beside:
                each.take(self._bus)

        self._bus.on_state = take

    def describe(self) -> RobotDescription:
        return self._description

    def apply(self, values: Sequence[float]) -> None:
        if not self._is_stopped:
            self._wanted = self._held = tuple(values)
            self._bus.want(self._wanted)

    def tick(self) -> None:
        if self._bus.failure is not None:
            raise self._bus.failure
        if (seconds := self._bus.held_up(time.monotonic())) > HUNG_SECONDS:
            raise TimeoutError(f"the robot has not answered for {seconds:.1f} s")

    def measure(self) -> Measurement:
        now = time.monotonic()
        state = self._fresh(now)
        faults = self._bus.faults(now)
        if state is None:
            faults.append(f"state: no reading for {self._age(now):.1f} s")
        for camera in self._cameras:
            faults += camera.faults(now)
        values = self._values(state)
        return Measurement(
            axes=values,
            joints=self._joints(values),
            wrench=[],
            ranges=[],
            at_rest=state is not None and state.at_rest,
            faults=faults,
        )

    def measured_axes(self) -> Sequence[float]:
        return self._values(self._fresh(time.monotonic()))

    def goals(self) -> Sequence[float]:
        """Return the goals that the motors were told last: they hold the arm and squeeze there, also while stopped."""
        return self.measured_axes() if self._held is None else self._held

    def positions(self) -> Sequence[float]:
        return self._joints(self.measured_axes())

    def rest_from_thread(self) -> None:
        """The bus' thread goes on by itself: it has to send rest values for rates, and the same goals."""
        wanted = self._wanted
        if wanted is not None:
            self._bus.want(self._at_rest(wanted))

    def stop(self) -> None:
        self._is_stopped = True
        if self._settings.stop == "torque_off":
            self._held = None
            self._bus.switch_torque(False)
        elif self._wanted is not None:
            self._bus.want(self._at_rest(self._wanted))

    def reset(self) -> None:
        self._is_stopped = False
        self._wanted = None
        if self._settings.stop == "torque_off":
            self._bus.switch_torque(True)

    def sources(self) -> Sequence[MediaSource]:
        return self._cameras

    def close(self) -> None:
        for camera in self._cameras:
            camera.close()
        self._bus.close()

    def _stay(self) -> None:
        """Tell the motors to be where they are: LeRobot switches them on, and they may have a goal from before."""
        places = self.measured_axes()
        if all(map(math.isfinite, places)):
            self._held = self._at_rest(places)
            self._bus.want(self._held)

    def _at_rest(self, values: Sequence[float]) -> tuple[float, ...]:
        return tuple(value if rest is None else rest for value, rest in zip(values, self._rest, strict=True))

    def _fresh(self, now: float) -> State | None:
        """Return the newest state; None if it is too old to be taken for the present."""
        return None if self._age(now) > self._settings.timeout else self._bus.newest

    def _age(self, now: float) -> float:
        newest = self._bus.newest
        return math.inf if newest is None else now - newest.time

    def _values(self, state: State | None) -> list[float]:
        return [math.nan] * len(self._description.axes) if state is None else list(state.values)

    def _joints(self, values: Sequence[float]) -> list[float]:
        return [math.radians(values[number]) for number in self._in_degrees]

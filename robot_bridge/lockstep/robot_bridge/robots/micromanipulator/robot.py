"""The micromanipulator: stepping drives, a needle that bends, and the microscope's view of them."""

import math
from collections.abc import Awaitable, Mapping, Sequence
from typing import Final, NamedTuple

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.micromanipulator.actions.autofocus import Autofocus
from lockstep.robot_bridge.robots.micromanipulator.actions.centring import Centring, ShownPictures
from lockstep.robot_bridge.robots.micromanipulator.actions.snapshot import Snapshot, TakenPicture
from lockstep.robot_bridge.robots.micromanipulator.description import (
    DESCRIPTION,
    MICROPHONE,
    MICROSCOPE,
    SIDE,
    START,
    WINDOWS,
)
from lockstep.robot_bridge.robots.micromanipulator.draughtsman import Draughtsman
from lockstep.robot_bridge.robots.micromanipulator.needle import Contact, Needle
from lockstep.robot_bridge.robots.micromanipulator.samples import MICRO
from lockstep.robot_bridge.robots.micromanipulator.sound import Sound
from lockstep.robot_bridge.robots.micromanipulator.stepper import Stepper
from lockstep.robot_bridge.robots.microphone_source import MicrophoneSource

__all__ = ["MicromanipulatorState", "Micromanipulator"]

LIGHT_RANGE: Final = (20.0, 130.0)  # %
FOCUS: Final = 3  # index of its axis and of its drive
VIEW: Final = 4  # of the first of two, along x and y
TOO_MUCH: Final = 300e-6  # N on the needle above which a fault reports it

Vector = tuple[float, float, float]


class MicromanipulatorState(NamedTuple):
    """The state that pictures need. Lengths in m, x forward, y left, z up from the glass."""

    holder: Vector = START  # place of the tip if the needle were straight
    tip: Vector = START
    force: Vector = (0.0, 0.0, 0.0)  # N, on the needle
    contact: Contact | None = None
    focus: float = 0.0  # m, height of the plane that is sharp
    view: tuple[float, float] = (0.0, 0.0)  # x and y of what the middle of the microscope's picture shows
    light: float = 100.0  # %


class Micromanipulator(Robot):
    """The axes are the velocity of the probe along x, y and z, of the focus along z and of the view along x and y, and
    the change of the light.
    """

    tick_seconds = 0.004
    ticks_on_command = True
    rests_from_thread = True

    def __init__(self) -> None:
        self._drives = tuple(Stepper(place) for place in (*START, 0.0, 0.0, 0.0))
        self._needle = Needle(self._holder())
        self._light = MicromanipulatorState().light
        self._values: list[float] = [0.0] * len(DESCRIPTION.axes)
        self._picture: TakenPicture | None = None  # the microscope's newest
        self._snapshots = 0  # since the start
        self._stopped = False  # no drive has a command to step
        self._draughtsman = Draughtsman()
        self._shown = ShownPictures()
        self._sound = Sound()
        self._sources: tuple[MediaSource, ...] = (
            CameraSource(MICROSCOPE, self._draw_microscope, self.state),
            CameraSource(SIDE, self._draughtsman.side, self.state),
            MicrophoneSource(MICROPHONE, self._hear),
        )

    def describe(self) -> RobotDescription:
        return DESCRIPTION

    def apply(self, values: Sequence[float]) -> None:
        self._values = [0.0] * len(DESCRIPTION.axes) if self._stopped else list(values)

    def tick(self) -> None:
        dt = self.tick_seconds
        for drive, velocity in zip(self._drives, self._values, strict=False):
            drive.tick(velocity, dt)
        low, high = LIGHT_RANGE
        self._light = min(max(self._light + self._values[-1] * dt, low), high)
        self._needle.move(self._holder())

    def measure(self) -> Measurement:
        force = self._needle.force
        return Measurement(
            axes=[*(drive.speed for drive in self._drives), self._values[-1]],
            joints=[drive.position for drive in self._drives],
            wrench=[*force, 0.0, 0.0, 0.0],
            ranges=[],
            at_rest=not any(self._values) and not any(drive.speed for drive in self._drives),
            faults=["the needle is bent too far"] if max(map(abs, force)) > TOO_MUCH else [],
        )

    def positions(self) -> Sequence[float]:
        return [drive.position for drive in self._drives]

    def state(self) -> MicromanipulatorState:
        """Return the state now."""
        needle = self._needle
        return MicromanipulatorState(
            holder=self._holder(),
            tip=needle.tip,
            force=needle.force,
            contact=needle.contact,
            focus=self._drives[FOCUS].position,
            view=self._view(),
            light=self._light,
        )

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if name == "autofocus":
            return Autofocus(
                lambda: self._drives[FOCUS].position,
                lambda: self._needle.tip[2] - self._drives[FOCUS].position,
                WINDOWS["focus.z"],
                axes=len(DESCRIPTION.axes),
                axis=FOCUS,
                tick=self.tick_seconds,
            )
        if name == "centre":
            return self._centre(*(float(parameters[each]) for each in ("x", "y", "event")))
        if name == "tip_to_middle":
            return Centring(
                lambda: self._needle.tip, self._view(), axes=len(DESCRIPTION.axes), first=0, tick=self.tick_seconds
            )
        return Snapshot(lambda: self._picture, tick=self.tick_seconds, taken=self._count_snapshot)

    def _count_snapshot(self) -> None:
        self._snapshots += 1

    def _centre(self, across: float, down: float, event: float) -> ActionRun:
        """`across`, `down`: shares of the microscope's picture from the left and from the top."""
        x, y = self._shown.middle(event, clock.now())
        scale = MICROSCOPE.metres_per_pixel or MICRO
        wanted = x + (0.5 - down) * MICROSCOPE.height * scale, y + (0.5 - across) * MICROSCOPE.width * scale
        goal = _within(wanted[0], "view.x"), _within(wanted[1], "view.y")
        return Centring(
            self._view,
            goal,
            axes=len(DESCRIPTION.axes),
            first=VIEW,
            tick=self.tick_seconds,
            result="there" if goal == wanted else "as far as the stage goes",
        )

    def _draw_microscope(self, state: MicromanipulatorState, event: int) -> bytes | Awaitable[bytes]:
        self._shown.shown(event, state.view, clock.now())
        number = 1 if self._picture is None else self._picture.number + 1
        self._picture = TakenPicture(number, event, state.focus)
        return self._draughtsman.microscope(state, event)

    def status(self) -> Sequence[StatusItem]:
        lamp = StatusItem(
            name="lamp", label="Lamp", kind="temperature", value=round(24 + 0.15 * self._light, 1), unit="°C"
        )
        return (lamp, StatusItem(name="snapshots", label="Snapshots", kind="number", value=float(self._snapshots)))

    def rest_from_thread(self) -> None:
        self._values = [0.0] * len(DESCRIPTION.axes)

    def stop(self) -> None:
        self._stopped = True
        self._values = [0.0] * len(DESCRIPTION.axes)

    def reset(self) -> None:
        self._stopped = False

    def sources(self) -> Sequence[MediaSource]:
        return self._sources

    def close(self) -> None:
        self._draughtsman.close()

    def _hear(self) -> bytes:
        return self._sound.segment(sum(drive.rate for drive in self._drives), math.hypot(*self._needle.force))

    def _holder(self) -> Vector:
        x, y, z = self._drives[:FOCUS]
        return (x.position, y.position, z.position)

    def _view(self) -> tuple[float, float]:
        x, y = self._drives[VIEW:]
        return (x.position, y.position)


def _within(place: float, joint: str) -> float:
    """Return the place that is nearest to this one and short of the joint's limits."""
    low, high = WINDOWS[joint]
    return min(max(place, low + MICRO), high - MICRO)

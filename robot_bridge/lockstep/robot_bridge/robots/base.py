"""The interface between the bridge and a robot."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Media
from lockstep.robot_bridge.robots.actions import ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow

__all__ = ["Measurement", "MediaSource", "Robot", "Stamp", "Stamper"]


class Measurement(NamedTuple):
    """State of the robot, in the order and units of its description.

    A value that cannot be measured now is NaN (axes and joints) or an empty list (wrench and ranges), and a fault says
    why.
    """

    axes: list[float]  # measured value of each axis
    joints: list[float]
    wrench: list[float]  # fx fy fz (N), tx ty tz (N m); empty without a sensor
    ranges: list[float]  # m; empty without a ring
    at_rest: bool
    faults: list[str]


class Stamp(NamedTuple):
    """The event reference that holds now, and the time now on the bridge's monotonic clock (s)."""

    event: int
    time: float


class Stamper(Protocol):
    """Returns the stamp of the event that held at a time. Called from the event loop."""

    def __call__(self) -> Stamp:
        """Return the stamp of now."""

    def at(self, time: float) -> Stamp | None:
        """Return the stamp of an earlier time (s, the bridge's monotonic clock); None if that is too long ago."""


class MediaSource(ABC):
    """A camera or microphone captured beside the robot."""

    @abstractmethod
    async def run(self, stamp: Stamper, emit: Callable[[Media], None]) -> None:
        """Capture until cancelled.

        Call `stamp` at the instant of capture (the start of a sound segment), on the event loop, together with reading
        the state that the medium will show: a stamp may be older than the truth, never newer. Stamp a medium that
        reaches the bridge some time after its capture with `stamp.at` the time of capture. Slow work (rendering,
        encoding) runs in a thread. `emit` never blocks; the newest picture wins if the link is busy.
        """


class Robot(ABC):
    """A robot. All methods but `rest_from_thread` are called from the bridge's event loop and must return at once.

    Order: `describe` first; then, every `tick_seconds`, `apply` and `tick`; `measure` right after a `tick`; `prepare`
    where there is time before the next one.
    Values reach `apply` already clamped, slew-limited and, without a command to execute, at rest.

    With `ticks_on_command` a command begins the tick of the present period of `tick_seconds` at once. There is still
    one tick in each period, so two ticks may follow each other closely, and the next tick may come up to two periods
    later. The slew rate holds over whole periods: two steps of a ramp may come within a fraction of a millisecond. Set
    `ticks_on_command` if the robot takes values at any time, holds them until the next ones, and smooths or tolerates
    such a double step.

    A method that raises ends the bridge. Before it does, the rest values are applied at the axes' brake rates, again
    after each failure, then `stop` is called, then `close`; each call is made even if the others raised. A new object
    is in the state that `reset` leaves behind; the bridge stops it if it was stopped before.
    """

    tick_seconds: float = 0.004
    ticks_on_command: bool = False
    rests_from_thread: bool = False  # True if `rest_from_thread` may be called while another method hangs
    rest_call: str = ""  # "package.module:function" for a watchdog process, see `rest_from_thread`; "": none
    rest_arguments: tuple[str, ...] = ()  # arguments of that function

    @abstractmethod
    def describe(self) -> RobotDescription:
        """Return the description, which stays the same for the life of the object."""

    @abstractmethod
    def apply(self, values: Sequence[float]) -> None:
        """Drive the axes with these values during the coming tick, in the description's order and units.

        The value of a goal axis is its applied goal: the place to be at. The first values after the start and after
        `reset` are what `goals` said then; they move nothing. From then on a value changes by no more than a tick at
        `slew`, with two exceptions. At rest it becomes what `take_up` said in the same tick. And of a pose and the axes
        that it stands in for, only those change that are driven, and when one of these sets begins to be driven in
        place of the other, or a pose with `settling` again after it came to rest, its values are first what `goals`
        said. The bridge does not call this before every goal axis has been measured.
        """

    def pursue_poses(self, names: Sequence[str]) -> None:
        """Take the names of the poses with `settling` that commands drive in the coming tick. Precedes every `apply`.

        The robot pursues the goals of these, also while they stand still. Towards those of any other pose it comes to
        rest within `settling`, counted from the last tick in which the pose was named or its goals changed. After a
        rest, a stop, a lost link or a failure only a new command names a pose again. From `settling` before `hold` has
        passed since the last command, no pose is named. So the robot is at rest within `hold`.

        A pose is not named while a limit slows one of its axes. Otherwise limits see the motion of the goals alone: the
        robot itself keeps its joints within their ranges while it pursues goals that stand still. A robot that does not
        override this comes to rest `settling` after its goals stood still, and gets no nearer by a command that repeats
        them.
        """

    def tick(self) -> None:
        """Let one `tick_seconds` pass. Only simulations need it."""

    def prepare(self) -> None:
        """Compute what the next `apply` and `tick` can use, whatever their values are, so that they take less time.

        Called after a tick while the bridge runs. With `ticks_on_command`, after a tick that sent a feedback, it is
        called up to 2 ms later, or not at all if the next tick comes first. It must change nothing that the robot does.
        """

    @abstractmethod
    def measure(self) -> Measurement:
        """Measure the state now."""

    def measured_axes(self) -> Sequence[float]:
        """Return the measured value of each axis now, as in `measure`; NaN if unknown or too old to be trusted.

        Called when the bridge starts, when a stop was reset, and for commands with goals, at most once between two
        ticks. With `ticks_on_command` the bridge may call it ahead of the command, if it is fast enough. `reach` bounds
        the distance of goals from here. Needed only for goal axes.
        """
        return self.measure().axes

    def goals(self) -> Sequence[float]:
        """Return for each axis the goal that the robot pursues now, in the axis' unit; NaN or measured if it has none.

        The bridge begins there when it starts and when a stop was reset; at `measured_axes` instead if one axis is
        further than its `reach` from its goal. A robot that holds its place during a stop says here where. One whose
        power was cut, or whose brakes have closed, takes the measured values for its goals in `reset`.

        A robot with poses says here where their axes are told to be while others are driven in their place: the
        forward kinematics of the joints' goals; and the other way round.

        A pose with `settling` begins here each time it has come to rest.

        Without this method the measured values are taken: an arm that hangs below its goals under a load then goes
        down by that much on each of these occasions.
        """
        return self.measured_axes()

    def take_up(self) -> Sequence[float] | None:
        """Return `goals` if something else has moved the robot since the last call; else None.

        Called in each tick that begins at rest, before `apply`, which gets these goals then and must move nothing by
        them. So the next operator begins where the robot is after something else has moved it. Override it only if the
        robot itself knows that: by a controller of its own that was told other goals, or a simulation that began anew.
        It must not return what is measured of an arm that `apply` holds: an arm that hangs below its goals under a load
        would go down step by step. NaN: that axis is where it was.
        """
        return None

    def positions(self) -> Sequence[float]:
        """Return the position of each joint now, for limits and geofences; NaN if unknown or too old to be trusted.

        Called up to once a tick while the robot moves, so it should cost little.
        """
        return self.measure().joints

    def joint_rates(self, values: Sequence[float]) -> Sequence[float] | None:
        """Return the velocity of each joint that these axis values cause in the present posture; None if not known.

        Needed only for position limits with a gain of None. The value of a goal axis is here the speed of its goal.
        """
        return None

    def rest_from_thread(self) -> None:
        """Bring the robot to rest now. Called from another thread while `apply`, `tick` or `measure` may hang.

        Called when no tick came for the description's `watchdog` seconds while the robot moves, and again at intervals
        until one comes. It must not wait for anything that a hanging method may hold, and late writes of such a method
        should not move the robot; the next tick applies rest values. Set `rests_from_thread` if the robot can do that.
        The call needs the interpreter's lock: native code that blocks without releasing the lock holds up this call
        too.

        Set `rest_call` for such code. A separate process imports that module when the bridge starts, and calls the
        function with `rest_arguments`. The function returns another, without arguments, which brings the robot to rest
        in its own way and returns False if no listener can have got the message. That one is called as this method is,
        and also when the bridge is killed while the robot moves.
        """
        raise NotImplementedError

    @abstractmethod
    def stop(self) -> None:
        """Keep the robot standing by the strongest means that software has: engage brakes, cut power, hold the place.

        Called when a stop was latched and the axes are back at their rest values (stop category 1 of IEC 60204-1 if
        power is cut), when the bridge ends for any reason, and after a failure of any other method. May be called
        again. Until `reset`, no value in `apply` may move the robot. If it raises, the bridge tries again, twice, and
        ends.
        """

    def reset(self) -> None:
        """Undo `stop`, because the stop was released. Must not move anything.

        Afterwards the goal axes begin at `goals`, since the arm may have fallen meanwhile.
        """

    def locked_out(self) -> str:
        """Return why a person at the robot has locked it (key switch, teach pendant); "" while it is not locked.

        Called in every tick. While the robot is locked it is stopped, and no remote person can release it.
        """
        return ""

    def hardware_stop(self) -> bool | None:
        """Return whether a hardware stop of the robot is pressed; None if that is not known, or there is none.

        Called in every tick. A pressed stop counts as a lock, as with `locked_out`, and the status shows it.
        """
        return None

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        """Begin an action of the description. The parameters are complete and checked.

        The bridge cancels an action that moves the robot as soon as no armed event renews it, a stick is moved, or the
        robot is stopped.

        Raises:
            ActionNotPossible: the robot cannot begin it now; the text tells a person why.
        """
        raise ActionNotPossible(f"{name} is not implemented")

    def status(self) -> Sequence[StatusItem]:
        """Return everything that the robot reports of itself: battery, mode, temperatures. Called twice a second."""
        return ()

    def grid_map(self) -> GridMap | None:
        """Return the newest map, the same object until there is another; None before the first.

        Called ten times a second if the description has `map`.
        """
        return None

    def navigation(self) -> NavigationNow | None:
        """Return where the robot is on its map and where it is going; called as `grid_map` is. None: it says nothing.

        The goal is that of the action `map.goal` while it runs, or another that the robot pursues.
        """
        return None

    def sources(self) -> Sequence[MediaSource]:
        """Return the cameras and microphones, with the names that they have in the description."""
        return ()

    def close(self) -> None:
        """Release the robot's resources."""

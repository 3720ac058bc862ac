"""A device of the tests in place of LeRobot, which is in another Python; tests/lerobot has its real classes."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

from lockstep.robot_bridge.robots.lerobot.device import AxisFacts, CameraFacts, DeviceFacts, Shots

PAN = AxisFacts("pan.pos", "degrees", -90.0, 90.0)
GRIPPER = AxisFacts("gripper.pos", "range_0_100")
WHEEL = AxisFacts("x.vel")


class FakeDevice:
    """Is at once where it is told to be, unless it has no torque."""

    def __init__(
        self, *axes: AxisFacts, cameras: tuple[CameraFacts, ...] = (), has_torque: bool = True, at: float = 0.0
    ) -> None:
        self.facts = DeviceFacts("fake_follower", "one", axes or (PAN, GRIPPER), cameras, has_torque)
        self.places: dict[str, Any] = {axis.name: at for axis in self.facts.axes}
        self.calls: list[tuple[str, Any]] = []
        self.called = threading.Condition()
        self.on_act: Callable[[], None] = _nothing
        self.on_observe: Callable[[], None] = _nothing
        self.has_torque = True
        self.yields: dict[str, float] = {}  # by which a place differs from its goal, under a load

    def camera(self, name: str) -> Shots:
        raise AssertionError(f"no camera {name} is read apart")

    def observe(self) -> Mapping[str, Any]:
        self.on_observe()
        self._note("observe", None)
        return dict(self.places)

    def act(self, action: dict[str, float]) -> None:
        self.on_act()
        if self.has_torque:
            self.places.update({name: goal + self.yields.get(name, 0.0) for name, goal in action.items()})
        self._note("act", action)

    def torque(self, on: bool) -> None:
        self.has_torque = on
        self._note("torque", on)

    def disconnect(self, *, torque_off: bool) -> None:
        self._note("disconnect", torque_off)

    def _note(self, call: str, value: Any) -> None:
        with self.called:
            self.calls.append((call, value))
            self.called.notify_all()

    def wait(self, call: str, value: Any, after: int = 0) -> int:
        """Wait for a call; return how many there were with it."""

        def found() -> int:
            return next((n + 1 for n, each in enumerate(self.calls) if n >= after and each == (call, value)), 0)

        with self.called:
            assert self.called.wait_for(found, 10), self.calls[-10:]
            return found()

    def made(self, call: str) -> list[Any]:
        with self.called:
            return [value for each, value in self.calls if each == call]


def _nothing() -> None:
    pass

"""An arm of the tests behind LeRobot's own base classes, since no motors are here: no bus, no MuJoCo, three servos.

Each servo goes to its goal at a bounded speed; without torque the arm falls. The camera draws the first joint as a grey
level. The file named by TINY_ARM makes trouble: "hang", "raise", "blind" (no state) or "dark" (no pictures) in it.
It runs in LeRobot's Python, and is found by --robot.discover_packages_path or as module:Class.
"""

import os
import threading
import time
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig
from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.robots import Robot
from lerobot.robots.config import RobotConfig

SPEED = 200.0  # degrees/s, or %/s
FALL = 30.0  # degrees/s
RANGES = {"pan": (0, 4095), "lift": (1024, 3071), "gripper": (0, 4095)}


def trouble() -> str:
    path = os.environ.get("TINY_ARM", "")
    return Path(path).read_text().strip() if path and Path(path).exists() else ""


@RobotConfig.register_subclass("tiny_arm")
@dataclass(kw_only=True)
class TinyArmConfig(RobotConfig):
    calibrated: bool = True
    picture: bool = True
    start: dict[str, float] = field(default_factory=lambda: {"pan": 10.0, "lift": -20.0, "gripper": 50.0})
    disable_torque_on_disconnect: bool = True


class TinyBus:
    """Motors without wires."""

    model_resolution_table = {"tiny": 4096}

    def __init__(self, start: dict[str, float]) -> None:
        self.motors = {
            "pan": Motor(1, "tiny", MotorNormMode.DEGREES),
            "lift": Motor(2, "tiny", MotorNormMode.DEGREES),
            "gripper": Motor(3, "tiny", MotorNormMode.RANGE_0_100),
        }
        self.calibration = {
            name: MotorCalibration(motor.id, 0, 0, *RANGES[name]) for name, motor in self.motors.items()
        }
        self.has_torque = True
        self._lock = threading.Lock()
        self._places = dict(start)
        self._goals = dict(start)
        self._time = time.monotonic()

    def enable_torque(self) -> None:
        with self._lock:
            self._move()
            self.has_torque = True

    def disable_torque(self) -> None:
        with self._lock:
            self._move()
            self.has_torque = False

    def read(self) -> dict[str, float]:
        with self._lock:
            self._move()
            return dict(self._places)

    def write(self, goals: dict[str, float]) -> None:
        with self._lock:
            self._move()
            self._goals.update(goals)

    def _move(self) -> None:
        now = time.monotonic()
        dt, self._time = now - self._time, now
        for name, goal in self._goals.items():
            place = self._places[name]
            if self.has_torque:
                step = min(max(goal - place, -SPEED * dt), SPEED * dt)
                self._places[name] = place + step
            elif name == "lift":
                self._places[name] = max(place - FALL * dt, -89.0)


class TinyCamera(Camera):
    """Draws the arm 20 times a second, in a thread of its own as LeRobot's cameras do."""

    def __init__(self, bus: TinyBus) -> None:
        super().__init__(CameraConfig(fps=20, width=64, height=48))
        self._bus = bus
        self._came = threading.Event()
        self._leave = threading.Event()
        self._newest: Any = None
        self._thread: threading.Thread | None = None

    @property
    def is_connected(self) -> bool:
        return self._thread is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []

    def connect(self, warmup: bool = True) -> None:
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def read(self) -> Any:
        return self.async_read()

    def async_read(self, timeout_ms: float = 200) -> Any:
        if not self._came.wait(timeout_ms / 1000):
            raise TimeoutError("no frame")
        self._came.clear()
        return self._newest

    def read_latest(self, max_age_ms: int = 500) -> Any:
        if self._newest is None or trouble() == "dark":
            raise TimeoutError("no frame")
        return self._newest

    def disconnect(self) -> None:
        self._leave.set()
        self._thread = None

    def _run(self) -> None:
        while not self._leave.wait(0.05):
            if trouble() == "dark":
                continue
            level = int(min(max(128 + self._bus.read()["pan"], 0), 255))
            self._newest = np.full((48, 64, 3), level, np.uint8)
            self._came.set()


class TinyArm(Robot):
    config_class = TinyArmConfig
    name = "tiny_arm"

    def __init__(self, config: TinyArmConfig) -> None:
        super().__init__(config)
        self.config = config
        self.bus = TinyBus(config.start)
        self.cameras: dict[str, Any] = {"front": TinyCamera(self.bus)} if config.picture else {}
        self._connected = False

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        pictures = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return {**self.action_features, **pictures}

    @cached_property
    def action_features(self) -> dict[str, Any]:
        return {f"{name}.pos": float for name in self.bus.motors}

    @property
    def is_connected(self) -> bool:
        return self._connected

    @property
    def is_calibrated(self) -> bool:
        return self.config.calibrated

    def connect(self, calibrate: bool = True) -> None:
        if calibrate and not self.is_calibrated:
            self.calibrate()
        for camera in self.cameras.values():
            camera.connect()
        self._connected = True

    def calibrate(self) -> None:
        input("Move the arm to the middle of its range and press ENTER")

    def configure(self) -> None:
        pass

    def get_observation(self) -> dict[str, Any]:
        if trouble() == "blind":
            raise ConnectionError("no status packet")
        observed: dict[str, Any] = {f"{name}.pos": place for name, place in self.bus.read().items()}
        return observed | {name: camera.read_latest() for name, camera in self.cameras.items()}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        match trouble():
            case "hang":
                time.sleep(3600)
            case "raise":
                raise ConnectionError("the bus is unplugged")
        self.bus.write({name.removesuffix(".pos"): float(value) for name, value in action.items()})
        return action

    def disconnect(self) -> None:
        if self.config.disable_torque_on_disconnect:
            self.bus.disable_torque()
        for camera in self.cameras.values():
            camera.disconnect()
        self._connected = False
        print(f"disconnected, torque {'on' if self.bus.has_torque else 'off'}", flush=True)

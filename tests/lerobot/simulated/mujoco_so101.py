"""A MuJoCo SO-101 behind LeRobot's own Robot class: six motors in degrees and per cent, and two cameras.

The physics are those of Lockstep's simulated arm, whose model a user has fetched (docs/so101.md); a thread steps them
in real time. It runs in LeRobot's Python, which needs Lockstep's packages `protocol` and `robot_bridge` on its path. It
is found as module:Class; LeRobot's own commands, which have no Lockstep, must not discover it.
"""

import math
import os
import threading
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig
from lerobot.motors import Motor, MotorCalibration, MotorNormMode
from lerobot.robots import Robot
from lerobot.robots.config import RobotConfig

from lockstep.robot_bridge.robots.mujoco_view.graphics import choose_graphics
from lockstep.robot_bridge.robots.so101.model_source import arm_file

choose_graphics()  # before MuJoCo, which reads the choice at its import

from lockstep.robot_bridge.robots.mujoco_view.canvas import Canvas, Look  # noqa: E402
from lockstep.robot_bridge.robots.so101.model import JOINT_NAMES  # noqa: E402
from lockstep.robot_bridge.robots.so101.simulation import Simulation  # noqa: E402

STEP = 0.004  # s between two readings of the clock
VIEWS = {"overview": ("overview", 320, 240), "wrist": ("arm.gripper", 320, 240)}
FRAME_RATE = 10
GRIPPER = "gripper"
ENCODER = 4095  # steps of a turn
SHUT, OPEN = -0.17, 1.74  # rad, of the gripper at 0 and 100 %
HALF_RANGES = {"shoulder_pan": 109, "shoulder_lift": 99, "elbow_flex": 96, "wrist_flex": 94, "wrist_roll": 156}  # deg


@RobotConfig.register_subclass("mujoco_so101")
@dataclass(kw_only=True)
class MujocoSo101Config(RobotConfig):
    picture: bool = True


class SimulatedMotors:
    """The arm's motors, as LeRobot's bus has them, and the thread that lets time pass."""

    model_resolution_table = {"sts3215": ENCODER + 1}

    def __init__(self) -> None:
        self.motors = {
            name: Motor(number, "sts3215", MotorNormMode.RANGE_0_100 if name == GRIPPER else MotorNormMode.DEGREES)
            for number, name in enumerate(JOINT_NAMES, 1)
        }
        self.calibration = {
            name: MotorCalibration(motor.id, 0, 0, *_range(name)) for name, motor in self.motors.items()
        }
        self.simulation = Simulation(arm_file(os.environ))
        self.lock = threading.Lock()
        self._goals = self.simulation.joints()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()

    def read(self) -> dict[str, float]:
        with self.lock:
            return {
                name: _shown(name, value) for name, value in zip(JOINT_NAMES, self.simulation.joints(), strict=True)
            }

    def write(self, goals: dict[str, float]) -> None:
        with self.lock:
            for place, name in enumerate(JOINT_NAMES):
                if name in goals:
                    self._goals[place] = _radians(name, goals[name])

    def _run(self) -> None:
        simulated = time.monotonic()
        pace = float(self.simulation.model.opt.timestep)
        while not self._ended.wait(STEP):
            due = int((time.monotonic() - simulated) / pace)
            simulated += due * pace
            with self.lock:
                self.simulation.aim(self._goals, np.zeros(len(self._goals)))
                self.simulation.step(min(due, 50))


class SimulatedCamera(Camera):
    """Its pictures come from the one thread that owns the graphics."""

    def __init__(self, width: int, height: int) -> None:
        super().__init__(CameraConfig(fps=FRAME_RATE, width=width, height=height))
        self._came = threading.Event()
        self._newest: Any = None
        self._connected = False

    @property
    def is_connected(self) -> bool:
        return self._connected

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []

    def connect(self, warmup: bool = True) -> None:
        self._connected = True

    def show(self, picture: Any) -> None:
        self._newest = picture
        self._came.set()

    def read(self) -> Any:
        return self.async_read()

    def async_read(self, timeout_ms: float = 2000) -> Any:
        if not self._came.wait(timeout_ms / 1000):
            raise TimeoutError("no frame")
        self._came.clear()
        return self._newest

    def read_latest(self, max_age_ms: int = 500) -> Any:
        if self._newest is None:
            raise TimeoutError("no frame")
        return self._newest

    def disconnect(self) -> None:
        self._connected = False


class MujocoSo101(Robot):
    config_class = MujocoSo101Config
    name = "mujoco_so101"

    def __init__(self, config: MujocoSo101Config) -> None:
        super().__init__(config)
        self.config = config
        self.bus = SimulatedMotors()
        views = VIEWS if config.picture else {}
        self.cameras = {name: SimulatedCamera(width, height) for name, (_, width, height) in views.items()}
        self._painted = dict(self.cameras)  # the bridge takes them from `cameras` and reads them itself
        self._connected = False
        self._ended = threading.Event()
        self._painter = threading.Thread(target=self._paint, daemon=True)

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        return {**self.action_features, **{name: (VIEWS[name][2], VIEWS[name][1], 3) for name in self.cameras}}

    @cached_property
    def action_features(self) -> dict[str, Any]:
        return {f"{name}.pos": float for name in self.bus.motors}

    @property
    def is_connected(self) -> bool:
        return self._connected

    @property
    def is_calibrated(self) -> bool:
        return True

    def connect(self, calibrate: bool = True) -> None:
        self.bus.start()
        for camera in self.cameras.values():
            camera.connect()
        self._painter.start()
        self._connected = True

    def calibrate(self) -> None:
        pass

    def configure(self) -> None:
        pass

    def get_observation(self) -> dict[str, Any]:
        observed: dict[str, Any] = {f"{name}.pos": place for name, place in self.bus.read().items()}
        return observed | {name: camera.read_latest() for name, camera in self.cameras.items()}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        self.bus.write({name.removesuffix(".pos"): float(value) for name, value in action.items()})
        return action

    def disconnect(self) -> None:
        self._ended.set()
        self._painter.join()
        self.bus.end()
        for camera in self.cameras.values():
            camera.disconnect()
        self._connected = False

    def _paint(self) -> None:
        if not self._painted:
            return
        canvas = Canvas(self.bus.simulation.model, 320, 240, Look())
        try:
            while not self._ended.wait(1 / FRAME_RATE):
                with self.bus.lock:
                    positions = self.bus.simulation.snapshot()
                for name, camera in self._painted.items():
                    view, width, height = VIEWS[name]
                    pixels = np.zeros((height, width, 4), np.uint8)
                    canvas.draw(view, positions, pixels)
                    camera.show(np.ascontiguousarray(pixels[::-1, :, :3]))
        finally:
            canvas.close()


def _range(name: str) -> tuple[int, int]:
    """The calibrated range in steps; its middle is 0 degrees."""
    half = HALF_RANGES.get(name, 60) * ENCODER / 360
    return round(ENCODER / 2 - half), round(ENCODER / 2 + half)


def _shown(name: str, radians: float) -> float:
    return 100 * (radians - SHUT) / (OPEN - SHUT) if name == GRIPPER else math.degrees(radians)


def _radians(name: str, value: float) -> float:
    return SHUT + (OPEN - SHUT) * value / 100 if name == GRIPPER else math.radians(value)

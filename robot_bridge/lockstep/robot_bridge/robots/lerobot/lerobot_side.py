"""The only module that uses LeRobot: makes a robot of its classes by its own flags, and calls it."""

import json
import logging
import pkgutil
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, suppress
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any, get_args

from lockstep.robot_bridge.errors import BadRobot, RobotUnavailable, SettingsError, UnknownRobot
from lockstep.robot_bridge.robots.lerobot.device import AxisFacts, CameraFacts, DeviceFacts, Norm, Shots

__all__ = ["LeRobotDevice", "connect"]

CAMERA_TIMEOUT_MS = 1000.0
PREFIX = "--robot."

_logger = logging.getLogger(__name__)


def connect(kind: str, config: Mapping[str, Any], flags: Sequence[str]) -> "LeRobotDevice":
    """Make a robot and connect it. Nothing asks at the terminal: a robot that is not calibrated is an error.

    Args:
        kind: LeRobot's type, such as "so101_follower", or "module:Class"; "": the flags say it
        config: fields of its configuration
        flags: further ones as LeRobot's commands take them, such as "--robot.port=/dev/ttyACM0"; they win

    Raises:
        RobotUnavailable: LeRobot is missing, the robot does not answer, or is not calibrated.
        UnknownRobot: there is no such type or class.
        BadRobot: the class is not one of a robot.
        SettingsError: the configuration does not fit.
    """
    try:
        robots = import_module("lerobot.robots")
        import_module("draccus")
    except ImportError as error:
        raise RobotUnavailable(
            f"LeRobot is missing ({error}): run this with the Python that has it, or name that with --robot-python"
        ) from error
    _register(robots)
    words = [*(f"{PREFIX}{key}={json.dumps(value, default=str)}" for key, value in config.items()), *flags]
    robot = _from_class(kind, words) if ":" in kind else _from_type(kind, words)
    _keep_torque(robot)
    try:
        robot.connect(calibrate=False)
    except Exception as error:
        with suppress(Exception):
            robot.disconnect()
        raise RobotUnavailable(f"{robot} does not connect: {type(error).__name__}: {error}") from error
    try:
        if not robot.is_calibrated:
            raise RobotUnavailable(f"{robot} is not calibrated: run lerobot-calibrate with the same flags first")
        return LeRobotDevice(robot)
    except BaseException:
        with suppress(Exception):
            robot.disconnect()
        raise


class LeRobotDevice:
    """A connected robot of LeRobot."""

    def __init__(self, robot: Any) -> None:
        self._robot = robot
        self._own_cameras: dict[str, Any] = {}  # those that are read apart
        self._all_cameras: dict[str, Any] | None = None  # the robot's, while it is to read none of them
        pictures = {name: shape for name, shape in robot.observation_features.items() if _is_picture(shape)}
        cameras = getattr(robot, "cameras", None)
        if isinstance(cameras, dict) and cameras.keys() >= pictures.keys():
            self._own_cameras = {name: cameras[name] for name in pictures if hasattr(cameras[name], "async_read")}
        motors = dict(_motors(robot))
        observed = robot.observation_features
        self.facts = DeviceFacts(
            kind=str(robot.name),
            id=str(robot.id or ""),
            axes=tuple(
                _axis(name, motors.get(name), name in observed)
                for name, feature in robot.action_features.items()
                if feature is float
            ),
            cameras=tuple(
                CameraFacts(name, shape[1], shape[0], _rate(self._own_cameras.get(name)), name in self._own_cameras)
                for name, shape in pictures.items()
            ),
            has_torque=any(hasattr(bus, "disable_torque") for _, bus in _buses(robot)),
        )
        if cameras and self._own_cameras.keys() == cameras.keys():
            self._read_no_pictures(cameras)

    def camera(self, name: str) -> Shots:
        return _OwnCamera(self._own_cameras[name])

    def observe(self) -> Mapping[str, Any]:
        observed: Mapping[str, Any] = self._robot.get_observation()
        return observed

    def act(self, action: dict[str, float]) -> None:
        self._robot.send_action(action)

    def torque(self, on: bool) -> None:
        for _, bus in _buses(self._robot):
            if on:
                bus.enable_torque()
            else:
                bus.disable_torque()

    def disconnect(self, *, torque_off: bool) -> None:
        if torque_off:
            try:
                self.torque(False)
            except Exception as error:  # the disconnect below lets go of the bus all the same
                _logger.error("the torque of %s could not be switched off: %s", self._robot, error)
        if self._all_cameras is not None:
            self._robot.cameras = self._all_cameras
        self._robot.disconnect()

    def _read_no_pictures(self, cameras: dict[str, Any]) -> None:
        """Let the robot read its state without the cameras, which have threads of their own: one that hangs would keep
        the state from being read."""
        try:
            self._robot.cameras = {}
            self._robot.get_observation()
        except Exception as error:
            _logger.info("%s reads its pictures with its state: %s", self._robot, error)
            with suppress(AttributeError):
                self._robot.cameras = cameras
        else:
            self._all_cameras = cameras


class _OwnCamera:
    def __init__(self, camera: Any) -> None:
        self._camera = camera

    def read(self) -> Any:
        return self._camera.async_read(timeout_ms=CAMERA_TIMEOUT_MS)


def _register(robots: Any) -> None:
    """Import everything that registers a type of robot or camera. A type whose own packages are missing is left out."""
    cameras = import_module("lerobot.cameras")
    for package in (robots, cameras):
        for module in pkgutil.iter_modules(package.__path__):
            if module.ispkg:
                try:
                    import_module(f"{package.__name__}.{module.name}")
                except Exception as error:
                    _logger.debug("%s.%s: %s", package.__name__, module.name, error)
    with suppress(ImportError, AttributeError):
        import_module("lerobot.utils.import_utils").register_third_party_plugins()


def _from_type(kind: str, flags: Sequence[str]) -> Any:
    """Let LeRobot read the flags and make the robot."""
    base = import_module("lerobot.robots.config").RobotConfig
    given = next((flag.partition("=")[2] for flag in flags if flag.startswith(f"{PREFIX}type=")), "")
    wanted = given or kind
    known = base.get_known_choices()
    if wanted not in known:
        raise UnknownRobot(f"LeRobot has no robot {wanted!r}; there are {', '.join(sorted(known))}")
    config = _parse(known[wanted], [flag for flag in flags if not flag.startswith(f"{PREFIX}type=")], wanted)
    try:
        return import_module("lerobot.robots").make_robot_from_config(config)
    except Exception as error:
        raise BadRobot(f"{wanted} cannot be made: {type(error).__name__}: {error}") from error


def _from_class(spec: str, flags: Sequence[str]) -> Any:
    module, _, name = spec.partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))  # as `python -m` does
    try:
        found = getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise UnknownRobot(f"{spec}: {error}") from error
    if not (isinstance(found, type) and issubclass(found, import_module("lerobot.robots").Robot)):
        raise BadRobot(f"{spec} is not a robot of LeRobot: it does not inherit lerobot.robots.Robot")
    config = _parse(found.config_class, flags, spec)  # type: ignore[attr-defined]
    try:
        return found(config)
    except Exception as error:
        raise BadRobot(f"{spec} cannot be made: {type(error).__name__}: {error}") from error


def _parse(config: Any, flags: Sequence[str], kind: str) -> Any:
    """Read the flags as LeRobot's commands do, for the fields of one configuration."""
    words = [f"--{flag.removeprefix(PREFIX)}" for flag in flags]
    said = StringIO()
    try:
        with redirect_stderr(said):  # argparse says there what it does not know, and exits
            return import_module("draccus").parse(config_class=config, args=words)
    except (Exception, SystemExit) as error:
        lines = said.getvalue().strip().splitlines()
        text = lines[-1] if isinstance(error, SystemExit) and lines else " ".join(str(error).split())
        raise SettingsError(f"the configuration of {kind} does not fit: {text}") from error


def _is_picture(shape: Any) -> bool:
    return isinstance(shape, tuple) and len(shape) == 3 and shape[2] == 3


def _rate(camera: Any) -> float | None:
    rate = getattr(camera, "fps", None)
    return float(rate) if rate else None


def _parts(robot: Any) -> list[tuple[str, Any]]:
    """Return the robot, and its arms if it has two, each with what stands before the names of its motors."""
    return [
        ("", robot),
        *((f"{side}_", arm) for side in ("left", "right") if (arm := getattr(robot, f"{side}_arm", None)) is not None),
    ]


def _buses(robot: Any) -> list[tuple[str, Any]]:
    return [(prefix, part.bus) for prefix, part in _parts(robot) if getattr(part, "bus", None) is not None]


def _keep_torque(robot: Any) -> None:
    """An arm without torque falls: only the setting `stop` switches it off, and no process that ends in disorder."""
    for _, part in _parts(robot):
        if hasattr(getattr(part, "config", None), "disable_torque_on_disconnect"):
            part.config.disable_torque_on_disconnect = False


def _motors(robot: Any) -> list[tuple[str, tuple[Norm | None, float | None, float | None]]]:
    """Return the entries of the action that are motors' positions: how each is normalised, and its range."""
    return [
        (f"{prefix}{name}.pos", _range(bus, name, motor))
        for prefix, bus in _buses(robot)
        for name, motor in getattr(bus, "motors", {}).items()
    ]


def _range(bus: Any, name: str, motor: Any) -> tuple[Norm | None, float | None, float | None]:
    norm = getattr(getattr(motor, "norm_mode", None), "value", None)
    if norm not in get_args(Norm):
        return None, None, None
    if norm != "degrees":
        return norm, None, None
    try:
        calibration = bus.calibration[name]
        steps = bus.model_resolution_table[motor.model] - 1
        half = (calibration.range_max - calibration.range_min) / 2 * 360 / steps  # 0 is in the middle of the range
    except (AttributeError, KeyError, TypeError):
        return norm, None, None
    return norm, -half, half


def _axis(name: str, motor: tuple[Norm | None, float | None, float | None] | None, observed: bool) -> AxisFacts:
    norm, minimum, maximum = motor or (None, None, None)
    return AxisFacts(name, norm, minimum, maximum, observed)

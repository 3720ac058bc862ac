"""Any robot that LeRobot drives (docs/lerobot.md). LeRobot is imported when a robot is made, in its own Python."""

import gc
from collections.abc import Sequence
from pathlib import Path

from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError, RobotUnavailable, SettingsError
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.robots.lerobot.description import describe
from lockstep.robot_bridge.robots.lerobot.device import Device
from lockstep.robot_bridge.robots.lerobot.settings import LeRobotSettings
from lockstep.robot_bridge.yaml_file import SettingsPlace, YamlFile

__all__ = ["create", "drive", "read_flags"]

FLAG = "--robot."


def read_flags(words: Sequence[str]) -> tuple[str, list[str]]:
    """Split what follows `lockstep robot lerobot`: return "module:Class" or "", and LeRobot's flags.

    `--type X` counts as `--robot.type=X`. A flag and its value may be one word or two.

    Raises:
        SettingsError: a word is neither.
    """
    spec, flags = "", list[str]()
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if word == "--type" or word.startswith("--type="):
            word = FLAG + word.removeprefix("--")
        if word.startswith(FLAG):
            if "=" not in word:
                if not rest:
                    raise SettingsError(f"{word} has no value")
                word = f"{word}={rest.pop(0)}"
            flags.append(word)
        elif ":" in word and not word.startswith("-") and not spec:
            spec = word
        else:
            raise SettingsError(f"{word!r} is neither module:Class nor one of LeRobot's flags, --robot.…")
    return spec, flags


def create(path: Path | None, words: Sequence[str] = ()) -> Robot:
    """Connect a robot of LeRobot and return it.

    Args:
        path: the YAML file; None: the words say everything
        words: "module:Class" and flags of LeRobot's commands, which come on top of the file

    Raises:
        SettingsError: the file or a flag cannot be used; names the line and the key.
        UnknownRobot: LeRobot has no such robot.
        BadRobot: it cannot be made.
        RobotUnavailable: LeRobot is missing, or the robot does not answer or is not calibrated.
    """
    file = None if path is None else YamlFile(path)
    settings = LeRobotSettings() if file is None else file.convert(LeRobotSettings)
    spec, flags = read_flags(words)
    from lockstep.robot_bridge.robots.lerobot.lerobot_side import connect

    device = connect(spec or settings.robot, settings.config, flags)
    gc.collect()
    gc.freeze()  # PyTorch's objects are many, and looking through them again and again would hold up the ticks
    try:
        return drive(device, settings)
    except SettingsPlace as place:
        if file is not None:
            raise file.error(place) from place
        where = ".".join(map(str, place.keys))
        raise SettingsError(f"{where}: {place.detail}, in a file that --lerobot names") from place


def drive(device: Device, settings: LeRobotSettings) -> Robot:
    """Return the robot of a connected device; the device is let go if that fails.

    Raises:
        SettingsPlace: a setting does not fit the device.
        SettingsError: the description contradicts itself.
        RobotUnavailable: the robot cannot be read.
    """
    from lockstep.robot_bridge.robots.lerobot.robot import LeRobotRobot

    try:
        description = describe(settings, device.facts)
        check_description(description)
    except DescriptionError as error:
        device.disconnect(torque_off=False)
        raise SettingsError(error.detail) from error
    except BaseException:
        device.disconnect(torque_off=False)
        raise
    try:
        return LeRobotRobot(device, settings, description)
    except Exception as error:  # it has let the device go
        raise RobotUnavailable(f"the robot cannot be read: {type(error).__name__}: {error}") from error

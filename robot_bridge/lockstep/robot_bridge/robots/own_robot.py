"""Makes robots from outside this package: named as "module:Class", or by an installed package's entry point.

Errors say in one line where the robot was looked for, what was found, and the line of its code that failed.
"""

import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import BadRobot, BridgeError, DescriptionError, UnknownRobot
from lockstep.robot_bridge.robots.base import Robot

__all__ = ["GROUP", "create_own_robot", "installed_robots"]

GROUP = "lockstep.robots"  # of entry points, each "name = module:Class"


def installed_robots() -> dict[str, str]:
    """Return "module:Class" by name, for the robots of all installed packages."""
    return {entry.name: entry.value for entry in entry_points(group=GROUP)}


def create_own_robot(spec: str) -> Robot:
    """Make a robot. `spec`: "module:Class", also of a module in the working directory.

    Raises:
        UnknownRobot: there is no such module, or nothing of that name in it.
        BadRobot: it is not a robot, or raises when it is made or described.
        DescriptionError: its description contradicts itself.
        BridgeError: raised by the robot itself.
    """
    module, _, name = spec.partition(":")
    if not name or not all(part.isidentifier() for part in (*module.split("."), *name.split("."))):
        raise UnknownRobot(f"{spec!r} is not module:Class")
    make = _find(spec, module, name)
    if isinstance(make, type) and not issubclass(make, Robot):
        raise BadRobot(f"{spec} is not a robot: the class does not inherit lockstep.robot_bridge.robots.base.Robot")
    if not callable(make):
        raise BadRobot(f"{spec} is not a robot: it is a {type(make).__name__}, not a class")
    robot = _call(spec, make)
    if not isinstance(robot, Robot):
        raise BadRobot(f"{spec} is not a robot: it makes a {type(robot).__name__}")
    description = _call(f"{spec}: describe()", robot.describe)
    if not isinstance(description, RobotDescription):
        raise BadRobot(f"{spec}: describe() returned a {type(description).__name__}, not a RobotDescription")
    try:
        check_description(description)
    except DescriptionError as error:
        raise DescriptionError(f"{spec}: describe(): {error.detail}") from error
    except (TypeError, AttributeError) as error:  # a field holds something of another type
        raise DescriptionError(f"{spec}: describe(): {error}") from error
    return robot


def _find(spec: str, module: str, name: str) -> object:
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))  # as `python -m` does
    try:
        found: object = import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or module
        if module == missing or module.startswith(f"{missing}."):
            raise UnknownRobot(f"{spec}: no module {missing!r} here or among the installed packages") from error
        raise BadRobot(f"{spec}: {module} needs the module {missing!r}, which is not installed") from error
    except BridgeError:
        raise
    except Exception as error:
        raise BadRobot(f"{spec}: importing {module} failed: {_words(error)}") from error
    for part in name.split("."):
        if not hasattr(found, part):
            raise UnknownRobot(f"{spec}: {module} has no {name!r}")
        found = getattr(found, part)
    return found


def _call(what: str, make: Callable[[], object]) -> object:
    try:
        return make()
    except BridgeError:
        raise
    except Exception as error:
        raise BadRobot(f"{what} failed: {_words(error)}") from error


def _words(error: Exception) -> str:
    """Describe an error in one line, with the line of code that it came from."""
    text = f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
    if isinstance(error, SyntaxError):  # its text names the line
        return text
    frames = traceback.extract_tb(error.__traceback__)
    return f"{text} ({Path(frames[-1].filename).name}, line {frames[-1].lineno})"

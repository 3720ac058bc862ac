"""The flags of --robot.type=lockstep."""

import os
from dataclasses import dataclass

from lerobot.robots.config import RobotConfig

__all__ = ["LockstepRobotConfig", "link_of", "python_of"]


@RobotConfig.register_subclass("lockstep")
@dataclass(kw_only=True)
class LockstepRobotConfig(RobotConfig):
    """A robot behind a Lockstep console."""

    # The link that `lockstep up` or `lockstep invite` printed. LeRobot prints its flags: better set LOCKSTEP_LINK.
    link: str = ""
    # The Python that has Lockstep's client. "": LOCKSTEP_PYTHON
    python: str = ""
    # Take the control seat and drive. False: watch only, while a person drives from the page.
    drive: bool = True
    # `send_action` returns when the robot has executed it. False: at once, and the newest action wins.
    wait: bool = True
    # Receive the robot's cameras.
    pictures: bool = True
    # Largest gap between a state and its pictures, in events.
    tolerance: int = 4
    # How long `get_observation` waits for a state and pictures that belong together, and how old a picture may be.
    observation_timeout_s: float = 2.0
    picture_age_s: float = 0.5
    connect_timeout_s: float = 30.0
    # A certificate to trust instead of the system's, such as a console's own (tls-cert.pem).
    tls_ca: str | None = None


def link_of(given: str) -> str:
    """Return the link.

    Raises:
        ValueError: there is none.
    """
    link = given or os.environ.get("LOCKSTEP_LINK", "")
    if not link:
        raise ValueError("set LOCKSTEP_LINK (or the flag `link`) to the link that the console printed")
    return link


def python_of(given: str) -> str:
    """Return the Python that has Lockstep.

    Raises:
        ValueError: there is none.
    """
    python = given or os.environ.get("LOCKSTEP_PYTHON", "")
    if not python:
        raise ValueError(
            "set LOCKSTEP_PYTHON (or the flag `python`) to the Python that has Lockstep, such as ~/lockstep/bin/python"
        )
    return os.path.expanduser(python)

"""The robot that a console is paired with, in the state directory: readable by its owner alone."""

from typing import NamedTuple

import msgspec

from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.server.util.state_dir import StateDamaged, StateDir

__all__ = ["PairedRobot", "forget_paired", "load_paired", "save_paired"]

FILE = "paired-robot.json"


class PairedRobot(NamedTuple):
    key: LinkSecret
    robot: str  # its own name, "planar"
    by: str  # who paired it
    at: float  # s since 1970, for people


class _Kept(msgspec.Struct, kw_only=True):
    key: str  # "": forgotten
    robot: str = ""
    by: str = ""
    at: float = 0.0


_kept = msgspec.json.Decoder(_Kept)


def load_paired(directory: StateDir) -> PairedRobot | None:
    """Return the robot; None if there is none.

    Raises:
        StateDirUnusable, StateDamaged: it cannot be read, so no robot may come in.
    """
    data = directory.read(FILE)
    if data is None:
        return None
    try:
        kept = _kept.decode(data)
        return PairedRobot(LinkSecret(kept.key), kept.robot, kept.by, kept.at) if kept.key else None
    except (msgspec.MsgspecError, SecretError) as error:
        raise StateDamaged(directory.path / FILE, str(error)) from error


def save_paired(directory: StateDir, paired: PairedRobot) -> None:
    """Raises StateDirUnusable."""
    kept = _Kept(key=paired.key.reveal(), robot=paired.robot, by=paired.by, at=paired.at)
    directory.write(FILE, msgspec.json.encode(kept))


def forget_paired(directory: StateDir) -> None:
    """Raises StateDirUnusable."""
    directory.write(FILE, msgspec.json.encode(_Kept(key="")))

"""Opens the state that outlives a console's run: the signing key, the invitations, and the access they give."""

import tempfile
from pathlib import Path
from typing import NamedTuple

import structlog

from lockstep.robot_bridge.stop.mounts import is_in_memory
from lockstep.server.auth.invitation_store import FILE as INVITATIONS
from lockstep.server.auth.invitation_store import InvitationStore
from lockstep.server.auth.tokens import Access
from lockstep.server.evidence.signer import Signer, evidence_signer
from lockstep.server.settings import Settings
from lockstep.server.util.state_dir import KEY_FILE, StateDamaged, StateDir, StateDirUnusable, default_state_dir

__all__ = ["ConsoleState", "open_state", "robot_directory", "robot_place", "state_path"]

log = structlog.get_logger(__name__)


class ConsoleState(NamedTuple):
    directory: StateDir
    invitations: InvitationStore
    access: Access
    signer: Signer  # of the audit's heads and of recordings
    lasts: bool = True  # False: the state is gone when the console or its machine ends

    def signing_key(self, settings: Settings) -> str:
        """Return the key from which all secrets of this console are derived."""
        return settings.secret.get_secret_value() if settings.secret is not None else self.directory.signing_key()


def state_path(settings: Settings) -> Path:
    return settings.state_dir or default_state_dir()


def robot_directory(settings: Settings, robot: str) -> Path:
    """Return the directory of a robot's audit and recordings. "" is the only robot of a console."""
    return robot_place(state_path(settings), robot)


def robot_place(directory: Path, robot: str) -> Path:
    """Return the `robot_directory` within a state directory."""
    return directory / "robots" / robot if robot else directory


def open_state(settings: Settings, *, fall_back: bool = False) -> ConsoleState:
    """Open the state directory that the settings name.

    Args:
        fall_back: use a temporary one when that cannot be made or written, and holds nothing yet. A directory from
            which links were given is never passed over: another key would refuse all of them

    Raises:
        StateDirUnusable: it cannot be used.
        StateDamaged: its content cannot be understood; that is never passed over.
    """
    path = state_path(settings)
    try:
        return _open(settings, path)
    except StateDamaged:
        raise
    except StateDirUnusable as error:
        if not fall_back or _is_used(path):
            raise
        log.error("the state directory is temporary: links and the audit log end with this console", detail=str(error))
    return _open(settings, Path(tempfile.mkdtemp(prefix="lockstep-")))._replace(lasts=False)


def _is_used(path: Path) -> bool:
    """True if links may have been given from there, or if that cannot be known."""
    try:
        return any((path / name).exists() for name in (KEY_FILE, INVITATIONS))
    except OSError:
        return True


def _open(settings: Settings, path: Path) -> ConsoleState:
    directory = StateDir(path)
    secret = settings.secret.get_secret_value() if settings.secret is not None else directory.signing_key()
    invitations = InvitationStore(directory)
    access = Access(
        secret,
        settings.token_seconds,
        settings.scene_ticket_seconds,
        invitations.is_revoked,
        trouble=lambda: invitations.trouble,
        now=invitations.clock.now,
    )
    return ConsoleState(directory, invitations, access, evidence_signer(directory), not is_in_memory(path))

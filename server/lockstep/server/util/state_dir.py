"""The state directory, which outlives the console: signing key, invitations, audit log. Only its owner can read it."""

import fcntl
import os
import secrets
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lockstep.protocol.files.regular_file import open_regular

__all__ = ["KEY_FILE", "StateDamaged", "StateDir", "StateDirUnusable", "default_state_dir"]

KEY_FILE = "signing.key"
KEY_BYTES = 32  # RFC 7518 3.2: an HS256 key is at least as long as the hash
MAX_LOGS = 64  # consoles that share one directory


class StateDirUnusable(Exception):
    """The state directory cannot be made, read or written.

    Attributes:
        path: the file or directory
        reason: for a person
    """

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(path, reason)
        self.path = path
        self.reason = reason

    def __str__(self) -> str:
        return f"the state directory cannot be used ({self.path}: {self.reason}); set another with LOCKSTEP_STATE_DIR"


class StateDamaged(StateDirUnusable):
    """A file in the state directory is not what it should be; it is unknown which links are good."""


def default_state_dir() -> Path:
    """Return the default path, by the XDG base directory specification."""
    base = os.environ.get("XDG_STATE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path("~/.local/state").expanduser()) / "lockstep"


class StateDir:
    """A state directory, made if it does not exist. Files are replaced in one step: a reader never sees half of one.

    Raises:
        StateDirUnusable: from every method.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _named(path):
            path.mkdir(mode=0o700, parents=True, exist_ok=True)
            _set_mode(path, 0o700)

    def signing_key(self) -> str:
        """Return the signing key. It is made at the first call; two consoles that start at once agree on one."""
        data = self.secret(KEY_FILE, lambda: secrets.token_urlsafe(KEY_BYTES).encode())
        key = data.decode(errors="replace").strip()
        if len(key.encode()) < KEY_BYTES:
            raise StateDamaged(self.path / KEY_FILE, f"not a key of {KEY_BYTES} bytes or more")
        return key

    def secret(self, name: str, fresh: Callable[[], bytes]) -> bytes:
        """Return the content of a file of mode 0600. It is made once: a late process takes what the first one made."""
        path = self.path / name
        with _named(path):
            if not path.exists():
                made = self._temporary(fresh())
                try:
                    with suppress(FileExistsError):
                        os.link(made, path)
                finally:
                    os.unlink(made)
            _set_mode(path, 0o600)
            return _bytes_of(path)

    def read(self, name: str) -> bytes | None:
        """Return the file's content; None if there is no such file."""
        path = self.path / name
        with _named(path):
            try:
                return _bytes_of(path)
            except FileNotFoundError:
                return None

    def write(self, name: str, data: bytes) -> None:
        path = self.path / name
        with _named(path):
            os.replace(self._temporary(data), path)

    def set_aside(self, name: str, size: int) -> None:
        """Reserve a file of `size` bytes, which `overwrite` can fill on a disk that is full by then."""
        if self.version(name) is None:
            self.write(name, bytes(size))

    def overwrite(self, name: str, data: bytes) -> None:
        """Write in place, which takes no room; a crash may leave a part. The reserved file has to be as long."""
        path = self.path / name
        with _named(path):
            handle = os.open(path, os.O_WRONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
            with open(handle, "wb", buffering=0) as file:
                file.write(data)
                os.fsync(handle)

    def version(self, name: str) -> tuple[int, int] | None:
        """Return a value that changes whenever the file is replaced; None if there is no such file."""
        path = self.path / name
        with _named(path):
            try:
                status = path.stat()
            except FileNotFoundError:
                return None
        return status.st_ino, status.st_mtime_ns

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Let one process at a time inside, to read, change and write files."""
        with _named(self.path / "lock"):
            handle = self._lock_file("lock")
            try:
                fcntl.flock(handle, fcntl.LOCK_EX)
            except OSError:
                os.close(handle)
                raise
        try:
            yield
        finally:
            os.close(handle)

    @contextmanager
    def own_log(self, name: str) -> Iterator[Path]:
        """Yield the path of a log that no other process writes: NAME.jsonl, or NAME-2.jsonl, … if that is taken."""
        for number in range(1, MAX_LOGS + 1):
            stem = name if number == 1 else f"{name}-{number}"
            with _named(self.path / f"{stem}.lock"):
                handle = self._lock_file(f"{stem}.lock")
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    os.close(handle)
                    continue
            try:
                yield self.path / f"{stem}.jsonl"
            finally:
                os.close(handle)
            return
        raise StateDirUnusable(self.path, f"{MAX_LOGS} consoles write logs here already")

    def _lock_file(self, name: str) -> int:
        """Open a lock file, made if it does not exist. A symbolic link that somebody else put there is not followed."""
        path, flags = self.path / name, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
        while True:
            try:
                handle = os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o600)
            except FileExistsError:
                with suppress(FileNotFoundError):
                    return os.open(path, flags)
            else:
                self._hand_over(handle)
                return handle

    def _hand_over(self, handle: int) -> None:
        """Give a new file of root's to the directory's owner: a console that does not run as root has to read it."""
        owner = os.stat(self.path)
        if os.geteuid() == 0 and owner.st_uid != 0:
            os.fchown(handle, owner.st_uid, owner.st_gid)

    def _temporary(self, data: bytes) -> str:
        """Write `data` safely to a new file in this directory; return its path."""
        handle, name = tempfile.mkstemp(dir=self.path, prefix=".new-")  # mode 0600
        try:
            with open(handle, "wb") as file:
                self._hand_over(file.fileno())
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except OSError:
            os.unlink(name)
            raise
        return name


def _bytes_of(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read()


def _set_mode(path: Path, mode: int) -> None:
    """Set the mode unless it is set already: evidence is also read on a disk that cannot be written."""
    if stat.S_IMODE(path.stat().st_mode) != mode:
        path.chmod(mode)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StateDirUnusable(path, error.strerror or str(error)) from error

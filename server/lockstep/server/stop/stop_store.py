"""Stops on the console's disk: one file for each press that the robot could not be told of. Blocks; not for the loop.

A press is written before anybody is told that it is kept, and its file is deleted when the robot has answered it. A
file that cannot be read is a stop too: its sender meant it.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path

import msgspec
import structlog

from lockstep.server.stop.stop_presses import MAX_GIVEN, Press, press_id

__all__ = ["KeptStops", "kept_stops_place"]

log = structlog.get_logger(__name__)

FOLDER = "kept-stops"
SUFFIX = ".json"
MAX_BYTES = 16 * 1024  # of one file; a press has less than 4 kB
_decoder = msgspec.json.Decoder(Press)
UNREADABLE = "a stop kept by this console, whose file cannot be read"


def kept_stops_place(directory: Path, robot: str) -> Path:
    """Return the directory of stops for the robot at this address: consoles for two robots may share `directory`."""
    return directory / FOLDER / hashlib.sha256(robot.encode()).hexdigest()[:16]


class KeptStops:
    """The files of kept stops. Every method but `load` may raise OSError."""

    def __init__(self, place: Path) -> None:
        self._place = place

    def load(self) -> list[Press]:
        """Return all kept presses, oldest first."""
        try:
            paths = sorted(path for path in self._place.iterdir() if path.suffix == SUFFIX)
        except FileNotFoundError:
            return []
        except OSError as error:
            log.error("the kept stops cannot be read", error="kept_stops_unreadable", detail=str(error))
            return [Press(id=hashlib.sha256(str(self._place).encode()).hexdigest()[:32], reason=UNREADABLE)]
        return sorted((self._read(path) for path in paths), key=lambda press: press.time)

    def keep(self, press: Press) -> None:
        """Write a press; when this returns, it survives even a power cut."""
        self._place.mkdir(mode=0o700, parents=True, exist_ok=True)
        path = self._path(press.id)
        fresh = path.with_suffix(".new")
        handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
        with open(handle, "wb") as file:
            file.write(msgspec.json.encode(press))
            file.flush()
            os.fsync(file.fileno())
        os.replace(fresh, path)
        _sync(self._place)
        _sync(self._place.parent)

    def drop(self, press: str) -> None:
        """Delete an answered press. If its file comes back after a power cut, it repeats one that the bridge knows."""
        self._path(press).unlink(missing_ok=True)

    def _read(self, path: Path) -> Press:
        try:
            with path.open("rb") as file:
                press = _decoder.decode(file.read(MAX_BYTES))
            if self._path(press.id) == path and len(press.id) <= MAX_GIVEN:  # a bridge's own may be any text
                return press
        except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            log.error("a kept stop cannot be read", error="kept_stop_unreadable", path=path.name, detail=str(error))
        with suppress(OSError):  # so that the next start finds and reports it too
            os.replace(path, self._path(press_id("", path.stem)))
        return Press(id=press_id("", path.stem), reason=UNREADABLE)

    def _path(self, press: str) -> Path:
        """Return the path of a press. Ids come from anybody, so they are hashed."""
        return self._place / (hashlib.sha256(press.encode()).hexdigest()[:32] + SUFFIX)


def _sync(directory: Path) -> None:
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)

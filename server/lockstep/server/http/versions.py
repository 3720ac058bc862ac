"""Versions of a session's software and robot description, for the audit."""

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.server.http.static_files import WEB_DIST

__all__ = ["console_version", "description_hash", "page_build"]


@cache
def console_version() -> str:
    """Return the version of the installed package; "unknown" if it is not installed."""
    try:
        return version("lockstep-console")
    except PackageNotFoundError:
        return "unknown"


def page_build(directory: Path = WEB_DIST) -> str:
    """SHA-256 of the page's first file, which names all others by their hashes; "none" if no page is built."""
    try:
        return hashlib.sha256((directory / "index.html").read_bytes()).hexdigest()
    except OSError:
        return "none"


def description_hash(description: RobotDescription) -> str:
    """SHA-256 of the description as JSON with sorted keys, in hexadecimal digits."""
    return hashlib.sha256(msgspec.json.encode(description, order="deterministic")).hexdigest()

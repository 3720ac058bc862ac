"""Gives threads a name in the kernel, for `top -H`, `ps -L` and measurements of their processor time."""

import threading
from contextlib import suppress
from pathlib import Path

__all__ = ["name_thread"]

LONGEST = 15  # bytes that the kernel keeps (proc(5), /proc/pid/task/tid/comm)


def name_thread(name: str) -> None:
    """Name the calling thread on systems with a /proc. Python itself does so only from 3.14 on."""
    with suppress(OSError):
        Path(f"/proc/self/task/{threading.get_native_id()}/comm").write_bytes(name.encode()[:LONGEST])

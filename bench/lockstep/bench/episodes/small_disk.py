"""A disk that is soon full."""

import asyncio
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["cancel_on_sigterm", "small_disk"]


def cancel_on_sigterm() -> None:
    """Let SIGTERM cancel the present task, so that a terminated run leaves no mounted disk either."""
    task = asyncio.current_task()
    if task is not None:
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[None]:
    """Mount a tmpfs of so many bytes on a folder. Needs the right to mount.

    Raises:
        CalledProcessError: it could not be mounted.
    """
    subprocess.run(("mount", "-t", "tmpfs", "-o", f"size={size}", "lockstep-bench", str(folder)), check=True)
    try:
        yield
    finally:
        subprocess.run(("umount", "-l", str(folder)), check=True)

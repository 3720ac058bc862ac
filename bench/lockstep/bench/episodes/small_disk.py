"""A disk that is soon full."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["small_disk"]


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

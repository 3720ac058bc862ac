"""Tells whether a directory is on a disk or in memory."""

import os
from pathlib import Path

__all__ = ["is_in_memory"]

MOUNTS = Path("/proc/self/mountinfo")  # proc_pid_mountinfo(5)
IN_MEMORY = ("tmpfs", "ramfs")


def is_in_memory(directory: Path, mounts: Path = MOUNTS) -> bool:
    """Return whether the directory's files are lost when the machine is switched off; False if that is unknown."""
    try:
        device = os.stat(directory).st_dev
        lines = mounts.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return False
    wanted = f"{os.major(device)}:{os.minor(device)}"
    for line in lines:
        place, _, kind = line.partition(" - ")
        if place.split()[2:3] == [wanted]:
            return kind.partition(" ")[0] in IN_MEMORY
    return False

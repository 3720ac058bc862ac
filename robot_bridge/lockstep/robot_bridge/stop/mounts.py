"""What kind of place a directory is in."""

import os
from pathlib import Path

__all__ = ["is_in_memory"]

MOUNTS = Path("/proc/self/mountinfo")  # proc_pid_mountinfo(5)
IN_MEMORY = ("tmpfs", "ramfs")


def is_in_memory(directory: Path, mounts: Path = MOUNTS) -> bool:
    """Whether its files are gone when the machine is switched off. False also where the system does not tell."""
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

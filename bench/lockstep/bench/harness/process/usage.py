"""The processor time and the memory of a process, as Linux accounts them."""

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["ProcessUsage"]

TICKS = os.sysconf("SC_CLK_TCK")
PAGE = os.sysconf("SC_PAGE_SIZE")  # bytes


class ProcessUsage:
    """The usage of one process. All methods raise OSError when it has ended."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._folder = Path(f"/proc/{pid}")

    def cpu_seconds(self) -> float:
        """Return the processor time used so far, all threads, user and system (proc(5), fields 14 and 15)."""
        fields = (self._folder / "stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    def thread_seconds(self) -> dict[str, float]:
        """Return the same by name of threads, without ended threads; the main thread is called "main".

        From the scheduler's own account, which is finer than the ticks in `stat`.
        """
        found: dict[str, float] = {}
        for task in (self._folder / "task").iterdir():
            with suppress(OSError):  # it has just ended
                nanoseconds = int((task / "schedstat").read_text().split()[0])
                name = "main" if task.name == str(self._pid) else (task / "comm").read_text().strip()
                found[name] = found.get(name, 0.0) + nanoseconds / 1e9
        return found

    def resident_bytes(self) -> int:
        """Return its memory in use (proc(5), statm field 2)."""
        return int((self._folder / "statm").read_text().split()[1]) * PAGE

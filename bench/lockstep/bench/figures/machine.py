"""Describes the machine of the measurements."""

import asyncio
import os
import platform
import shutil
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

__all__ = ["busy_percent", "machine_facts"]

PACKAGES = ("lockstep-console", "aiortc", "av", "fastapi", "mujoco", "uvloop", "playwright")


def machine_facts() -> dict[str, Any]:
    """Return cores, processor, memory and versions."""
    return {
        "cores": os.cpu_count(),
        "cpu": _cpu_model(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "chromium": _chromium_version(),
        "packages": _versions(PACKAGES),
    }


async def busy_percent(seconds: float) -> float:
    """Return the used share of the machine's processor time, in %, while this process waits (proc(5), /proc/stat)."""
    total, idle = _processor_time()
    await asyncio.sleep(seconds)
    later, later_idle = _processor_time()
    return 100 * (1 - (later_idle - idle) / (later - total))


def _processor_time() -> tuple[int, int]:
    """Return the ticks since boot: all of them, and those that were idle or waited for a disk."""
    first, _, _ = Path("/proc/stat").read_text().partition("\n")
    fields = [int(field) for field in first.split()[1:9]]  # guests are counted in the user time already
    return sum(fields), fields[3] + fields[4]


def _cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _chromium_version() -> str | None:
    executable = shutil.which("chromium") or shutil.which("google-chrome")
    if executable is None:
        return None
    found = subprocess.run([executable, "--version"], capture_output=True, text=True, timeout=30, check=False)
    return found.stdout.strip() or None


def _versions(packages: Iterable[str]) -> dict[str, str]:
    """Those that are installed: an experiment without a browser needs no package that drives one."""
    found = {}
    for name in packages:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found

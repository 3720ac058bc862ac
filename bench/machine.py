"""What the figures were measured on."""

import os
import platform
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path
from typing import Any

__all__ = ["machine_facts"]

PACKAGES = ("lockstep", "aiortc", "av", "fastapi", "mujoco", "uvloop", "playwright")


def machine_facts() -> dict[str, Any]:
    """Cores, processor, memory, versions, and how busy the machine is."""
    return {
        "cores": os.cpu_count(),
        "cpu": _cpu_model(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "chromium": _chromium_version(),
        "packages": {name: version(name) for name in PACKAGES},
        "load_average": os.getloadavg()[0],
    }


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

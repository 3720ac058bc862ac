"""Build a wheel of every part and of LeRobot's plugins: `python -m scripts.build_wheels FOLDER`.

Licence and notices are inside of each.
"""

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parent.parent
PARTS = ("protocol", "rtc", "robot_bridge", "client", "server", ".")
PLUGINS = ("lerobot_plugins/lerobot_robot_lockstep", "lerobot_plugins/lerobot_teleoperator_lockstep")
WHEELS = ("lockstep_*.whl", "lerobot_*_lockstep-*.whl")
PAGE = ROOT / "server" / "lockstep" / "server" / "web_dist" / "index.html"


def build(part: str, into: Path) -> None:
    """Raises CalledProcessError."""
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "part"  # building leaves files behind
        source = ROOT / part
        if part == ".":
            shutil.copytree(ROOT / "bench", copy / "bench", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
            shutil.copy(ROOT / "pyproject.toml", copy)
            shutil.copy(ROOT / "README.md", copy)
        else:
            shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "build"))
        for text in ("LICENSE", "NOTICE"):
            shutil.copy(ROOT / text, copy)
        pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "-q")
        subprocess.run([*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", str(into), str(copy)], check=True)


def _wheels(folder: Path) -> list[Path]:
    return sorted(wheel for pattern in WHEELS for wheel in folder.glob(pattern))


def main(arguments: list[str]) -> int:
    if len(arguments) != 1:
        print("usage: python -m scripts.build_wheels FOLDER", file=sys.stderr)
        return 2
    if not PAGE.is_file():
        print("the page is not built: make page", file=sys.stderr)
        return 1
    into = Path(arguments[0]).resolve()
    into.mkdir(parents=True, exist_ok=True)
    for old in _wheels(into):
        old.unlink()
    for part in (*PARTS, *PLUGINS):
        build(part, into)
    for wheel in _wheels(into):
        print(wheel.name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Build a wheel of every part, with licence and notices inside: `python -m scripts.build_wheels FOLDER`."""

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parent.parent
PARTS = ("protocol", "rtc", "robot_bridge", "client", "server", ".")
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


def main(arguments: list[str]) -> int:
    if len(arguments) != 1:
        print("usage: python -m scripts.build_wheels FOLDER", file=sys.stderr)
        return 2
    if not PAGE.is_file():
        print("the page is not built: make page", file=sys.stderr)
        return 1
    into = Path(arguments[0]).resolve()
    into.mkdir(parents=True, exist_ok=True)
    for old in into.glob("lockstep_*.whl"):
        old.unlink()
    for part in PARTS:
        build(part, into)
    for wheel in sorted(into.glob("lockstep_*.whl")):
        print(wheel.name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

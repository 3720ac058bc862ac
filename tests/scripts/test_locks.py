"""The lock files: what is installed from them is what they name, whatever was released since."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
INSTALLERS = (ROOT / "Makefile", ROOT / "Dockerfile", ROOT / "README.md", *(ROOT / "docs").rglob("*.md"))
PINNED = r"[a-z0-9._-]+==\S+.*--hash=sha256:[0-9a-f]{64}"


def test_nothing_is_resolved_where_a_lock_file_is_installed() -> None:
    lines = [line.strip() for file in INSTALLERS for line in file.read_text().splitlines()]
    installs = [line for line in lines if "--require-hashes" in line]
    assert len(installs) >= 3
    assert [line for line in installs if "--no-deps" not in line] == []


@pytest.mark.parametrize("name", [f"requirements{kind}.lock" for kind in ("", "-dev", "-docs", "-ros2")])
def test_every_line_of_a_lock_file_is_one_version_with_hashes(name: str) -> None:
    text = re.sub(r"(?m)^\s*#.*$", "", (ROOT / name).read_text()).replace("\\\n", " ")
    requirements = [line for line in text.splitlines() if line.strip()]
    assert len(requirements) > 10
    assert [line[:60] for line in requirements if not re.match(PINNED, line)] == []

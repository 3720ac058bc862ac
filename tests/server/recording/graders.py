"""Programs that others wrote to judge datasets."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

__all__ = ["doctor_counts", "graded_defects"]


def doctor_counts(root: Path) -> dict[str, int]:
    """How many checks of `lerobot-doctor` PASS, WARN and FAIL."""
    summary: dict[str, int] = _answer("lerobot-doctor", "check", str(root), "--json")["summary"]
    return summary


def graded_defects(root: Path) -> dict[str, tuple[int, int]]:
    """What `deepen grade` looked at, and how much of it is defective, by the name of its check."""
    classes = _answer("deepen", "grade", str(root), "--json")["defect_classes"]
    return {name: (each["gradable"], each["defective"]) for name, each in classes.items()}


def _answer(program: str, *words: str) -> Any:
    command = [str(Path(sys.executable).with_name(program)), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.stdout, done.stderr
    return json.loads(done.stdout)

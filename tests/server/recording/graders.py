"""Programs that others wrote to judge datasets."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

__all__ = ["PASSED", "doctor_counts", "doctor_findings", "graded_defects"]

# What lerobot-doctor warns of in short episodes in which an arm stands still and turns back. LeRobot gives text columns
# no statistics.
WARNS_OF = (
    *("zero variance", "zero std", "constant", "sudden large action jumps", "action jump", "flagged"),
    *("consecutive identical", "frozen actions", "extreme outlier"),
    *("shorter than", "too short", "not in stats.json: ['lockstep.driver', 'lockstep.driver_kind']"),
)
PASSED = {
    *("Metadata & Format Compliance", "Temporal Consistency", "Video Integrity"),
    *("Feature Consistency", "Portability"),
}


def doctor_counts(root: Path) -> dict[str, int]:
    """How many checks of `lerobot-doctor` PASS, WARN and FAIL."""
    summary: dict[str, int] = _answer("lerobot-doctor", "check", str(root), "--json")["summary"]
    return summary


def doctor_findings(root: Path) -> tuple[set[str], list[str]]:
    """Which checks of `lerobot-doctor` pass, and what else it says that is not one of `WARNS_OF`."""
    checks: list[dict[str, Any]] = _answer("lerobot-doctor", "check", str(root), "--json")["checks"]
    said = [each for check in checks for each in check["messages"] if each["severity"] != "PASS"]
    more = [
        f"{each['severity']} {each['message']}"
        for each in said
        if each["severity"] != "WARN" or not any(words in each["message"] for words in WARNS_OF)
    ]
    return {check["name"] for check in checks if check["severity"] == "PASS"}, more


def graded_defects(root: Path) -> dict[str, tuple[int, int]]:
    """What `deepen grade` looked at, and how much of it is defective, by the name of its check."""
    classes = _answer("deepen", "grade", str(root), "--json")["defect_classes"]
    return {name: (each["gradable"], each["defective"]) for name, each in classes.items()}


def _answer(program: str, *words: str) -> Any:
    command = [str(Path(sys.executable).with_name(program)), *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.stdout, done.stderr
    return json.loads(done.stdout)

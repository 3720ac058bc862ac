"""The look-up of locked packages in advisory databases, with pip-audit and npm played."""

import json
from typing import Any

import pytest

from scripts import audit

FINE: dict[str, Any] = {"dependencies": [{"name": "numpy", "version": "2", "vulns": []}]}


class Advisories:
    """Answers of pip-audit by lock file."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.answers: dict[str, dict[str, Any]] = {}

    def run(self, *command: str) -> str:
        if command[0] == "npm":
            return json.dumps({"vulnerabilities": {}})
        self.asked.append(command[-1])
        return json.dumps(self.answers.get(command[-1], FINE))


@pytest.fixture
def advisories(monkeypatch: pytest.MonkeyPatch) -> Advisories:
    played = Advisories()
    monkeypatch.setattr(audit, "_run", played.run)
    return played


def test_every_lock_file_is_looked_up(advisories: Advisories) -> None:
    assert audit.main([]) == 0
    assert "requirements-lerobot.lock" in advisories.asked
    assert advisories.asked == list(audit.LOCKS)


def test_a_vulnerable_package_of_lerobots_environment_fails_and_its_lock_file_is_named(
    advisories: Advisories, capsys: pytest.CaptureFixture[str]
) -> None:
    vulnerable = {"name": "torch", "version": "1", "vulns": [{"id": "PYSEC-1"}]}
    advisories.answers["requirements-lerobot.lock"] = {"dependencies": [vulnerable]}
    assert audit.main([]) == 1
    assert "torch PYSEC-1 (requirements-lerobot.lock)" in capsys.readouterr().err


def test_what_could_not_be_looked_up_is_said_and_fails_only_where_it_must_not_be_missing(
    advisories: Advisories, capsys: pytest.CaptureFixture[str]
) -> None:
    skipped = {"name": "lockstep", "skip_reason": "no such package"}
    advisories.answers["requirements-ros2.lock"] = {"dependencies": [skipped]}
    assert audit.main([]) == 0
    assert "1 of the Python packages in requirements-ros2.lock" in capsys.readouterr().err
    assert audit.main(["--strict"]) == 1

"""docs/security.md names only what exists, and every setting of the limits with its true default."""

import re
from pathlib import Path

import pytest

from lockstep.server.http.limit_settings import LimitSettings
from lockstep.server.settings import Settings
from scripts.audit import LOCKS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "security.md").read_text()
NAMED = sorted(set(re.findall(r"`(tests/[\w/.]+)::(\w+)`", TEXT)))
LIMITS = TEXT.split("## Limits")[1].split("\n## ")[0]


def test_every_threat_has_a_measure_and_a_test() -> None:
    table = TEXT.split("## Threats")[1].strip().split("\n\n")[0]  # another one, of measurements, follows it
    rows = re.findall(r"^\| (.+) \| (.+) \| (.+) \|$", table, re.MULTILINE)
    assert len(rows) > 20
    for threat, measure, tests in rows[1:]:
        assert measure
        assert "::" in tests, threat


@pytest.mark.parametrize(("path", "name"), NAMED, ids=lambda value: str(value))
def test_every_test_that_is_named_exists(path: str, name: str) -> None:
    assert re.search(rf"^(?:async )?def {name}\(", (ROOT / path).read_text(), re.MULTILINE)


def test_every_limit_is_in_the_table_with_its_default() -> None:
    for name in LimitSettings.model_fields:
        row = next((line for line in LIMITS.splitlines() if f"`{name.upper()}`" in line), None)
        assert row is not None, name
        default = Settings.model_fields[name].default
        assert re.search(rf"\b{default:g}\b", row.split("|")[2]), f"{name} is {default:g}"


def test_the_check_looks_up_every_locked_package() -> None:
    recipe = re.search(r"^check:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert recipe is not None
    assert "scripts.audit" in recipe[1]
    packages = {path.name: set(_packages(path)) for path in ROOT.glob("requirements*.lock")}
    assert set(LOCKS) <= packages.keys()
    looked_up = set().union(*(_pins(packages[lock]) for lock in LOCKS))
    for name, parts in packages.items():
        assert all("--hash=" in part for part in parts), name
        assert _pins(parts) <= looked_up, name


def _pins(parts: set[str]) -> set[str]:
    return {part.split(" ")[0] for part in parts}


def _packages(lock: Path) -> list[str]:
    """The text of each package: it begins at the start of a line, what belongs to it is indented."""
    return re.findall(r"^[a-zA-Z0-9][^\n]*(?:\n[ \t][^\n]*)*", lock.read_text(), re.MULTILINE)

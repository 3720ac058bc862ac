"""docs/safety.md names only what exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "safety.md").read_text()
NAMED = sorted(set(re.findall(r"`((?:tests|web/test)/[\w/.]+)::([^`]+)`", TEXT)))
PLACES = sorted(
    {
        place
        for row in re.findall(r"^\|(?:[^|]*\|){2}([^|]*)\|[^|]*\|$", TEXT, re.MULTILINE)
        for place in re.findall(r"`([\w/]+\.(?:py|ts))`", row)
        if "/" in place
    }
)


def test_the_table_names_tests_and_places() -> None:
    assert len(NAMED) > 40
    assert len(PLACES) > 15


@pytest.mark.parametrize(("path", "name"), NAMED, ids=lambda value: str(value))
def test_every_test_that_is_named_exists(path: str, name: str) -> None:
    text = (ROOT / path).read_text()
    if path.endswith(".py"):
        assert re.search(rf"^(?:async )?def {re.escape(name)}\(", text, re.MULTILINE)
    else:
        assert f'it("{name}"' in text


@pytest.mark.parametrize("place", PLACES)
def test_every_place_that_is_named_exists(place: str) -> None:
    assert (ROOT / place).exists()


def test_every_one_of_the_twelve_points_has_a_test() -> None:
    section = TEXT.split("## The twelve points")[1].split("\n## ")[0]
    points = re.findall(r"^\| (\d+) [^|]+\| `", section, re.MULTILINE)
    assert points == [str(number) for number in range(1, 13)]


def test_every_test_of_the_twelve_points_is_named() -> None:
    tests = re.findall(
        r"^(?:async )?def (test_point_\w+)", (ROOT / "tests/safety/test_twelve_points.py").read_text(), re.M
    )
    assert {name for name in tests if "point_11" not in name} <= {name for _, name in NAMED}

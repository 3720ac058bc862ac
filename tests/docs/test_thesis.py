"""Every part of the thesis is in docs/thesis.md, and every file that stands there exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "thesis.md").read_text()
SECTIONS = ["1.1", "1.2", "1.3", "1.4", *(f"2.{n}" for n in range(1, 6)), *(f"3.{n}" for n in range(1, 5))]
SECTIONS += [f"4.{n}" for n in range(1, 4)] + [f"4.{n}.{m}" for n in range(1, 4) for m in range(1, 4)] + ["5.1", "5.2"]
FIGURES = [*(f"2.{n}" for n in range(1, 6)), *(f"3.{n}" for n in range(1, 4)), *(f"4.{n}" for n in range(1, 34))]
TABLES = [f"4.{n}" for n in range(1, 10)]


def named(word: str) -> set[str]:
    """The numbers that follow "figure", "figures", "table" or "tables", up to what is no number any more."""
    runs = re.findall(rf"\b{word}s? ((?:\d\.\d+(?:\s\([^)]*\))?(?:,? and |, )?)+)", TEXT)
    return {number for run in runs for number in re.findall(r"\d\.\d+", re.sub(r"\([^)]*\)", "", run))}


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`([a-z_]+/[\w./-]+)`", TEXT))))
def test_every_path_that_is_named_exists(path: str) -> None:
    assert (ROOT / path).exists()


def test_every_section_figure_and_table_is_named() -> None:
    for section in SECTIONS:
        assert re.search(rf"(?:^\| |; |\b){re.escape(section)}\b", TEXT, re.MULTILINE), section
    assert set(FIGURES) <= named("figure"), set(FIGURES) - named("figure")
    assert set(TABLES) <= named("table"), set(TABLES) - named("table")
    for what in ("theorem 1", "definition 1", "Future work"):
        assert what in TEXT


def rows() -> list[tuple[str, str]]:
    """Part, and where it is in Lockstep."""
    cells = [line.strip("|").split(" | ") for line in TEXT.splitlines() if line.startswith("| ")]
    return [(part.strip(), where.strip()) for part, where in cells if part.strip() not in ("part", "section")]


@pytest.mark.parametrize(("part", "where"), rows(), ids=lambda text: text[:30])
def test_every_row_names_a_test_or_another_row(part: str, where: str) -> None:
    elsewhere = ("this page", "as for 4.1", "as for 4.1.1", "as table 4.1", "as above")
    assert re.search(r"`(?:tests/|web/test/)[\w/.]+`", where) or any(each in where for each in elsewhere), part


def test_nothing_that_is_there_is_said_not_to_be_built() -> None:
    assert "not built yet" not in TEXT
    assert "are not built |" not in TEXT

"""docs/performance.md shows figures of the runs in bench/history, and those files have the documented shape."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from lockstep.bench.cli import SECTIONS
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.table import render_markdown

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "performance.md").read_text()
HISTORY = ROOT / "bench" / "history"
RUNS = sorted(path.stem for path in HISTORY.glob("2*.json"))
RESULT_KEYS = ("section", "name", "value", "unit", "target", "bound", "baseline")
MACHINE_KEYS = {"cores", "cpu", "memory_gib", "system", "python", "chromium", "packages"}


def run(name: str) -> dict[str, Any]:
    return json.loads((HISTORY / f"{name}.json").read_text())  # type: ignore[no-any-return]


def results(name: str) -> list[Result]:
    return [Result(**{key: row[key] for key in RESULT_KEYS if key in row}) for row in run(name)["results"]]


def rows(section: str) -> list[list[str]]:
    """The cells of a section's table, without its head."""
    text = re.split(r"\n#{2,4} ", TEXT.split(f"\n### {section}\n")[1])[0]
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line] for line in lines][1:]


SHOWN = [(section, row) for section in SECTIONS for row in rows(section)]


@pytest.mark.parametrize("name", RUNS)
def test_a_run_names_its_day_its_machine_and_only_sections_that_exist(name: str) -> None:
    kept = run(name)
    assert re.fullmatch(r"20\d\d-\d\d-\d\d-[0-9a-f]{7,}(-\w+)?", name)
    assert kept["at"][:10] == name[:10]
    assert kept["machine"].keys() >= MACHINE_KEYS
    assert kept["quick"] is False
    assert {result.section for result in results(name)} <= set(SECTIONS)
    assert all(result.value is None or result.value >= 0 for result in results(name))


@pytest.mark.parametrize("path", sorted(HISTORY.glob("*/*")), ids=lambda path: path.stem)
def test_a_run_beside_the_benchmark_names_its_day_its_command_and_its_machine(path: Path) -> None:
    kept = json.loads(path.read_text())
    assert re.fullmatch(r"20\d\d-\d\d-\d\d-[0-9a-f]{7,}-[\w-]+\.json", path.name)
    assert kept["at"][:10] == path.name[:10]
    assert kept["command"].startswith("python -m lockstep.bench.")
    assert not re.search("[ =]/", kept["command"]), "a path of one machine"
    assert kept["machine"].keys() >= MACHINE_KEYS
    # In `arms` counts what was put where, and which event each picture shows, whatever else the machine does.
    assert kept["busy_percent"] <= 8 or path.parent.name == "arms", "too much else went on to keep the figures"
    assert kept["runs"]


@pytest.mark.parametrize(("section", "row"), SHOWN, ids=lambda part: part if isinstance(part, str) else part[0])
def test_a_figure_of_the_page_is_that_of_its_run(section: str, row: list[str]) -> None:
    *shown, _ratio, name = row
    of_the_run = [
        [cell.strip() for cell in line.strip("|").split("|")][:-1]
        for line in render_markdown([each for each in results(name) if each.section == section]).splitlines()
        if line.startswith("| ")
    ]
    assert shown in of_the_run


def test_every_run_on_file_is_in_the_table_of_runs() -> None:
    named = re.findall(r"^\| (20[\w-]+) \|", TEXT, re.MULTILINE)
    assert sorted(named) == RUNS


def test_every_section_with_a_run_on_file_has_a_table() -> None:
    measured = {result.section for name in RUNS for result in results(name)}
    assert {section for section, _ in SHOWN} == measured


def test_series_and_changes_name_only_sections_that_exist() -> None:
    series = json.loads((HISTORY / "series.json").read_text())["series"]
    changes = json.loads((HISTORY / "changes.json").read_text())["changes"]
    assert {each["section"] for each in series + changes} <= set(SECTIONS)
    assert all(isinstance(each["value"], int | float) for figure in series for each in figure["runs"])
    assert all(change["change"] and change["before"] and change["after"] for change in changes)

"""docs/safety.md names only what exists, and no hazard there is without a test or the reason for having none."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "safety.md").read_text()
COLUMNS = ["no.", "hazard", "before", "measure", "after", "left over, and what the hardware must bring"]
NAMED_TEST = re.compile(r"`((?:tests|web/test)/[\w/.]+)::([^`]+)`")
PLACE = re.compile(r"`((?:\w+/)*[\w.]+\.(?:py|ts|lock|md))`")
REASON = re.compile(r"no test: (\S.{25,})", re.DOTALL)
RISK = re.compile(r"S[12] F[12] P[12]")
MEASURE = re.compile(r"none\b|\*\*[DGI]\*\* ")


class Hazard(NamedTuple):
    """One row of a table of hazards."""

    number: str
    name: str
    before: str
    measure: str
    after: str
    left: str


class Evidence(NamedTuple):
    """What stands below the table for one row: where its measures are, and what shows them."""

    number: str
    text: str

    @property
    def tests(self) -> list[tuple[str, str]]:
        return NAMED_TEST.findall(self.text)

    @property
    def places(self) -> list[str]:
        return PLACE.findall(self.text)


def section(text: str, title: str) -> str:
    return text.split(f"\n## {title}\n")[1].split("\n## ")[0]


def cells(row: str) -> list[str]:
    return [cell.strip() for cell in row.strip().strip("|").split("|")]


def groups(text: str) -> list[str]:
    return re.split(r"^### ", section(text, "Hazards"), flags=re.MULTILINE)[1:]


def rows_of(group: str) -> list[list[str]]:
    return [cells(row) for row in re.findall(r"^\| \d.*$", group, re.MULTILINE)]


def hazards(group: str) -> list[Hazard]:
    return [Hazard(*row) for row in rows_of(group) if len(row) == len(COLUMNS)]


def evidence(group: str) -> list[Evidence]:
    entries = re.findall(r"^- \*\*(\d+\.\d+)\*\* (.+?)(?=^- |^$|\Z)", group, re.MULTILINE | re.DOTALL)
    return [Evidence(*entry) for entry in entries]


def exists(path: str, name: str) -> bool:
    if not (ROOT / path).is_file():
        return False
    text = (ROOT / path).read_text()
    if path.endswith(".py"):
        return re.search(rf"^((async )?def {re.escape(name)}\(|{re.escape(name)} = )", text, re.MULTILINE) is not None
    return f'it("{name}"' in text or f'test("{name}"' in text


def flaws_of_rows(group: str) -> Iterator[str]:
    number = group.split(".")[0]
    headers = re.findall(r"^\| no\..*$", group, re.MULTILINE)
    if [cells(header) for header in headers] != [COLUMNS]:
        yield f"group {number}: not one table with the columns {COLUMNS}"
    yield from (f"{row[0]}: not {len(COLUMNS)} cells" for row in rows_of(group) if len(row) != len(COLUMNS))
    rows = hazards(group)
    if [row.number for row in rows] != [f"{number}.{n}" for n in range(1, len(rows) + 1)] or not rows:
        yield f"group {number}: its rows are not numbered {number}.1 and so on"
    for row in rows:
        if not (row.name and RISK.fullmatch(row.before) and RISK.fullmatch(row.after)):
            yield f"{row.number}: no risk before and after"
        elif any(after > before for before, after in zip(row.before.split(), row.after.split(), strict=True)):
            yield f"{row.number}: the risk is greater after than before"
        if not MEASURE.match(row.measure):
            yield f"{row.number}: neither a measure of a kind nor none"
        if not row.left:
            yield f"{row.number}: nothing is said of what is left over"
        if row.measure.startswith("none") and row.after != row.before:
            yield f"{row.number}: a smaller risk without a measure"


def flaws_of_evidence(group: str) -> Iterator[str]:
    rows, entries = {row.number: row for row in hazards(group)}, evidence(group)
    if sorted(rows) != sorted(entry.number for entry in entries):
        yield f"{sorted(rows)} and {sorted(entry.number for entry in entries)} are not the same rows"
    for entry in entries:
        row = rows.get(entry.number)
        if not entry.tests and not REASON.search(entry.text):
            yield f"{entry.number}: neither a test nor `no test:` with a reason"
        if row is not None and not row.measure.startswith("none") and not (entry.places or REASON.search(entry.text)):
            yield f"{entry.number}: a measure without a file that keeps it"
        yield from (f"{entry.number}: no test {path}::{name}" for path, name in entry.tests if not exists(path, name))
        yield from (f"{entry.number}: no file {place}" for place in entry.places if not (ROOT / place).is_file())


def flaws(text: str) -> list[str]:
    return [flaw for group in groups(text) for check in (flaws_of_rows, flaws_of_evidence) for flaw in check(group)]


def test_every_hazard_has_a_risk_a_measure_a_place_and_a_test_or_the_reason_for_none() -> None:
    assert flaws(TEXT) == []


def test_all_groups_and_rows_are_read() -> None:
    found = groups(TEXT)
    assert [group.split(".")[0] for group in found] == [str(number) for number in range(1, len(found) + 1)]
    assert len(found) >= 10
    assert sum(len(hazards(group)) for group in found) >= 75
    assert sum(len(entry.tests) for group in found for entry in evidence(group)) > 100


@pytest.mark.parametrize(
    ("there", "instead", "flaw"),
    [
        (r"(- \*\*1\.1\*\* .*\n)(?:  `.*\n)+", r"\1", "1.1: neither a test nor"),
        (r"- \*\*4\.6\*\* no test: .*\n(?:  .*\n)*", "- **4.6** no test: none\n", "4.6: neither a test nor"),
        (r"- \*\*2\.3\*\* .*\n(?:  .*\n)+", "", "are not the same rows"),
        (r"::test_point_02_one_zero_at_release_then_silence", "::test_that_is_not", "8.8: no test tests/safety/"),
        (
            r"`web/test/drive/input_activity\.test\.ts::disarms",
            "`web/test/drive/x.test.ts::arms",
            "8.1: no test web/test/",
        ),
        (r"- \*\*3\.7\*\* `[a-z/]+silenced_links", "- **3.7** `server/silent", "3.7: no file server/silent.py"),
        (r"- \*\*5\.4\*\* `.*\n", "- **5.4** code\n", "5.4: a measure without a file"),
        (r"(\| 6\.2 \|[^|]*\|[^|]*\|[^|]*\|)[^|]*\|", r"\1 S2 F1 P1 |", "6.2: a smaller risk without a measure"),
        (r"(\| 7\.1 \|[^|]*\|)[^|]*\|", r"\1 |", "7.1: no risk before and after"),
        (r"(\| 8\.10 \|[^|]*\|[^|]*\|[^|]*\|)[^|]*\|", r"\1 S2 F1 P1 |", "8.10: the risk is greater after"),
        (r"(\| 9\.1 \|[^|]*\|[^|]*\|)[^|]*\|", r"\1 links |", "9.1: neither a measure of a kind nor none"),
        (r"(\| 5\.4 \|.*\|) as 5\.1 \|", r"\1 |", "5.4: nothing is said of what is left"),
        (r"(\| 6\.7 \|.*\|)[^|]*\|\n", r"\1\n", "6.7: not 6 cells"),
        (r"\| 10\.5 \|", "| 10.7 |", "group 10: its rows are not numbered"),
    ],
)
def test_a_row_that_lacks_something_is_named(there: str, instead: str, flaw: str) -> None:
    changed, count = re.subn(there, instead, TEXT)
    assert count > 0
    assert any(flaw in found for found in flaws(changed))


@pytest.mark.parametrize(("path", "name"), sorted(set(NAMED_TEST.findall(TEXT))), ids=lambda value: str(value))
def test_every_test_that_is_named_exists(path: str, name: str) -> None:
    assert exists(path, name)


def test_every_one_of_the_twelve_points_has_a_test() -> None:
    points = re.findall(r"^\| (\d+) [^|]+\| `", section(TEXT, "The twelve points"), re.MULTILINE)
    assert points == [str(number) for number in range(1, 13)]


def test_every_test_of_the_twelve_points_is_named() -> None:
    tests = re.findall(
        r"^(?:async )?def (test_point_\w+)", (ROOT / "tests/safety/test_twelve_points.py").read_text(), re.M
    )
    assert {name for name in tests if "point_11" not in name} <= {name for _, name in NAMED_TEST.findall(TEXT)}


def test_every_link_within_the_page_leads_to_a_heading() -> None:
    titles = re.findall(r"^#+ (.+)$", TEXT, re.MULTILINE)
    headings = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
    assert set(re.findall(r"\]\(#([^)]+)\)", TEXT)) <= headings


def test_the_record_asks_for_what_the_assessment_rests_on() -> None:
    form = section(TEXT, "Before a real robot moves").split("### Record form")[1].split("\n### ")[0]
    for word in ("hash of the description", "limits", "`hold`", "`latency`", "validated by", "date"):
        assert word in form

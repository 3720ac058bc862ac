"""Lines of the documents fit 120 columns, but for what Markdown cannot break."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = 120
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "bench").rglob("*.md")),
]


def long_lines(text: str) -> Iterator[str]:
    """Tables, images and code are exempt, and a line of one word, such as an address."""
    in_code = False
    for number, line in enumerate(text.splitlines(), start=1):
        if re.match(r"\s*```", line):
            in_code = not in_code
        elif len(line) > COLUMNS and not in_code and not line.startswith(("|", "![")) and len(line.split()) > 2:
            yield f"line {number} has {len(line)} columns"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_of_a_page_is_longer_than_120_columns(page: Path) -> None:
    assert list(long_lines(page.read_text())) == []


def test_tables_code_and_addresses_may_be_longer_and_nothing_else() -> None:
    long = "word " * 30
    assert list(long_lines(f"| {long} |\n```sh\n{long}\n```\n- https://{'a' * 130}\n")) == []
    assert list(long_lines(f"short\n{long}\n- {long}\n")) == ["line 2 has 150 columns", "line 3 has 152 columns"]

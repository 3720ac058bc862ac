"""Every link of the documents leads to a file that exists, and to a heading that is in it."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *(page for folder in ("docs", "bench", ".github") for page in sorted((ROOT / folder).rglob("*.md"))),
]
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")
CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


@cache
def anchors(page: Path) -> set[str]:
    """The names of a page's headings: in lower case, without punctuation, blanks as dashes."""
    found: set[str] = set()
    for title in re.findall(r"^#+ (.+)$", CODE.sub("", page.read_text()), re.MULTILINE):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title)
        name = re.sub(r"[^\w -]", "", text.lower()).strip().replace(" ", "-")
        number = 1
        while name in found:
            name, number = f"{name.removesuffix(f'-{number - 1}')}-{number}", number + 1
        found.add(name)
    return found


def flaws(page: Path, text: str) -> list[str]:
    found = []
    for target, anchor in LINK.findall(CODE.sub("", text)):
        file = (page.parent / target).resolve() if target else page
        if not file.exists():
            found.append(f"no file {target}")
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            found.append(f"no heading #{anchor} in {file.name}")
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert flaws(page, page.read_text()) == []


def test_a_link_that_leads_nowhere_is_named() -> None:
    page = ROOT / "docs" / "deploy.md"
    text = "[a](gone.md) [b](#updating) [c](#gone) [d](security.md#limits) [e](security.md#gone)"
    assert flaws(page, text) == ["no file gone.md", "no heading #gone in deploy.md", "no heading #gone in security.md"]

"""The pages of the documentation's site, as they are laid out before it is built."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from scripts.build_site import BrokenLink, page_text, pages, stage

ROOT = Path(__file__).resolve().parents[2]
KNOWN = {"README.md": "index.md", "docs/a.md": "a.md", "docs/deep/b.md": "deep/b.md", "CONTRIBUTING.md": "project/c.md"}


def entries(nav: list[Any] | dict[str, Any] | str) -> list[str]:
    if isinstance(nav, str):
        return [nav]
    inner = nav.values() if isinstance(nav, dict) else nav
    return [entry for each in inner for entry in entries(each)]


@pytest.mark.parametrize(
    ("page", "text", "there"),
    [
        ("README.md", "see [a](docs/a.md#part)", "see [a](a.md#part)"),
        ("docs/deep/b.md", "![x](../a.md)", "![x](../a.md)"),
        ("docs/deep/b.md", "[b](../../README.md)", "[b](../index.md)"),
        ("CONTRIBUTING.md", "[a](docs/a.md)", "[a](../a.md)"),
        ("docs/a.md", "[x](#part), [y](https://example.org)", "[x](#part), [y](https://example.org)"),
    ],
)
def test_a_link_between_pages_holds_on_the_site(page: str, text: str, there: str) -> None:
    assert page_text(page, text, KNOWN) == there


def test_a_link_to_a_file_that_is_on_no_page_keeps_its_text() -> None:
    assert page_text("docs/a.md", "the [`Makefile`](../Makefile).", KNOWN) == "the `Makefile`."


def test_a_link_to_a_file_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(BrokenLink, match=r"docs/a\.md links to gone\.md"):
        page_text("docs/a.md", "[x](gone.md)", KNOWN)


def test_code_is_left_as_it_is_and_a_diagram_becomes_a_picture() -> None:
    code = "```md\n[x](gone.md)\n```"
    assert page_text("docs/a.md", code, KNOWN) == code
    diagram = "```mermaid\nsequenceDiagram\nparticipant A\nA->>A: x\n```"
    assert page_text("docs/a.md", f"before\n\n{diagram}\n", KNOWN).startswith('before\n\n<div class="sequence">')


def test_a_diagram_of_another_kind_stays_readable_as_text() -> None:
    assert (
        page_text("docs/a.md", "```mermaid\nflowchart LR\nA --> B\n```", KNOWN) == "```text\nflowchart LR\nA --> B\n```"
    )


def test_every_page_is_in_the_navigation_once(tmp_path: Path) -> None:
    stage(tmp_path)
    staged = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.md")}
    named = entries(tomllib.loads((ROOT / "zensical.toml").read_text())["project"]["nav"])
    assert len(named) == len(set(named))
    linked_only = {"project/security.md", "project/code_of_conduct.md", "upstream/README.md"}
    assert staged - linked_only == set(named)


def test_the_pages_are_those_of_the_documents_and_of_the_top_folder() -> None:
    known = pages()
    assert known["README.md"] == "index.md"
    assert known["docs/tutorials/student.md"] == "tutorials/student.md"
    assert "docs/assets/site.css" in known

"""The README tells the truth: what it shows exists, and its script is the one that a test runs."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def test_the_readme_shows_the_example_as_it_is() -> None:
    example = (ROOT / "docs" / "examples" / "drive.py").read_text().rstrip()
    assert f"```python\n{example}\n```" in (ROOT / "README.md").read_text()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_make_target_that_is_named_exists(document: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for target in re.findall(r"(?:^|`)make ([a-z-]+)", document.read_text(), re.MULTILINE):
        assert target in targets


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_of_the_project_that_is_named_exists(document: Path) -> None:
    folders = "robot_bridge|server|client|web|bench|tests|docs|scripts"
    text = document.read_text()
    named_files = rf"`((?:(?:{folders})/[\w./-]+\.(?:py|ts|md|json|js))|rtc/[\w./-]+\.py)`"
    for named in re.findall(named_files, text):
        assert (ROOT / named).exists(), named
    # `drive/driver.ts` is short for web/src/drive/driver.ts where a text speaks of the page.
    for named in re.findall(rf"`((?!(?:{folders})/)[a-z_]+/[\w/]+\.ts)`", text):
        assert (ROOT / "web" / "src" / named).exists(), named

"""Builds the documentation's site: `python -m scripts.build_site` in the environment `.docs/`.

The pages are those of `docs/` and of the repository's top folder. They are copied beside the environment first, so that
the README is the site's first page and its links hold there. A link to a file that is on no page keeps its text only.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from scripts.sequence_diagram import render_sequence

__all__ = ["BrokenLink", "page_text", "pages", "stage"]

ROOT = Path(__file__).resolve().parents[1]
STAGE = ROOT / ".docs" / "pages"
TOP = {"README.md": "index.md"} | {
    name: f"project/{name.lower()}" for name in ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
}
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|mailto:|#)([^)#\s]+)(#[^)\s]*)?\)")
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
DIAGRAM = re.compile(r"```mermaid\n(.*?)\n```", re.DOTALL)


class BrokenLink(ValueError):
    """A page links to a file that does not exist."""

    def __init__(self, page: str, target: str) -> None:
        super().__init__(page, target)
        self.page, self.target = page, target

    def __str__(self) -> str:
        return f"{self.page} links to {self.target}, which does not exist"


def pages() -> dict[str, str]:
    """The files of the site: path in the repository → path among the pages."""
    found = (path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*")) if path.is_file())
    return TOP | {name: name.removeprefix("docs/") for name in found if "__pycache__" not in name}


def page_text(name: str, text: str, known: dict[str, str]) -> str:
    """Return the text of a page as the site needs it: links between pages, and diagrams as pictures.

    Raises:
        BrokenLink: the page links to a file that does not exist.
    """

    def link(found: re.Match[str]) -> str:
        mark, label, target, anchor = found[1], found[2], found[3], found[4] or ""
        file = os.path.normpath(Path(name).parent / target)
        if file in known:
            there = Path(os.path.relpath(known[file], Path(known[name]).parent)).as_posix()
            return f"{mark}[{label}]({there}{anchor})"
        if not (ROOT / file).exists():
            raise BrokenLink(name, target)
        return label

    return "".join(DIAGRAM.sub(_diagram, part) if code else LINK.sub(link, part) for code, part in _parts(text))


def _diagram(found: re.Match[str]) -> str:
    """A sequence diagram becomes a picture; any other kind stays readable as text."""
    text = found[1]
    return render_sequence(text) if text.lstrip().startswith("sequenceDiagram") else f"```text\n{text}\n```"


def _parts(text: str) -> Iterator[tuple[bool, str]]:
    """The text in order: code, and what is not code."""
    end = 0
    for block in FENCED.finditer(text):
        yield False, text[end : block.start()]
        yield True, block[0]
        end = block.end()
    yield False, text[end:]


def stage(folder: Path) -> None:
    """Write all pages of the site into `folder`, in place of those of the last time."""
    shutil.rmtree(folder, ignore_errors=True)
    known = pages()
    for name, place in known.items():
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith(".md"):
            target.write_text(page_text(name, (ROOT / name).read_text(), known))
        else:
            shutil.copyfile(ROOT / name, target)


def main() -> int:
    stage(STAGE)
    return subprocess.run(
        [str(Path(sys.executable).with_name("zensical")), "build", "--clean", "--strict"], cwd=ROOT
    ).returncode


if __name__ == "__main__":
    sys.exit(main())

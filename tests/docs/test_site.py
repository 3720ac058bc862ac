"""`make docs` builds the site without a warning. What is built fetches nothing from elsewhere and links to itself."""

import re
import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag

import pytest

from lockstep import client

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "site"

pytestmark = pytest.mark.long


class Page(HTMLParser):
    """What a page loads by itself, where it leads, and its anchors."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if "src" in values:
            self.loads.append(values["src"])
        if tag == "link" and values.get("rel") not in ("canonical", "prev", "next"):
            self.loads.append(values["href"])
        if tag == "a" and "href" in values:
            self.links.append(values["href"])


@pytest.fixture(scope="module")
def site() -> dict[Path, Page]:
    done = subprocess.run(["make", "docs"], cwd=ROOT, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path: Page(path.read_text()) for path in SITE.rglob("*.html")}


def broken(site: dict[Path, Page]) -> Iterator[str]:
    for path, page in site.items():
        if path.name == "404.html":
            continue  # its links begin at the root of the server
        for link in page.links:
            target, anchor = urldefrag(link)
            if re.match(r"[a-z]+:", target):
                continue
            file = (path.parent / unquote(target)).resolve() if target else path
            file = file / "index.html" if file.is_dir() else file
            known = site[file].anchors if file in site else set()
            if not file.exists() or (anchor and file.suffix == ".html" and unquote(anchor) not in known):
                yield f"{path.relative_to(SITE)}: {link}"


def test_no_page_loads_anything_from_elsewhere(site: dict[Path, Page]) -> None:
    assert len(site) > 25
    assert [load for page in site.values() for load in page.loads if re.match(r"(?:[a-z]+:)?//", load)] == []
    styles = "".join(path.read_text() for path in SITE.rglob("*.css"))
    assert re.findall(r"(?:@import|url\()\s*[\"']?(?:https?:)?//[^)\"']+", styles) == []
    assert 'class="mermaid"' not in "".join(path.read_text() for path in site)


def test_every_link_of_the_site_leads_to_a_page_and_an_anchor_of_it(site: dict[Path, Page]) -> None:
    assert list(broken(site)) == []


def test_the_reference_shows_every_public_name_with_its_members_and_fields(site: dict[Path, Page]) -> None:
    anchors = site[SITE / "client" / "index.html"].anchors
    assert {f"lockstep.client.{name}" for name in client.__all__} <= anchors
    public = {name for name in vars(client.Console) if not name.startswith("_")}
    assert {f"lockstep.client.Console.{name}" for name in public} <= anchors
    text = (SITE / "client" / "index.html").read_text()
    assert "largest |gap| rendered" in text  # a comment behind a field

"""Works of others that the built page contains come with their licences."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DIST = ROOT / "server" / "lockstep" / "server" / "web_dist"


def test_the_built_page_has_the_licence_of_every_package_in_it() -> None:
    packages = json.loads((ROOT / "web" / "package.json").read_text())["dependencies"]
    listed = (DIST / "licenses.md").read_text() + (DIST / "licenses-inter.txt").read_text()
    names = {name: "The Inter Project Authors" if "inter" in name else f"## {name} - " for name in packages}
    assert [name for name, words in names.items() if words not in listed] == []


def test_the_notice_names_every_package_of_the_page() -> None:
    packages = json.loads((ROOT / "web" / "package.json").read_text())["dependencies"]
    notice = (ROOT / "NOTICE").read_text().lower()
    plain = {"@fontsource-variable/inter": "inter,", "three": "three.js"}
    assert [name for name in packages if plain.get(name, name).lower() not in notice] == []

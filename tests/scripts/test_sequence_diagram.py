"""Mermaid's sequence diagrams become SVG that needs no script."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from scripts.sequence_diagram import DiagramError, render_sequence

ROOT = Path(__file__).resolve().parents[2]
TWO = """sequenceDiagram
    participant A as page
    participant B
    A->>B: command <1>
    A->>A: wait
    B-->>A: feedback
"""


def test_it_draws_each_participant_and_each_message_once() -> None:
    picture = ElementTree.fromstring(render_sequence(TWO))
    texts = [element.text for element in picture.iter() if element.tag == "text"]
    assert texts == ["page", "B", "command <1>", "wait", "feedback"]
    assert [path.get("class") for path in picture.iter("path")] == [None, "head", None, "head", "dashed", "head"]


def test_no_text_reaches_the_next_lifeline() -> None:
    long = "sequenceDiagram\nparticipant A\nparticipant B\nparticipant C\nA->>B: " + "x" * 60
    picture = ElementTree.fromstring(render_sequence(long))
    places = [float(line.get("x1", "nan")) for line in picture.iter("line")]
    assert places[1] - places[0] > 7 * 60
    assert float(picture[0].get("viewBox", "").split()[2]) > places[2]


def test_a_reader_who_does_not_see_it_hears_the_messages() -> None:
    assert 'aria-label="1: command &lt;1&gt;; 2: wait; 3: feedback"' in render_sequence(TWO)


@pytest.mark.parametrize(
    "text",
    ["graph TD\nA-->B", "sequenceDiagram\nparticipant A\nNote over A: x", "sequenceDiagram\nparticipant A\nA->>B: x"],
)
def test_what_it_does_not_know_is_named(text: str) -> None:
    with pytest.raises(DiagramError, match=re.escape(text.splitlines()[-1 if "participant" in text else 0])):
        render_sequence(text)


def test_it_knows_every_sequence_diagram_of_the_documents() -> None:
    found = [
        diagram
        for page in (ROOT / "docs").rglob("*.md")
        for diagram in re.findall(r"```mermaid\n(sequenceDiagram\n.*?)\n```", page.read_text(), re.DOTALL)
    ]
    assert len(found) >= 2
    assert all(render_sequence(diagram).startswith('<div class="sequence"><svg') for diagram in found)

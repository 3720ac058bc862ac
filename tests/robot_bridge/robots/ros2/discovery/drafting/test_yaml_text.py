"""Text that a YAML reader takes back as it was, whatever the names on other machines are."""

import yaml
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Section, Value, comment, plain, render

SCALARS = st.booleans() | st.integers(-(10**9), 10**9) | st.text()
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner) | st.dictionaries(st.text(min_size=1), inner), max_leaves=8
)


@given(value=VALUES, note=st.text())
def test_a_reader_gets_every_value_back_whatever_its_note_is(value: object, note: str) -> None:
    text = render(Section(head=[note], values={"key": Value(value, note), "next": Value(1)}))  # type: ignore[arg-type]
    assert yaml.safe_load(text) == {"key": value, "next": 1}


@given(st.text())
def test_a_comment_is_one_line(text: str) -> None:
    assert len(comment(text).splitlines()) == 1


def test_numbers_are_written_for_people() -> None:
    assert [plain(value) for value in (0.2, 1.0, -3.0, 0.05000000001, 1e-9)] == ["0.2", "1", "-3", "0.05", "0"]


def test_words_that_mean_something_else_are_quoted() -> None:
    assert [plain(word) for word in ("on", "No", "/scan", "1.5", "a: b", "")] == [
        '"on"',
        '"No"',
        "/scan",
        '"1.5"',
        '"a: b"',
        '""',
    ]


def test_sections_and_lists_are_indented() -> None:
    rows = Section(items=[Value({"name": "a"}, "first"), Value({"name": "b"})])
    text = render(Section(values={"name": Value("x"), "arm": Section(head=["seen"], values={"joints": rows})}))
    assert yaml.safe_load(text) == {"name": "x", "arm": {"joints": [{"name": "a"}, {"name": "b"}]}}
    assert "# seen\narm:\n  joints:\n    - {name: a}" in text

"""Words of another node, made fit to be shown."""

from lockstep.robot_bridge.robots.ros2.sensing.words import words_of


def test_words_become_one_line_of_printable_characters() -> None:
    assert words_of("  at\n\tthe  dock\x1b[31m\u202e ") == "at the dock[31m"
    assert words_of("x" * 900) == "x" * 200
    assert words_of("abc", most=2) == "ab"
    assert words_of(7) == "7"


def test_of_a_long_text_only_the_beginning_is_looked_at() -> None:
    """A text of 10 MB from a topic would hold up the control loop for half a second: both run in one interpreter."""
    assert words_of(" " * 10_000_000 + "late") == ""
    assert words_of("\x00" * 700 + "soon") == "soon"

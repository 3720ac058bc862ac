import pytest

from lockstep.server.cli.access.durations import duration_words, parse_duration


@pytest.mark.parametrize(
    ("text", "seconds"), [("90s", 90), ("30m", 1800), ("8h", 28800), ("1d12h", 129600), ("2w", 1209600)]
)
def test_a_duration_is_read(text: str, seconds: float) -> None:
    assert parse_duration(text) == seconds


@pytest.mark.parametrize("text", ["", "8", "h", "8 h", "-8h", "8h!", "1.5h", "8hh", "1234567s", "８h"])
def test_what_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a time"):
        parse_duration(text)


@pytest.mark.parametrize(
    ("seconds", "words"), [(0, "0s"), (-5, "0s"), (59.6, "1m"), (3600, "1h"), (28799, "7h 59m"), (90061, "1d 1h")]
)
def test_a_duration_is_written_with_its_two_largest_units(seconds: float, words: str) -> None:
    assert duration_words(seconds) == words

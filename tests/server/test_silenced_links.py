from server.silenced_links import MAX_SILENCED, SILENCE_SECONDS, SilencedLinks


def test_a_silence_ends_by_itself_or_by_whoever_ends_it() -> None:
    links = SilencedLinks()
    assert not links.holds("a", 0.0)
    links.silence("a", 0.0)
    links.silence("b", 1.0)
    assert links.holds("a", SILENCE_SECONDS - 1)
    assert not links.holds("a", SILENCE_SECONDS)
    assert links.hear("b")
    assert not links.hear("b")
    assert not links.holds("b", 2.0)
    assert links.ended(SILENCE_SECONDS) == ["a"]
    assert len(links) == 0


def test_a_bounded_number_is_silenced() -> None:
    links = SilencedLinks()
    for number in range(2 * MAX_SILENCED):
        links.silence(str(number), 0.0)
    assert len(links) == MAX_SILENCED
    assert not links.holds("0", 1.0), "the oldest may press again"

import pytest

from lockstep.server.auth.silenced_links import MAX_CONSOLES, MAX_SILENCED, SILENCE_SECONDS, SilencedLinks

INVITED_WITH = {"child": "root", "grandchild": "child", "cousin": "other", "a": "b", "b": "a"}


def _links() -> SilencedLinks:
    return SilencedLinks(lambda link: INVITED_WITH.get(link, ""))


def test_a_silence_ends_by_itself_or_by_whoever_ends_it() -> None:
    links = SilencedLinks()
    assert not links.holds("a", 0.0)
    links.silence("a", 0.0)
    links.silence("b", 1.0)
    assert links.holds("a", SILENCE_SECONDS - 1)
    assert not links.holds("a", SILENCE_SECONDS)
    assert links.hear("b", 2.0)
    assert not links.hear("b", 2.0)
    assert not links.holds("b", 2.0)
    assert links.ended(SILENCE_SECONDS) == ["a"]
    assert len(links) == 0


def test_a_bounded_number_is_silenced() -> None:
    links = SilencedLinks()
    for number in range(2 * MAX_SILENCED):
        links.silence(str(number), 0.0)
    assert len(links) == MAX_SILENCED
    assert not links.holds("0", 1.0), "the oldest may press again"


@pytest.mark.parametrize("link", ["root", "child", "grandchild"])
def test_it_covers_every_link_below_and_whoever_hears_one_of_them_hears_all(link: str) -> None:
    links = _links()
    links.silence("root", 0.0)
    assert [links.holds(each, 1.0) for each in ("root", "child", "grandchild")] == [True] * 3
    assert not links.holds("cousin", 1.0)
    assert links.hear(link, 1.0)
    assert [links.holds(each, 1.0) for each in ("root", "child", "grandchild")] == [False] * 3


def test_it_covers_no_link_above() -> None:
    links = _links()
    links.silence("child", 0.0)
    assert [links.holds(each, 1.0) for each in ("root", "child", "grandchild")] == [False, True, True]


def test_nobody_is_silenced_for_a_link_without_an_id_and_a_list_that_goes_round_ends() -> None:
    links = _links()
    links.silence("other", 0.0)
    assert not links.holds("", 1.0)
    assert not links.holds("a", 1.0)


def test_what_another_console_silences_is_silenced_here_with_all_that_was_invited_with_it_here() -> None:
    links = _links()
    links.told_elsewhere("two", {"root": 500.0}, 0.0)
    assert links.holds("grandchild", 1.0)
    assert not links.holds("grandchild", 500.0)
    links.told_elsewhere("two", {}, 2.0)
    assert not links.holds("grandchild", 3.0), "it ended there"


def test_what_another_console_says_lasts_no_longer_than_any_silence_and_is_bounded() -> None:
    links = _links()
    links.told_elsewhere("two", {"root": 1e12, **{str(n): 9.0 for n in range(2 * MAX_SILENCED)}}, 0.0)
    assert links.holds("root", SILENCE_SECONDS)
    assert not links.holds("root", SILENCE_SECONDS + 10)
    assert not links.holds(str(2 * MAX_SILENCED - 1), 1.0)
    for number in range(MAX_CONSOLES):
        links.told_elsewhere(str(number), {"child": 9.0}, 0.0)
    assert not links.holds("root", 1.0), "that console was heard of longest ago"


def test_a_supervisor_here_ends_what_was_silenced_elsewhere_though_that_console_goes_on_saying_it() -> None:
    links = _links()
    links.told_elsewhere("two", {"root": 500.0}, 0.0)
    assert links.hear("child", 1.0)
    links.told_elsewhere("two", {"root": 500.5}, 2.0)  # its clock is not quite ours
    assert not links.holds("child", 3.0)
    links.told_elsewhere("two", {"root": 590.0}, 4.0)  # there it was silenced anew
    assert links.holds("child", 5.0)


def test_other_consoles_are_told_of_links_that_only_this_one_knows_to_be_below() -> None:
    links = _links()
    assert links.to_tell(INVITED_WITH, 0.0) == {}
    links.silence("root", 0.0)
    until = SILENCE_SECONDS
    assert links.to_tell(INVITED_WITH, 1.0) == {"root": until, "child": until, "grandchild": until}
    other = _links()
    other.told_elsewhere("one", {"root": 300.0}, 0.0)
    assert other.to_tell(INVITED_WITH, 1.0) == {"child": 300.0, "grandchild": 300.0}, "the root is theirs to tell"
    other.told_elsewhere("one", {}, 2.0)
    assert other.to_tell(INVITED_WITH, 3.0) == {}

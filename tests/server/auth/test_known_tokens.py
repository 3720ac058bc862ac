from lockstep.server.auth.known_tokens import KnownTokens


def test_the_newest_are_known_and_the_oldest_forgotten() -> None:
    tokens = KnownTokens(2)
    for token in ("a", "b", "a", "c"):
        tokens.add(token)
    assert ["a" in tokens, "b" in tokens, "c" in tokens] == [True, False, True]


def test_a_token_that_is_good_no_more_is_forgotten() -> None:
    tokens = KnownTokens()
    tokens.add("a")
    tokens.forget("a")
    tokens.forget("b")
    assert "a" not in tokens

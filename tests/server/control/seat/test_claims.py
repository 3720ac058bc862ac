from lockstep.server.control.seat.claims import DECLINED_FOR, MAX_CLAIMS, Claims

NOW = 10.0


def _reason(claims: Claims, peer: str, now: float = NOW) -> str:
    refusal = claims.ask(peer, now)
    return "" if refusal is None else refusal.reason


def test_claims_are_bounded() -> None:
    claims = Claims(60.0)
    for number in range(MAX_CLAIMS):
        assert _reason(claims, str(number)) == ""
    assert _reason(claims, "me") == "seat_taken"
    claims.drop("0")
    assert _reason(claims, "me") == ""
    assert (claims.first, len(claims), "0" in claims) == ("1", MAX_CLAIMS, False)


def test_a_decline_ends_a_claim_and_lasts_until_it_is_over_or_the_peer_has_gone() -> None:
    claims = Claims(60.0)
    for peer in ("me", "other"):
        claims.ask(peer, NOW)
        claims.decline(peer, NOW)
    assert (claims.first, list(claims)) == ("", [])
    claims.gone("other")
    assert _reason(claims, "other") == ""
    assert _reason(claims, "me", NOW + DECLINED_FOR - 0.1) == "declined"
    assert _reason(claims, "me", NOW + DECLINED_FOR) == ""


def test_a_claim_runs_out_at_its_own_time() -> None:
    claims = Claims(60.0)
    claims.ask("me", NOW)
    claims.ask("other", NOW + 20.0)
    assert claims.seconds_left(NOW + 60.0) == {"me": 0.0, "other": 20.0}
    assert claims.unanswered(NOW + 59.9) == []
    assert claims.unanswered(NOW + 60.0) == ["me"]

from itertools import product

import pytest

from lockstep.server.control.seat import (
    COUNTDOWN,
    DECLINED_FOR,
    MAX_CLAIMS,
    OFFER_ENDS,
    TABLE,
    ControlSeat,
    Move,
    SeatInput,
    SeatOutcome,
    SeatTimes,
    Standing,
)

TIMES = SeatTimes(heartbeat=3.0, idle=300.0, claim=60.0)
NOW = 10.0


def _seat(standing: Standing) -> ControlSeat:
    """A seat as "me" sees it."""
    seat = ControlSeat(TIMES)
    if standing is Standing.POLICY:
        seat.offer_to_policies("person", "operator", "link", 0.0)
        seat.request("other", "policy", 0.0)
    elif standing is not Standing.FREE:
        seat.request("me" if standing is Standing.HOLDER else "other", "operator", 0.0)
    if standing is Standing.CLAIMANT:
        seat.request("me", "operator", 0.0)
    return seat


def _apply(seat: ControlSeat, what: SeatInput) -> SeatOutcome:
    """The input, about "me"; nothing else runs out."""
    match what:
        case SeatInput.REQUEST:
            return seat.request("me", "operator", NOW)
        case SeatInput.REQUEST_IF_FREE:
            return seat.request("me", "operator", NOW, only_if_free=True)
        case SeatInput.TAKE:
            return seat.take("me", "supervisor", NOW)
        case SeatInput.GRANTED | SeatInput.DECLINED:
            if not seat.holder:
                return SeatOutcome()  # there is nobody who could answer
            return seat.answer(seat.holder, "me", NOW, grant=what is SeatInput.GRANTED)
        case SeatInput.RELEASE:
            return seat.release("me", NOW)
        case SeatInput.GONE:
            return seat.gone("me", NOW)
        case SeatInput.SILENT:
            seat.heard("other", NOW)
            seat.attended("link", NOW)
            return _expire(seat, TIMES.heartbeat)
        case SeatInput.OFFERED:
            if not seat.holds("me"):
                return SeatOutcome()  # it is the holder's
            return seat.offer_to_policies("me", "operator", "link", NOW)
        case SeatInput.WITHDRAWN | SeatInput.STOPPED | SeatInput.LINK_LOST | SeatInput.UNATTENDED:
            return SeatOutcome()  # about the policy that drives, below
        case SeatInput.IDLE:
            seat.heard("me", TIMES.idle)
            seat.heard("other", TIMES.idle)
            seat.attended("link", TIMES.idle)
            seat.moved("other", TIMES.idle)
            return _expire(seat, TIMES.idle) if not seat.claims(0.0) else SeatOutcome()
        case SeatInput.UNANSWERED:
            seat.heard("me", TIMES.claim)
            seat.heard("other", TIMES.claim)
            seat.attended("link", TIMES.claim)
            return _expire(seat, TIMES.claim)


def _expire(seat: ControlSeat, now: float) -> SeatOutcome:
    return next(seat.expire(now), SeatOutcome())


def test_the_table_is_complete() -> None:
    assert set(TABLE) == set(product(Standing, SeatInput))


@pytest.mark.parametrize(
    ("standing", "what"), [each for each in product(Standing, SeatInput) if each[1] not in OFFER_ENDS]
)
def test_every_cell_of_the_table(standing: Standing, what: SeatInput) -> None:
    seat = _seat(standing)
    assert seat.standing("me") is standing
    holder = seat.holder
    outcome = _apply(seat, what)
    refused = outcome.refusal.reason if outcome.refusal is not None else None
    seen = (outcome.rest, outcome.changed, refused, seat.standing("me"))
    match TABLE[standing, what]:
        case Move.NOTHING | Move.STAYS:
            assert seen == (False, False, None, standing)
        case Move.SEATED:
            assert seen == (bool(holder), True, None, Standing.HOLDER)
            took = (Standing.POLICY, SeatInput.REQUEST)
            assert seat.why == ("taken" if (standing, what) == took else what.value.removesuffix(" if free"))
        case Move.LEAVES:
            assert seen == (True, True, None, Standing.FREE)
            assert seat.why == what.value.removesuffix(" if free")
        case Move.CLAIMS:
            assert seen == (False, True, None, Standing.CLAIMANT)
        case Move.WITHDRAWS:
            assert seen == (False, True, None, Standing.OTHER)
        case Move.REFUSED_TAKEN:
            assert seen == (False, False, "seat_taken", standing)
        case Move.REFUSED_DECLINED:
            assert seen == (False, True, "declined", Standing.OTHER)
    if seat.standing("me") is not Standing.HOLDER and standing is not Standing.HOLDER:
        assert seat.holder == holder


def test_an_observer_never_gets_the_seat() -> None:
    seat = ControlSeat(TIMES)
    for outcome in (seat.request("me", "observer", 0.0), seat.take("me", "observer", 0.0)):
        assert outcome.refusal is not None
        assert outcome.refusal.reason == "not_allowed"
    assert seat.holder == ""


def test_only_a_supervisor_takes_the_seat_at_once_and_drives_like_an_operator() -> None:
    seat = _seat(Standing.OTHER)
    refusal = seat.take("me", "operator", NOW).refusal
    assert refusal is not None
    assert refusal.reason == "not_allowed"
    assert seat.take("me", "supervisor", NOW) == SeatOutcome(rest=True, changed=True)
    assert not seat.may_move("me")
    seat.neutral("me")
    assert seat.may_move("me")


def test_only_the_holder_answers_a_claim() -> None:
    seat = _seat(Standing.CLAIMANT)
    for peer in ("me", "third"):
        refusal = seat.answer(peer, "me", NOW, grant=True).refusal
        assert refusal is not None
        assert (refusal.peer, refusal.reason) == (peer, "no_seat")
    assert seat.holder == "other"


def test_whoever_leaves_makes_room_for_the_claim_that_has_waited_longest() -> None:
    seat = _seat(Standing.OTHER)
    for claimant in ("first", "second"):
        seat.request(claimant, "operator", NOW)
    assert seat.release("other", NOW + 1) == SeatOutcome(rest=True, changed=True)
    assert seat.holder == "first"
    assert list(seat.claims(NOW + 1)) == ["second"]


def test_a_claim_says_how_long_it_is_put_to_the_holder_and_keeps_its_end_when_it_is_repeated() -> None:
    seat = _seat(Standing.OTHER)
    seat.request("me", "operator", NOW)
    seat.request("me", "operator", NOW + 20)
    assert seat.claims(NOW + 20) == {"me": TIMES.claim - 20}
    seat.heard("other", NOW + TIMES.claim)
    outcome = _expire(seat, NOW + TIMES.claim)
    assert outcome.refusal is not None
    assert (outcome.refusal.reason, outcome.refusal.detail) == ("declined", "no answer")


def test_who_was_declined_asks_again_a_little_later() -> None:
    seat = _seat(Standing.CLAIMANT)
    seat.answer("other", "me", NOW, grant=False)
    refusal = seat.request("me", "operator", NOW + DECLINED_FOR - 0.1).refusal
    assert refusal is not None
    assert refusal.reason == "declined"
    assert seat.request("me", "operator", NOW + DECLINED_FOR).changed
    assert seat.standing("me") is Standing.CLAIMANT


def test_claims_are_bounded() -> None:
    seat = _seat(Standing.OTHER)
    for number in range(MAX_CLAIMS):
        assert seat.request(str(number), "operator", NOW).changed
    refusal = seat.request("me", "operator", NOW).refusal
    assert refusal is not None
    assert refusal.reason == "seat_taken"


def test_who_speaks_in_time_keeps_the_seat() -> None:
    seat = _seat(Standing.HOLDER)
    for now in range(1, 20):
        seat.heard("me", now * 2.7)
        assert _expire(seat, now * 2.7 + 2.9) == SeatOutcome()
    assert _expire(seat, 19 * 2.7 + 3.0).rest


def test_on_a_long_path_silence_is_longer_by_four_round_trips_and_ends_all_the_same() -> None:
    seat = _seat(Standing.HOLDER)
    seat.heard("me", 1.0, 0.6)
    assert _expire(seat, 1.0 + 5.39) == SeatOutcome()
    assert _expire(seat, 1.0 + 5.41).rest
    seat = _seat(Standing.HOLDER)
    seat.heard("me", 1.0, 60.0)
    assert _expire(seat, 1.0 + 7.9) == SeatOutcome()
    assert _expire(seat, 1.0 + 8.1).rest


def test_the_next_holder_is_not_given_the_path_of_the_last() -> None:
    seat = _seat(Standing.HOLDER)
    seat.heard("me", 1.0, 0.6)
    seat.take("other", "supervisor", 2.0)
    assert _expire(seat, 2.0 + 3.0).rest


def test_the_words_of_others_do_not_keep_the_seat() -> None:
    seat = _seat(Standing.HOLDER)
    seat.heard("other", TIMES.heartbeat)
    assert _expire(seat, TIMES.heartbeat).rest


def _idle(seat: ControlSeat, now: float) -> SeatOutcome:
    seat.heard("me", now)
    return _expire(seat, now)


def test_an_idle_holder_is_counted_down_for_everyone_and_then_loses_the_seat() -> None:
    seat = _seat(Standing.HOLDER)
    assert _idle(seat, TIMES.idle - COUNTDOWN - 0.1) == SeatOutcome()
    assert seat.idle_seconds_left(0.0) is None
    assert _idle(seat, TIMES.idle - COUNTDOWN) == SeatOutcome(changed=True)
    assert seat.idle_seconds_left(TIMES.idle - 20) == 20
    assert _idle(seat, TIMES.idle - 1) == SeatOutcome(), "told once"
    assert _idle(seat, TIMES.idle) == SeatOutcome(rest=True, changed=True)
    assert seat.why == "idle"


@pytest.mark.parametrize("how", ["moves", "asks"])
def test_moving_or_asking_again_ends_the_countdown(how: str) -> None:
    seat = _seat(Standing.HOLDER)
    _idle(seat, TIMES.idle - 1)
    outcome = seat.moved("me", TIMES.idle - 1) if how == "moves" else seat.request("me", "operator", TIMES.idle - 1)
    assert outcome == SeatOutcome(changed=True)
    assert seat.idle_seconds_left(TIMES.idle) is None
    assert _idle(seat, TIMES.idle + 1) == SeatOutcome()


def test_what_others_send_does_not_end_the_countdown() -> None:
    seat = _seat(Standing.HOLDER)
    assert seat.moved("other", TIMES.idle - 1) == SeatOutcome()
    seat.neutral("other")
    assert not seat.may_move("me")
    assert _idle(seat, TIMES.idle).rest


@pytest.mark.parametrize("what", OFFER_ENDS)
def test_the_end_of_the_offer_ends_the_turn_of_the_policy_and_concerns_no_person(what: SeatInput) -> None:
    seat = _seat(Standing.POLICY)
    assert seat.end_offer(what, NOW) == SeatOutcome(rest=True, changed=True)
    assert (seat.holder, seat.why, seat.offer) == ("", what.value, None)
    assert seat.end_offer(what, NOW) == SeatOutcome()
    seat = _seat(Standing.HOLDER)
    assert seat.end_offer(what, NOW) == SeatOutcome()
    assert seat.holds("me")


def test_an_offer_that_no_policy_takes_ends_as_a_request_does() -> None:
    seat = ControlSeat(TIMES)
    seat.offer_to_policies("me", "operator", "link", NOW)
    seat.attended("link", NOW + TIMES.claim)
    assert list(seat.expire(NOW + TIMES.claim - 0.1)) == []
    assert list(seat.expire(NOW + TIMES.claim)) == [SeatOutcome(changed=True)]
    assert seat.request("other", "policy", NOW + TIMES.claim).refusal is not None


def test_a_policy_whose_person_falls_silent_loses_the_seat_within_the_heartbeat_time() -> None:
    seat = _seat(Standing.POLICY)
    seat.attended("link", NOW, round_trip=0.5)
    seat.attended("another link", NOW + 10)
    for now, outcomes in ((NOW + 4.9, []), (NOW + 5.0, [SeatOutcome(rest=True, changed=True)])):
        seat.heard("other", now)
        assert list(seat.expire(now)) == outcomes
    assert seat.why == "nobody attends"


def test_a_person_offers_only_a_seat_that_is_free_or_their_own_and_that_nobody_asks_for() -> None:
    seat = _seat(Standing.CLAIMANT)
    for peer, role, reason in (
        ("me", "operator", "seat_taken"),
        ("third", "supervisor", "seat_taken"),
        ("third", "observer", "not_allowed"),
        ("third", "policy", "not_allowed"),
        ("other", "operator", "seat_taken"),  # its own, but somebody waits for it
    ):
        refusal = seat.offer_to_policies(peer, role, "link", NOW).refusal  # type: ignore[arg-type]
        assert refusal is not None
        assert refusal.reason == reason
    assert (seat.holder, seat.offer) == ("other", None)


def test_another_person_may_become_responsible_for_the_policy_that_drives() -> None:
    seat = _seat(Standing.POLICY)
    assert seat.offer_to_policies("second", "operator", "second link", NOW) == SeatOutcome(changed=True)
    assert seat.holds("other")
    assert seat.person_left("link", NOW) == SeatOutcome()
    assert seat.person_left("second link", NOW) == SeatOutcome(rest=True, changed=True)


def test_a_policy_does_not_stay_by_asking_again() -> None:
    seat = _seat(Standing.POLICY)
    seat.heard("other", TIMES.idle)
    seat.attended("link", TIMES.idle)
    seat.request("other", "policy", TIMES.idle - 1)
    assert list(seat.expire(TIMES.idle)) == [SeatOutcome(rest=True, changed=True)]
    assert seat.why == "idle"

from itertools import product

import pytest

from lockstep.server.control.seat.claims import DECLINED_FOR
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_table import OFFER_ENDS, TABLE, Move, SeatInput, SeatOutcome, Standing
from lockstep.server.control.seat.seat_times import COUNTDOWN, SeatTimes

TIMES = SeatTimes(heartbeat=3.0, idle=300.0, claim=60.0)
NOW = 10.0


def _rules(standing: Standing) -> SeatRules:
    """A seat as "me" sees it."""
    rules = SeatRules(ControlSeat(TIMES))
    if standing is Standing.POLICY:
        rules.offer_to_policies("person", "operator", "link", 0.0)
        rules.request("other", "policy", 0.0)
    elif standing is not Standing.FREE:
        rules.request("me" if standing is Standing.HOLDER else "other", "operator", 0.0)
    if standing is Standing.CLAIMANT:
        rules.request("me", "operator", 0.0)
    return rules


def _apply(rules: SeatRules, what: SeatInput) -> SeatOutcome:
    """The input, about "me"; nothing else runs out."""
    match what:
        case SeatInput.REQUEST:
            return rules.request("me", "operator", NOW)
        case SeatInput.REQUEST_IF_FREE:
            return rules.request("me", "operator", NOW, only_if_free=True)
        case SeatInput.TAKE:
            return rules.take("me", "supervisor", NOW)
        case SeatInput.GRANTED | SeatInput.DECLINED:
            if not rules.seat.holder:
                return SeatOutcome()  # there is nobody who could answer
            return rules.answer(rules.seat.holder, "me", NOW, grant=what is SeatInput.GRANTED)
        case SeatInput.RELEASE:
            return rules.release("me", NOW)
        case SeatInput.GONE:
            return rules.gone("me", NOW)
        case SeatInput.SILENT:
            rules.heard("other", NOW)
            rules.attended("link", NOW)
            return _expire(rules, TIMES.heartbeat)
        case SeatInput.OFFERED:
            if not rules.seat.holds("me"):
                return SeatOutcome()  # it is the holder's
            return rules.offer_to_policies("me", "operator", "link", NOW)
        case SeatInput.WITHDRAWN | SeatInput.STOPPED | SeatInput.LINK_LOST | SeatInput.UNATTENDED:
            return SeatOutcome()  # about the policy that drives, below
        case SeatInput.IDLE:
            rules.heard("me", TIMES.idle)
            rules.heard("other", TIMES.idle)
            rules.attended("link", TIMES.idle)
            rules.moved("other", TIMES.idle)
            return _expire(rules, TIMES.idle) if not rules.seat.claims.seconds_left(0.0) else SeatOutcome()
        case SeatInput.UNANSWERED:
            rules.heard("me", TIMES.claim)
            rules.heard("other", TIMES.claim)
            rules.attended("link", TIMES.claim)
            return _expire(rules, TIMES.claim)


def _expire(rules: SeatRules, now: float) -> SeatOutcome:
    return next(rules.expire(now), SeatOutcome())


def test_the_table_is_complete() -> None:
    assert set(TABLE) == set(product(Standing, SeatInput))


@pytest.mark.parametrize(
    ("standing", "what"), [each for each in product(Standing, SeatInput) if each[1] not in OFFER_ENDS]
)
def test_every_cell_of_the_table(standing: Standing, what: SeatInput) -> None:
    rules = _rules(standing)
    assert rules.seat.standing("me") is standing
    holder = rules.seat.holder
    outcome = _apply(rules, what)
    refused = outcome.refusal.reason if outcome.refusal is not None else None
    seen = (outcome.rest, outcome.changed, refused, rules.seat.standing("me"))
    match TABLE[standing, what]:
        case Move.NOTHING | Move.STAYS:
            assert seen == (False, False, None, standing)
        case Move.SEATED:
            assert seen == (bool(holder), True, None, Standing.HOLDER)
            took = (Standing.POLICY, SeatInput.REQUEST)
            assert rules.seat.why == ("taken" if (standing, what) == took else what.value.removesuffix(" if free"))
        case Move.LEAVES:
            assert seen == (True, True, None, Standing.FREE)
            assert rules.seat.why == what.value.removesuffix(" if free")
        case Move.CLAIMS:
            assert seen == (False, True, None, Standing.CLAIMANT)
        case Move.WITHDRAWS:
            assert seen == (False, True, None, Standing.OTHER)
        case Move.REFUSED_TAKEN:
            assert seen == (False, False, "seat_taken", standing)
        case Move.REFUSED_DECLINED:
            assert seen == (False, True, "declined", Standing.OTHER)
    if rules.seat.standing("me") is not Standing.HOLDER and standing is not Standing.HOLDER:
        assert rules.seat.holder == holder


def test_an_observer_never_gets_the_seat() -> None:
    rules = SeatRules(ControlSeat(TIMES))
    for outcome in (rules.request("me", "observer", 0.0), rules.take("me", "observer", 0.0)):
        assert outcome.refusal is not None
        assert (outcome.refusal.reason, bool(outcome.refusal.detail)) == ("not_allowed", True)
    assert rules.seat.holder == ""


def test_only_a_supervisor_takes_the_seat_at_once_and_drives_like_an_operator() -> None:
    rules = _rules(Standing.OTHER)
    refusal = rules.take("me", "operator", NOW).refusal
    assert refusal is not None
    assert refusal.reason == "not_allowed"
    assert rules.take("me", "supervisor", NOW) == SeatOutcome(rest=True, changed=True)
    assert not rules.seat.may_move("me")
    rules.seat.neutral("me")
    assert rules.seat.may_move("me")


def test_only_the_holder_answers_a_claim() -> None:
    rules = _rules(Standing.CLAIMANT)
    for peer in ("me", "third"):
        refusal = rules.answer(peer, "me", NOW, grant=True).refusal
        assert refusal is not None
        assert (refusal.peer, refusal.reason) == (peer, "no_seat")
    assert rules.seat.holder == "other"


def test_whoever_leaves_makes_room_for_the_claim_that_has_waited_longest() -> None:
    rules = _rules(Standing.OTHER)
    for claimant in ("first", "second"):
        rules.request(claimant, "operator", NOW)
    assert rules.release("other", NOW + 1) == SeatOutcome(rest=True, changed=True)
    assert rules.seat.holder == "first"
    assert list(rules.seat.claims.seconds_left(NOW + 1)) == ["second"]


def test_a_claim_says_how_long_it_is_put_to_the_holder_and_keeps_its_end_when_it_is_repeated() -> None:
    rules = _rules(Standing.OTHER)
    rules.request("me", "operator", NOW)
    rules.request("me", "operator", NOW + 20)
    assert rules.seat.claims.seconds_left(NOW + 20) == {"me": TIMES.claim - 20}
    rules.heard("other", NOW + TIMES.claim)
    outcome = _expire(rules, NOW + TIMES.claim)
    assert outcome.refusal is not None
    assert (outcome.refusal.reason, outcome.refusal.detail) == ("declined", "no answer")


def test_who_was_declined_asks_again_a_little_later() -> None:
    rules = _rules(Standing.CLAIMANT)
    rules.answer("other", "me", NOW, grant=False)
    refusal = rules.request("me", "operator", NOW + DECLINED_FOR - 0.1).refusal
    assert refusal is not None
    assert refusal.reason == "declined"
    assert rules.request("me", "operator", NOW + DECLINED_FOR).changed
    assert rules.seat.standing("me") is Standing.CLAIMANT


def test_who_speaks_in_time_keeps_the_seat() -> None:
    rules = _rules(Standing.HOLDER)
    for now in range(1, 20):
        rules.heard("me", now * 2.7)
        assert _expire(rules, now * 2.7 + 2.9) == SeatOutcome()
    assert _expire(rules, 19 * 2.7 + 3.0).rest


def test_the_next_holder_is_not_given_the_path_of_the_last() -> None:
    rules = _rules(Standing.HOLDER)
    rules.heard("me", 1.0, 0.6)
    rules.take("other", "supervisor", 2.0)
    assert _expire(rules, 2.0 + 3.0).rest


def test_the_words_of_others_do_not_keep_the_seat() -> None:
    rules = _rules(Standing.HOLDER)
    rules.heard("other", TIMES.heartbeat)
    assert _expire(rules, TIMES.heartbeat).rest


def _idle(rules: SeatRules, now: float) -> SeatOutcome:
    rules.heard("me", now)
    return _expire(rules, now)


def test_an_idle_holder_is_counted_down_for_everyone_and_then_loses_the_seat() -> None:
    rules = _rules(Standing.HOLDER)
    assert _idle(rules, TIMES.idle - COUNTDOWN - 0.1) == SeatOutcome()
    assert rules.seat.idle.seconds_left(0.0) is None
    assert _idle(rules, TIMES.idle - COUNTDOWN) == SeatOutcome(changed=True)
    assert rules.seat.idle.seconds_left(TIMES.idle - 20) == 20
    assert _idle(rules, TIMES.idle - 1) == SeatOutcome(), "told once"
    assert _idle(rules, TIMES.idle) == SeatOutcome(rest=True, changed=True)
    assert rules.seat.why == "idle"


@pytest.mark.parametrize("how", ["moves", "asks"])
def test_moving_or_asking_again_ends_the_countdown(how: str) -> None:
    rules = _rules(Standing.HOLDER)
    _idle(rules, TIMES.idle - 1)
    outcome = rules.moved("me", TIMES.idle - 1) if how == "moves" else rules.request("me", "operator", TIMES.idle - 1)
    assert outcome == SeatOutcome(changed=True)
    assert rules.seat.idle.seconds_left(TIMES.idle) is None
    assert _idle(rules, TIMES.idle + 1) == SeatOutcome()


def test_what_others_send_does_not_end_the_countdown() -> None:
    rules = _rules(Standing.HOLDER)
    assert rules.moved("other", TIMES.idle - 1) == SeatOutcome()
    rules.seat.neutral("other")
    assert not rules.seat.may_move("me")
    assert _idle(rules, TIMES.idle).rest


@pytest.mark.parametrize("what", OFFER_ENDS)
def test_the_end_of_the_offer_ends_the_turn_of_the_policy_and_concerns_no_person(what: SeatInput) -> None:
    rules = _rules(Standing.POLICY)
    assert rules.end_offer(what, NOW) == SeatOutcome(rest=True, changed=True)
    assert (rules.seat.holder, rules.seat.why, rules.seat.offer) == ("", what.value, None)
    assert rules.end_offer(what, NOW) == SeatOutcome()
    rules = _rules(Standing.HOLDER)
    assert rules.end_offer(what, NOW) == SeatOutcome()
    assert rules.seat.holds("me")


def test_an_offer_that_no_policy_takes_ends_as_a_request_does() -> None:
    rules = SeatRules(ControlSeat(TIMES))
    rules.offer_to_policies("me", "operator", "link", NOW)
    rules.attended("link", NOW + TIMES.claim)
    assert list(rules.expire(NOW + TIMES.claim - 0.1)) == []
    assert list(rules.expire(NOW + TIMES.claim)) == [SeatOutcome(changed=True)]
    assert rules.request("other", "policy", NOW + TIMES.claim).refusal is not None


def test_a_policy_whose_person_falls_silent_loses_the_seat_within_the_heartbeat_time() -> None:
    rules = _rules(Standing.POLICY)
    rules.attended("link", NOW, round_trip=0.5)
    rules.attended("another link", NOW + 10)
    for now, outcomes in ((NOW + 4.9, []), (NOW + 5.0, [SeatOutcome(rest=True, changed=True)])):
        rules.heard("other", now)
        assert list(rules.expire(now)) == outcomes
    assert rules.seat.why == "nobody attends"


def test_a_person_offers_only_a_seat_that_is_free_or_their_own_and_that_nobody_asks_for() -> None:
    rules = _rules(Standing.CLAIMANT)
    for peer, role, reason in (
        ("me", "operator", "seat_taken"),
        ("third", "supervisor", "seat_taken"),
        ("third", "observer", "not_allowed"),
        ("third", "policy", "not_allowed"),
        ("other", "operator", "seat_taken"),  # its own, but somebody waits for it
    ):
        refusal = rules.offer_to_policies(peer, role, "link", NOW).refusal  # type: ignore[arg-type]
        assert refusal is not None
        assert refusal.reason == reason
    assert (rules.seat.holder, rules.seat.offer) == ("other", None)


def test_another_person_may_become_responsible_for_the_policy_that_drives() -> None:
    rules = _rules(Standing.POLICY)
    assert rules.offer_to_policies("second", "operator", "second link", NOW) == SeatOutcome(changed=True)
    assert rules.seat.holds("other")
    assert rules.person_left("link", NOW) == SeatOutcome()
    assert rules.person_left("second link", NOW) == SeatOutcome(rest=True, changed=True)


def test_a_policy_does_not_stay_by_asking_again() -> None:
    rules = _rules(Standing.POLICY)
    rules.heard("other", TIMES.idle)
    rules.attended("link", TIMES.idle)
    rules.request("other", "policy", TIMES.idle - 1)
    assert list(rules.expire(TIMES.idle)) == [SeatOutcome(rest=True, changed=True)]
    assert rules.seat.why == "idle"

"""A pairing code works once, for minutes, with few tries."""

from typing import get_args

from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from lockstep.protocol.dial_in import TRUSTED, PairingCode, PairingHello, PairingSecret
from lockstep.server.robot.pairing_offer import (
    MAX_TRIES,
    OFFER_SECONDS,
    Exchange,
    OfferState,
    Paired,
    PairingOffer,
    Refusal,
    RefusalName,
)

SALT = bytes(16)
CODE = PairingCode("K7", "3F9QW2MXBD")
SECRET = PairingSecret(CODE, SALT)
WRONG = PairingSecret(PairingCode("K7", "2222222222"), SALT)
PIN = "sha256:" + "a" * 64


def hello(pin: str = PIN, place: str = CODE.place) -> PairingHello:
    return PairingHello(place=place, nonce=b"r" * 32, pin=pin, robot="planar")


def opened(now: float = 0.0) -> PairingOffer:
    offer = PairingOffer()
    offer.offer(CODE, SALT, SECRET, now)
    return offer


def begun(offer: PairingOffer, now: float = 1.0, pin: str = PIN) -> Exchange:
    outcome = offer.begin(hello(pin), now)
    assert not isinstance(outcome, Refusal)
    return outcome[0]


def proof(exchange: Exchange, secret: PairingSecret = SECRET) -> bytes:
    return secret.robot_proof(exchange.hello.nonce, exchange.nonce, exchange.hello.pin)


def name_of(outcome: object) -> RefusalName:
    assert isinstance(outcome, Refusal)
    assert outcome.detail
    return outcome.name


def test_the_right_code_pairs_and_both_sides_have_the_same_key() -> None:
    offer = opened()
    exchange = begun(offer)
    paired = offer.prove(exchange, proof(exchange), PIN, 2.0)
    assert isinstance(paired, Paired)
    assert paired.key.reveal() == SECRET.link_key(b"r" * 32, exchange.nonce, PIN).reveal()
    assert paired.proof == SECRET.console_proof(b"r" * 32, exchange.nonce, PIN)
    assert offer.state(2.0) == "paired"


def test_a_code_pairs_once_even_when_two_robots_were_challenged() -> None:
    offer = opened()
    first, second = begun(offer), begun(offer)
    assert isinstance(offer.prove(first, proof(first), PIN, 2.0), Paired)
    assert name_of(offer.prove(second, proof(second), PIN, 2.0)) == "code_used"
    assert name_of(offer.begin(hello(), 3.0)) == "code_used"


def test_the_same_exchange_pairs_once() -> None:
    offer = opened()
    exchange = begun(offer)
    offer.prove(exchange, proof(exchange), PIN, 2.0)
    assert name_of(offer.prove(exchange, proof(exchange), PIN, 2.0)) == "code_used"


def test_a_code_ends_after_few_wrong_proofs_and_the_right_one_comes_too_late_then() -> None:
    offer = opened()
    late = begun(offer)
    for left in range(MAX_TRIES - 1, -1, -1):
        exchange = begun(offer)
        assert name_of(offer.prove(exchange, proof(exchange, WRONG), PIN, 2.0)) == "wrong_code"
        assert offer.tries == left
    assert name_of(offer.begin(hello(), 3.0)) == "too_many_tries"
    assert name_of(offer.prove(late, proof(late), PIN, 3.0)) == "too_many_tries"


def test_a_code_ends_with_its_time_also_for_a_robot_that_was_challenged_before() -> None:
    offer = opened()
    exchange = begun(offer, OFFER_SECONDS - 0.1)
    assert name_of(offer.prove(exchange, proof(exchange), PIN, OFFER_SECONDS)) == "code_expired"
    assert name_of(offer.begin(hello(), OFFER_SECONDS + 1)) == "code_expired"
    assert offer.seconds(OFFER_SECONDS + 1) == 0.0


def test_a_robot_that_saw_another_certificate_is_refused_even_with_the_right_code() -> None:
    offer = opened()
    exchange = begun(offer, pin="sha256:" + "b" * 64)
    assert name_of(offer.prove(exchange, proof(exchange), PIN, 2.0)) == "wrong_certificate"


def test_a_console_that_does_not_know_its_certificate_takes_only_robots_that_have_checked_it() -> None:
    offer = opened()
    seen = begun(offer)
    assert name_of(offer.prove(seen, proof(seen), None, 2.0)) == "wrong_certificate"
    checked = begun(offer, pin=TRUSTED)
    assert isinstance(offer.prove(checked, proof(checked), None, 2.0), Paired)


def test_a_proof_of_an_earlier_code_is_worth_nothing_for_the_next() -> None:
    offer = opened()
    exchange = begun(offer)
    offer.offer(CODE, SALT, PairingSecret(CODE, b"s" * 16), 2.0)
    assert name_of(offer.prove(exchange, proof(exchange), PIN, 3.0)) == "not_pairing"
    assert offer.tries == MAX_TRIES


def test_another_place_is_refused_and_costs_no_try() -> None:
    offer = opened()
    assert name_of(offer.begin(hello(place="22"), 1.0)) == "not_pairing"
    assert (offer.tries, offer.refused) == (MAX_TRIES, "")


def test_a_withdrawn_code_is_gone() -> None:
    offer = opened()
    exchange = begun(offer)
    offer.withdraw()
    assert offer.state(2.0) == "none"
    assert name_of(offer.prove(exchange, proof(exchange), PIN, 2.0)) == "not_pairing"


class OfferLife(RuleBasedStateMachine):
    """Whatever happens, in any order: no robot is paired but by the open code, and by each code one at most."""

    @initialize()
    def begin(self) -> None:
        self.offer, self.now = PairingOffer(), 0.0
        self.codes = self.paired = self.wrong = 0
        self.exchanges: list[tuple[int, Exchange]] = []
        self.opened_at = 0.0

    @rule()
    def wait(self) -> None:
        self.now += OFFER_SECONDS / 4

    @rule()
    def opens(self) -> None:
        self.codes += 1
        self.paired = self.wrong = 0
        self.opened_at = self.now
        self.offer.offer(CODE, SALT, SECRETS[self.codes % 2], self.now)

    @rule()
    def withdraws(self) -> None:
        self.offer.withdraw()

    @rule()
    def comes(self) -> None:
        outcome = self.offer.begin(hello(), self.now)
        if not isinstance(outcome, Refusal):
            self.exchanges.append((self.codes, outcome[0]))

    @precondition(lambda self: self.exchanges)
    @rule()
    def proves_wrongly(self) -> None:
        code, exchange = self.exchanges[-1]
        outcome = self.offer.prove(exchange, proof(exchange, WRONG), PIN, self.now)
        self.wrong += code == self.codes and name_of(outcome) == "wrong_code"

    @precondition(lambda self: self.exchanges)
    @rule()
    def proves(self) -> None:
        code, exchange = self.exchanges.pop(0)
        outcome = self.offer.prove(exchange, proof(exchange, exchange.secret), PIN, self.now)
        if isinstance(outcome, Paired):
            assert exchange.secret is SECRETS[self.codes % 2]
            assert self.now < self.opened_at + OFFER_SECONDS
            self.paired += 1

    @invariant()
    def keeps_its_bounds(self) -> None:
        assert self.paired <= 1
        assert self.wrong <= MAX_TRIES
        assert self.offer.state(self.now) in get_args(OfferState)
        assert 0 <= self.offer.tries <= MAX_TRIES


SECRETS = (SECRET, PairingSecret(CODE, b"s" * 16))

TestOfferLife = OfferLife.TestCase
TestOfferLife.settings = settings(max_examples=50, deadline=None)

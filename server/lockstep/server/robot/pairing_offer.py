"""The rules of pairing at the console: one code at a time, once, for minutes, with few tries. No I/O, no clock.

Call `offer` with a fresh code; for each robot that comes `ended`, `begin`, then `prove`. `now` is monotonic, s.
"""

import secrets
from typing import Literal, NamedTuple

from lockstep.protocol.dial_in import (
    NONCE_BYTES,
    TRUSTED,
    PairingChallenge,
    PairingCode,
    PairingHello,
    PairingSecret,
)
from lockstep.protocol.link_secret import LinkSecret

__all__ = ["MAX_TRIES", "OFFER_SECONDS", "Exchange", "OfferState", "Paired", "PairingOffer", "Refusal", "RefusalName"]

OFFER_SECONDS = 600.0
MAX_TRIES = 5  # of 30^10 codes

OfferState = Literal["none", "waiting", "paired", "expired", "too_many_tries"]
RefusalName = Literal["not_pairing", "code_expired", "code_used", "too_many_tries", "wrong_code", "wrong_certificate"]

WORDS: dict[RefusalName, str] = {
    "not_pairing": "no code with these first two signs is open here: press “Pair a robot” on the page",
    "code_expired": "the code is too old: press “Pair a robot” on the page for a new one",
    "code_used": "a robot was paired with this code already: press “Pair a robot” on the page for a new one",
    "too_many_tries": "the code was typed wrongly too often: press “Pair a robot” on the page for a new one",
    "wrong_code": "the code is not the one on the page",
    "wrong_certificate": "the robot saw another certificate than this console's. Somebody may be between the two; or a"
    " proxy is, whose certificate the robot has to trust: give its CA with --console-ca",
}
ENDED: dict[OfferState, RefusalName] = {
    "none": "not_pairing",
    "paired": "code_used",
    "expired": "code_expired",
    "too_many_tries": "too_many_tries",
}


class Refusal(NamedTuple):
    name: RefusalName

    @property
    def detail(self) -> str:
        return WORDS[self.name]


class Exchange(NamedTuple):
    """One robot that was challenged."""

    hello: PairingHello
    nonce: bytes
    secret: PairingSecret


class Paired(NamedTuple):
    key: LinkSecret
    robot: str
    proof: bytes  # for the robot


class PairingOffer:
    """The code that is open now, if any, and what became of it.

    Attributes:
        tries: that are left
        refused: why the newest robot was refused; "" if none was
    """

    def __init__(self) -> None:
        self.tries = 0
        self.refused: RefusalName | Literal[""] = ""
        self._state: OfferState = "none"
        self._place = ""
        self._salt = b""
        self._secret: PairingSecret | None = None  # None: no code was ever open
        self._until = 0.0

    def state(self, now: float) -> OfferState:
        if self._state == "waiting" and now >= self._until:
            self._state = "expired"
        return self._state

    def ended(self, now: float) -> Refusal | None:
        """Return why no code is open; None while one is."""
        state = self.state(now)
        return None if state == "waiting" else Refusal(ENDED[state])

    def seconds(self, now: float) -> float:
        """Return how long the code is good for; 0 without one."""
        return max(0.0, self._until - now) if self.state(now) == "waiting" else 0.0

    def offer(self, code: PairingCode, salt: bytes, secret: PairingSecret, now: float) -> None:
        """Open a code, in place of any other. `secret`: of the code and the salt."""
        self._place, self._salt, self._secret = code.place, salt, secret
        self._until, self.tries, self.refused = now + OFFER_SECONDS, MAX_TRIES, ""
        self._state = "waiting"

    def withdraw(self) -> None:
        """Close the code; robots under way are refused."""
        self._state, self._secret, self.tries, self.refused = "none", None, 0, ""

    def begin(self, hello: PairingHello, now: float) -> tuple[Exchange, PairingChallenge] | Refusal:
        """Challenge a robot. It costs no try: a stranger proves nothing here, and learns nothing."""
        if not LinkSecret.same(hello.place.encode(), self._place.encode()):
            return Refusal("not_pairing")
        state = self.state(now)
        if state != "waiting" or self._secret is None:
            return self._refuse(ENDED.get(state, "not_pairing"))
        exchange = Exchange(hello, secrets.token_bytes(NONCE_BYTES), self._secret)
        return exchange, PairingChallenge(nonce=exchange.nonce, salt=self._salt)

    def prove(self, exchange: Exchange, proof: bytes, pin: str | None, now: float) -> Paired | Refusal:
        """Judge a robot's proof. The first right one closes the code.

        `pin`: of this console's own certificate; None: it does not know what robots see (no TLS, or by a proxy).
        """
        hello, nonce, secret = exchange
        state = self.state(now)
        if state != "waiting" or secret is not self._secret:
            return self._refuse(ENDED.get(state, "not_pairing"))
        if not LinkSecret.same(proof, secret.robot_proof(hello.nonce, nonce, hello.pin)):
            return self._fail("wrong_code")
        if hello.pin not in (TRUSTED, pin):
            return self._fail("wrong_certificate")
        self._state, self._secret = "paired", None
        return Paired(
            secret.link_key(hello.nonce, nonce, hello.pin),
            hello.robot,
            secret.console_proof(hello.nonce, nonce, hello.pin),
        )

    def _fail(self, name: RefusalName) -> Refusal:
        self.tries -= 1
        if self.tries <= 0:
            self._state, self._secret = "too_many_tries", None
        return self._refuse(name)

    def _refuse(self, name: RefusalName) -> Refusal:
        self.refused = name
        return Refusal(name)

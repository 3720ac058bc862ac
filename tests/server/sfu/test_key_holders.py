"""When the key of a publication has to become invalid."""

from lockstep.server.auth.tokens import Identity
from lockstep.server.sfu.key_holders import RENEW_SECONDS, STRAY_SECONDS, KeyHolders

ANN = Identity("observer", "Ann", "ann", 5000.0)
LATER = RENEW_SECONDS + STRAY_SECONDS + 1.0


def test_it_does_when_the_link_of_a_holder_ends_and_is_forgotten_with_its_key() -> None:
    ended: set[tuple[str, float]] = set()
    holders = KeyHolders(lambda link, expires: (link, expires) in ended)
    holders.begin(0.0)
    holders.add(ANN, 0.0)
    assert not holders.any_has_ended()
    ended.add(("ann", 5000.0))
    assert holders.any_has_ended()
    holders.begin(1.0)
    assert not holders.any_has_ended()


def test_it_does_when_a_holder_has_left_but_not_again_and_again() -> None:
    holders = KeyHolders(lambda link, expires: False)
    holders.begin(0.0)
    holders.add(ANN, 0.0)
    assert not holders.has_strays({"ann"}, LATER), "it takes part"
    assert not holders.has_strays((), LATER + STRAY_SECONDS), "it may come back"
    assert holders.has_strays((), LATER + STRAY_SECONDS + 1.0)
    holders.begin(LATER)
    holders.add(ANN, LATER)
    assert not holders.has_strays((), LATER + RENEW_SECONDS)
    assert holders.has_strays((), LATER + RENEW_SECONDS + 1.0)

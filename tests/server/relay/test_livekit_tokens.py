"""Tokens for LiveKit, looked at by LiveKit's own verifier."""

import time

import jwt
import pytest
from livekit.api import TokenVerifier

from server.relay.livekit_tokens import CLOCK_SECONDS, GOOD_SECONDS, LiveKitKeys

KEY, SECRET = "console", "only for tests: a secret of 32 bytes or more"
KEYS = LiveKitKeys(KEY, SECRET)


def test_the_publisher_makes_its_room_and_sends_there_and_takes_nothing() -> None:
    claims = TokenVerifier(KEY, SECRET).verify(KEYS.publisher_token("demo-1", "lockstep", _now()))
    assert claims.identity == "lockstep"
    video = claims.video
    assert video is not None
    assert (video.room, video.room_join, video.room_create) == ("demo-1", True, True)
    assert (video.can_publish, video.can_publish_data, video.can_subscribe) == (True, True, False)
    assert not video.room_admin
    assert not video.room_list


def test_an_observer_takes_and_sends_nothing_and_the_others_do_not_hear_of_it() -> None:
    video = TokenVerifier(KEY, SECRET).verify(KEYS.observer_token("demo-1", "observer-1", _now())).video
    assert video is not None
    assert (video.room, video.room_join, video.hidden) == ("demo-1", True, True)
    assert (video.can_publish, video.can_publish_data, video.can_subscribe) == (False, False, True)
    assert not video.room_create
    assert not video.room_admin
    assert not video.can_update_own_metadata


def test_a_token_is_good_for_a_minute_and_for_clocks_that_are_a_little_late() -> None:
    token = KEYS.observer_token("demo-1", "observer-1", 1_000_000.0)
    claims = jwt.decode(token, options={"verify_signature": False})
    assert claims["nbf"] == 1_000_000 - CLOCK_SECONDS
    assert claims["exp"] == 1_000_000 + GOOD_SECONDS
    with pytest.raises(jwt.ExpiredSignatureError):
        TokenVerifier(KEY, SECRET).verify(token)


def test_a_token_of_another_key_or_secret_is_refused() -> None:
    token = KEYS.observer_token("demo-1", "observer-1", _now())
    with pytest.raises(jwt.InvalidSignatureError):
        TokenVerifier(KEY, SECRET[::-1]).verify(token)
    with pytest.raises(jwt.InvalidIssuerError):
        TokenVerifier("another", SECRET).verify(token)


def test_keys_show_nothing_of_themselves() -> None:
    assert SECRET not in repr(KEYS)


def _now() -> float:
    return time.time()

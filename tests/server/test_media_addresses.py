"""Addresses that media cannot use are named before anything runs."""

import pytest

from server.media_addresses import NoSuchAddress, check_media_addresses


def test_addresses_of_this_machine_are_taken() -> None:
    check_media_addresses(["127.0.0.1", "127.0.0.2"])


@pytest.mark.parametrize("address", ["203.0.113.1", "2001:db8::1"])
def test_an_outer_address_is_refused_and_the_words_say_where_it_belongs(address: str) -> None:
    with pytest.raises(NoSuchAddress, match=f"media cannot use {address} .*--advertise"):
        check_media_addresses(["127.0.0.1", address])

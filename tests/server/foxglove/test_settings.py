"""The Foxglove server asks nobody for a link, so other machines reach it only where that is said."""

import pytest
from pydantic import ValidationError

from lockstep.server.foxglove.settings import FoxgloveSettings


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1"])
def test_an_address_that_others_reach_has_to_be_called_public(host: str) -> None:
    with pytest.raises(ValidationError, match="LOCKSTEP_FOXGLOVE__PUBLIC"):
        FoxgloveSettings(port=8765, host=host)
    assert FoxgloveSettings(port=8765, host=host, public=True).host == host


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "127.0.0.2"])
def test_loopback_needs_no_more(host: str) -> None:
    assert FoxgloveSettings(port=8765, host=host).host == host


def test_it_is_off_unless_a_port_is_named() -> None:
    assert FoxgloveSettings().port is None


def test_a_name_is_no_address() -> None:
    with pytest.raises(ValidationError, match="not an IP address"):
        FoxgloveSettings(port=8765, host="console.example.org")

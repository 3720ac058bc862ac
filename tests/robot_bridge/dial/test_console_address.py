import pytest

from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.errors import BadConsoleAddress


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("wss://console.example.org", "wss://console.example.org"),
        ("https://console.example.org:8443/", "wss://console.example.org:8443"),
        (" wss://[2001:db8::1]:8000/robots/left/ ", "wss://[2001:db8::1]:8000/robots/left"),
        ("ws://127.0.0.1:8000", "ws://127.0.0.1:8000"),
        ("http://localhost:8000", "ws://localhost:8000"),
    ],
)
def test_an_address_is_read_as_people_copy_it(text: str, url: str) -> None:
    assert ConsoleAddress.parse(text).url == url


@pytest.mark.parametrize(
    "text",
    [
        "",
        "console.example.org",
        "tcp://10.0.0.5:5600",
        "wss://",
        "wss://host:99999",
        "wss://host/?token=x",
        "wss://ann:secret@host",
        "ws://10.0.0.5:8000",
        "http://console.example.org",
        "wss://[::1",
    ],
)
def test_an_address_that_no_robot_should_dial_is_refused_by_name(text: str) -> None:
    with pytest.raises(BadConsoleAddress):
        ConsoleAddress.parse(text)


def test_each_link_has_its_own_path() -> None:
    assert ConsoleAddress.parse("wss://host/robots/left").path("media") == "wss://host/robots/left/dial/media"

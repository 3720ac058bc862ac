from pathlib import Path

import pytest
from prometheus_client import CollectorRegistry
from pydantic import ValidationError

from lockstep.server.federation import check_board, make_board
from lockstep.server.federation.errors import BoardUnusable
from lockstep.server.federation.memory_board import MemoryBoard
from lockstep.server.federation.settings import BoardSettings, board_place
from lockstep.server.settings import Settings
from tests.server.federation.boards import KEY, FakeHost, FakeLinks

SECRET = "a-password"


@pytest.mark.parametrize(
    "url",
    ["redis://h", f"rediss://user:{SECRET}@h:6380/2?ssl_ca_certs=/ca.pem", "unix:///run/redis.sock", "redis://[::1]:1"],
)
def test_addresses_of_redis_are_taken(url: str) -> None:
    settings = Settings(board=url)  # type: ignore[arg-type]
    assert settings.board_url == url
    assert SECRET not in repr(settings)
    assert SECRET not in board_place(url)


@pytest.mark.parametrize(
    "url",
    [
        "http://h",
        f"redis://:{SECRET}@",
        f"redis://:{SECRET}@h:port",
        f"redis://:{SECRET}@h:0/",
        f"redis://h?password={SECRET}",
        f"redis://h?socket_timeout=1&x={SECRET}",
        "unix://",
        SECRET,
        f"redis://[{SECRET}",
    ],
)
def test_anything_else_is_refused_and_not_repeated(url: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Settings(board=url)  # type: ignore[arg-type]
    assert SECRET not in "".join(each["msg"] for each in refused.value.errors())


def test_without_a_board_the_console_is_alone(tmp_path: Path) -> None:
    settings = BoardSettings(board_file="", board="")  # type: ignore[arg-type]
    check_board(settings, "")
    board = make_board(settings, KEY, FakeHost(), FakeLinks(), "", CollectorRegistry())
    assert isinstance(board, MemoryBoard)


def test_a_board_needs_the_address_that_others_find_this_console_at() -> None:
    with pytest.raises(BoardUnusable, match="--public-url"):
        check_board(BoardSettings(board="redis://h"), "")  # type: ignore[arg-type]


def test_the_address_may_stand_in_a_file_whose_faults_are_named(tmp_path: Path) -> None:
    file = tmp_path / "board"
    settings = BoardSettings(board_file=file)
    with pytest.raises(BoardUnusable, match="No such file"):
        check_board(settings, "https://h")
    file.write_text(f"redis://:{SECRET}@h:port\n")
    with pytest.raises(BoardUnusable, match="the board is not redis://") as refused:
        check_board(settings, "https://h")
    assert SECRET not in str(refused.value)
    file.write_text(f"redis://:{SECRET}@h\n")
    check_board(settings, "https://h")
    assert settings.board_url == f"redis://:{SECRET}@h"


def test_without_the_package_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(BoardUnusable, match=r"pip install -e '\.\[redis\]'"):
        check_board(BoardSettings(board="redis://h"), "https://h")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["x" * 41, "a\nb"])
def test_a_consoles_name_can_be_shown(name: str) -> None:
    with pytest.raises(ValidationError):
        BoardSettings(console_name=name)

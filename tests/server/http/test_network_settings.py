from pathlib import Path

import pytest
from pydantic import ValidationError

from lockstep.server.settings import Settings

SECRET = "0123456789abcdef"


@pytest.mark.parametrize(
    "wrong",
    [
        {"public_url": "robot.example"},
        {"public_url": "ftp://robot.example"},
        {"public_url": "https://robot.example/path"},
        {"stun": "turn:robot.example"},
        {"stun": "stun:"},
        {"turn": "stun:robot.example", "turn_secret": SECRET},
        {"turn": "turn:robot.example"},
        {"turn": "turn:robot.example", "turn_secret": "short"},
        {"turn": "turn:a\r\nb", "turn_secret": SECRET},
        {"tls": "maybe"},
        {"tls_cert": "a.pem"},
        {"tls_key": "a.pem"},
        {"tls": "self-signed", "tls_cert": "a.pem", "tls_key": "b.pem"},
        {"turn_seconds": 1},
        {"turn_seconds": 601},
    ],
)
def test_what_cannot_work_is_refused_before_anything_runs(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Settings(**wrong)  # type: ignore[arg-type]


def test_empty_is_unset_as_compose_files_write_it(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("STUN", "TURN", "TURN_SECRET", "TURN_SECRET_FILE", "TLS", "TLS_CERT", "TLS_KEY", "PUBLIC_URL"):
        monkeypatch.setenv(f"LOCKSTEP_{name}", "")
    settings = Settings()
    assert (settings.turn, settings.stun, settings.public_url, settings.turn_key) == ((), (), "", "")


def test_the_environment_lists_servers_with_commas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_TURN", "turn:a.example, turns:b.example")
    monkeypatch.setenv("LOCKSTEP_TURN_SECRET", SECRET)
    assert Settings().turn == ("turn:a.example", "turns:b.example")


def test_the_turn_secret_can_stand_in_a_file_and_shows_nowhere(tmp_path: Path) -> None:
    file = tmp_path / "secret"
    file.write_text(SECRET + "\n")
    settings = Settings(turn="turn:a.example", turn_secret_file=file)  # type: ignore[arg-type]
    assert settings.turn_key == SECRET
    assert SECRET not in repr(Settings(turn="turn:a.example", turn_secret=SECRET))  # type: ignore[arg-type]


def test_own_names_are_those_that_people_were_given() -> None:
    settings = Settings(public_url="https://Robot.example:8443/", allowed_hosts="here.example,192.0.2.7")  # type: ignore[arg-type]
    assert settings.public_url == "https://Robot.example:8443"
    assert settings.own_names == ("robot.example", "here.example")

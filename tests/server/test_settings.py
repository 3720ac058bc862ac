import pytest
from pydantic import ValidationError

from lockstep.server.settings import Settings


def test_the_environment_sets_and_flags_override(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOCKSTEP_PORT", "9001")
    monkeypatch.setenv("LOCKSTEP_ICE_HOSTS", "10.0.0.1, 10.0.0.2")
    assert Settings().port == 9001
    assert Settings().ice_hosts == ("10.0.0.1", "10.0.0.2")
    assert Settings(port=0).port == 0


def test_an_empty_variable_is_an_unset_one(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SECRET", "STATE_DIR", "PUBLIC_URL"):
        monkeypatch.setenv(f"LOCKSTEP_{name}", "")
    settings = Settings()
    assert (settings.secret, settings.state_dir, settings.public_url) == (None, None, "")


@pytest.mark.parametrize(
    "wrong",
    [
        {"robot": "http://127.0.0.1:5600"},
        {"robot": "tcp://127.0.0.1"},
        {"robot": "tcp://127.0.0.1:99999"},
        {"secret": "short"},
        {"public_url": "robot.example.org"},
        {"ice_hosts": ("example.org",)},
        {"advertise": ("example.org",)},
        {"port": 65536},
        {"observer_feedback_hz": 0},
    ],
)
def test_a_setting_that_cannot_work_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Settings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("robot.example", False)],
)
def test_a_console_on_loopback_is_known_as_such(host: str, loopback: bool) -> None:
    assert Settings(host=host).bound_to_loopback is loopback


def test_the_robot_address_is_taken_apart() -> None:
    settings = Settings(robot="tcp://[::1]:5600")
    assert (settings.robot_host, settings.robot_port) == ("::1", 5600)

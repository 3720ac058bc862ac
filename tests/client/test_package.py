import inspect

import lockstep.client
from lockstep.client import errors


def test_the_package_root_exports_what_it_says() -> None:
    assert all(hasattr(lockstep.client, name) for name in lockstep.client.__all__)
    public = {
        name
        for name, value in vars(lockstep.client).items()
        if not name.startswith("_") and not inspect.ismodule(value)
    }
    assert public == set(lockstep.client.__all__)


def test_every_error_is_exported_and_has_one_base() -> None:
    for name in errors.__all__:
        assert name in lockstep.client.__all__
        assert issubclass(getattr(errors, name), lockstep.client.ConsoleError)


def test_a_refusal_says_its_reason() -> None:
    assert str(lockstep.client.CommandRefused("stopped", "by a visitor")) == "stopped: by a visitor"
    assert str(lockstep.client.SeatRefused("seat_taken")) == "seat_taken"


def test_a_refused_connection_says_what_to_do() -> None:
    error = lockstep.client.SignallingRefused(401, "unauthorized", "")
    assert "401 unauthorized" in str(error)
    assert "use a link" in str(error)

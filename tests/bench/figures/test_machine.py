import pytest

from lockstep.bench.figures import machine


def test_a_package_that_is_not_installed_has_no_version_among_the_facts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "PACKAGES", ("msgspec", "a-package-that-nobody-installed"))
    assert list(machine.machine_facts()["packages"]) == ["msgspec"]

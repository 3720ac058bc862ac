from typing import Any

from prometheus_client import CollectorRegistry, Counter
from structlog.testing import capture_logs

from lockstep.server.telemetry.faults import LOGGED_BURST, LOGGED_RATE, Faults


def _faults() -> tuple[Faults, CollectorRegistry, list[float]]:
    registry, now = CollectorRegistry(), [0.0]
    counter = Counter("lockstep_internal_errors", "", ["where"], registry=registry)
    return Faults(counter, lambda: now[0]), registry, now


def _count(registry: CollectorRegistry, where: str) -> float | None:
    return registry.get_sample_value("lockstep_internal_errors_total", {"where": where})


def test_every_fault_is_counted_and_a_place_that_goes_on_failing_does_not_flood_the_log() -> None:
    faults, registry, now = _faults()
    with capture_logs() as logs:
        for _ in range(1000):
            faults.caught("quality", ValueError("planted"))
        faults.caught("peer media", ValueError("other"), peer="a")
    assert (_count(registry, "quality"), _count(registry, "peer media")) == (1000, 1)
    assert [each["where"] for each in logs] == ["quality"] * LOGGED_BURST + ["peer media"]
    now[0] += 1 / LOGGED_RATE
    with capture_logs() as logs:
        faults.caught("quality", ValueError("planted"))
    assert len(logs) == 1


def test_what_nobody_awaited_is_a_fault_of_the_loop() -> None:
    faults, registry, _ = _faults()
    contexts: list[dict[str, Any]] = [{"message": "lost", "exception": ValueError("planted")}, {"message": "odd"}]
    with capture_logs() as logs:
        for context in contexts:
            faults.uncaught(object(), context)
    assert _count(registry, "loop") == 2
    assert [each["what"] for each in logs] == ["lost", "odd"]

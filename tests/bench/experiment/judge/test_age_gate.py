import pytest

from lockstep.bench.experiment.judge.age_gate import client_gate, count_by_age, passes
from lockstep.bench.experiment.judge.record import ClientRecord, Gate, Rendered
from lockstep.bench.experiment.observation import Look, Observation


def rendered(at: float, age: float | None, stamp: int | None = 10, feedback: int | None = 10) -> Rendered:
    return Rendered(at, stamp, None if stamp is None or feedback is None else feedback - stamp, feedback, age)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        (rendered(1.0, 0.02, stamp=10, feedback=100), True),  # young and far behind
        (rendered(1.0, 0.5), True),  # exactly half a second
        (rendered(1.0, 0.501), False),  # older, and of the same event
        (rendered(1.0, -0.003), True),  # from the future, by clocks a little apart
        (rendered(1.0, 0.005, stamp=20), True),  # it overtook the feedback and does not wait
        (rendered(1.0, None), False),  # of unknown age
        (rendered(1.0, 0.03, stamp=None, feedback=None), True),  # events need not be known
    ],
)
def test_a_gate_by_age_asks_only_for_the_age(entry: Rendered, expected: bool) -> None:
    assert passes("age", [entry]) == [entry] * expected


@pytest.mark.parametrize("gate", ["off", "event"])
def test_the_clients_own_gates_are_left_as_they_are(gate: Gate) -> None:
    old = rendered(1.0, 60.0)
    assert passes(gate, [old]) == [old]
    assert client_gate(gate) == gate
    counts = {"received": 3, "rendered": 2, "discarded": 1, "held": 1, "violations": 0}
    assert count_by_age(ClientRecord("watcher", "headless", gate, "feedback", False, 2), "front", counts) == counts


async def test_a_viewer_by_age_is_a_viewer_without_a_gate_whose_old_pictures_count_as_discarded() -> None:
    record = ClientRecord("watcher", "headless", "age", "feedback", False, 2)
    assert client_gate(record.gate) == "off"
    seen = [rendered(1.0, 0.1), rendered(2.0, 0.9)]

    async def look() -> Look:
        return Look([], {"front": list(seen)}, {})

    observation = Observation(record, look)
    await observation.begin()
    seen += [rendered(3.0, 0.8), rendered(4.0, 0.2, stamp=5), rendered(5.0, 0.3)]
    await observation.end()
    assert [each.at for each in record.rendered["front"]] == [1.0, 4.0, 5.0]
    own = {"received": 3, "rendered": 3, "discarded": 0, "held": 0, "violations": 1}
    expected = {"received": 3, "rendered": 2, "discarded": 1, "held": 0, "violations": 1}
    assert count_by_age(record, "front", own) == expected

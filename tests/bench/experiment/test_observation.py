import json
from pathlib import Path

from lockstep.bench.experiment.judge.record import Arrival, ClientRecord, Rendered
from lockstep.bench.experiment.judge.robot_log import read_robot_log
from lockstep.bench.experiment.observation import Look, Observation


def picture(at: float) -> Rendered:
    return Rendered(at, 1, 0, 1, None)


async def test_each_entry_of_a_log_is_taken_once_and_what_was_before_the_run_is_left_out() -> None:
    record = ClientRecord("operator", "headless", "event", "feedback", True, 4)
    seen = [picture(1), picture(2)]

    async def look() -> Look:
        return Look([Arrival(each.at, 7) for each in seen], {"overview": list(seen)}, {"rendered": len(seen)})

    observation = Observation(record, look)
    await observation.begin()
    seen += [picture(3), picture(4)]
    await observation.end()
    await observation.end()
    assert [each.at for each in record.rendered["overview"]] == [2, 3, 4]
    assert [each.at for each in record.feedbacks] == [2, 3, 4]
    assert (record.statistics_before, record.statistics) == ({"rendered": 2}, {"rendered": 4})


def test_of_the_bridges_log_what_happened_during_the_run_is_read(tmp_path: Path) -> None:
    lines = [
        {"kind": "executed", "time": 1.0, "event": 2},
        {"kind": "executed", "time": 2.0, "event": 3},
        {"kind": "feedback", "time": 2.1, "event": 3},
        {"kind": "feedback", "time": 2.6, "event": 3},
        {"kind": "media", "time": 2.3, "event": 3, "stream": "front", "captured": 2.2},
        {"kind": "media", "time": 9.3, "event": 3, "stream": "front", "captured": 9.2},
        {"kind": "start", "time": 2.0, "event": 1},
    ]
    log = tmp_path / "events.jsonl"
    log.write_text("".join(json.dumps(line) + "\n" for line in lines) + '{"kind": "exec')
    found = read_robot_log(log, 1.5, 5.0)
    assert found.executed == [Arrival(2.0, 3)]
    assert found.answered == [Arrival(2.1, 3)]
    assert found.captured == {"front": [Arrival(2.2, 3)]}

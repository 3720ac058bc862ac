import sys

import pytest

from lockstep.bench.harness.processes import ProcessFailed, running_process


async def test_a_process_is_ready_after_its_first_line_and_gone_on_leaving() -> None:
    script = "import sys; print('{\"ready\": 1}', flush=True); print('{\"said\": %s}' % input()); sys.stdin.read()"
    async with running_process(sys.executable, "-c", script) as (process, ready):
        assert ready == {"ready": 1}
        assert process.cpu_seconds() >= 0
    with pytest.raises(FileNotFoundError):
        process.cpu_seconds()


async def test_a_question_gets_the_next_line_as_its_answer() -> None:
    script = "print('{}', flush=True)\nwhile True: print('{\"said\": %s}' % input(), flush=True)"
    async with running_process(sys.executable, "-c", script) as (process, _):
        assert await process.ask("41", 10) == {"said": 41}
        assert await process.ask("42", 10) == {"said": 42}


async def test_processor_time_grows_with_work() -> None:
    script = "print('{}', flush=True); input(); sum(range(20_000_000)); print('{}', flush=True); input()"
    async with running_process(sys.executable, "-c", script) as (process, _):
        before = process.cpu_seconds()
        await process.ask("", 30)
        assert process.cpu_seconds() > before


async def test_a_paused_process_is_ended_too() -> None:
    async with running_process(sys.executable, "-c", "print('{}', flush=True); input()") as (process, _):
        process.pause()
    with pytest.raises(FileNotFoundError):
        process.cpu_seconds()


async def test_a_process_that_ends_before_it_is_ready_says_why() -> None:
    with pytest.raises(ProcessFailed) as failure:
        async with running_process(sys.executable, "-c", "raise SystemExit('no robot here')"):
            raise AssertionError("not reached")
    assert "no robot here" in str(failure.value)

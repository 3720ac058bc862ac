import asyncio
import sys

import pytest

from lockstep.bench.harness.processes import ProcessFailed, running_process, started


async def test_a_process_is_ready_after_its_first_line_and_gone_on_leaving() -> None:
    script = "import sys; print('{\"ready\": 1}', flush=True); print('{\"said\": %s}' % input()); sys.stdin.read()"
    async with running_process(sys.executable, "-c", script) as (process, ready):
        assert ready == {"ready": 1}
        assert process.usage.cpu_seconds() >= 0
    with pytest.raises(FileNotFoundError):
        process.usage.cpu_seconds()


async def test_a_question_gets_the_next_line_as_its_answer() -> None:
    script = "print('{}', flush=True)\nwhile True: print('{\"said\": %s}' % input(), flush=True)"
    async with running_process(sys.executable, "-c", script) as (process, _):
        assert await process.ask("41", 10) == {"said": 41}
        assert await process.ask("42", 10) == {"said": 42}


async def test_processor_time_grows_with_work() -> None:
    script = "print('{}', flush=True); input(); sum(range(20_000_000)); print('{}', flush=True); input()"
    async with running_process(sys.executable, "-c", script) as (process, _):
        before = process.usage.cpu_seconds()
        await process.ask("", 30)
        assert process.usage.cpu_seconds() > before


async def test_a_paused_process_is_ended_too() -> None:
    async with running_process(sys.executable, "-c", "print('{}', flush=True); input()") as (process, _):
        process.pause()
    with pytest.raises(FileNotFoundError):
        process.usage.cpu_seconds()


async def test_a_process_that_ends_before_it_is_ready_says_why() -> None:
    with pytest.raises(ProcessFailed) as failure:
        async with running_process(sys.executable, "-c", "raise SystemExit('no robot here')"):
            raise AssertionError("not reached")
    assert "no robot here" in str(failure.value)


async def test_a_line_is_awaited_wherever_it_is_written_and_errors_are_kept_apart() -> None:
    script = "import sys; print('one {', flush=True); print('two', file=sys.stderr, flush=True); input()"
    async with started([sys.executable, "-c", script]) as process:
        assert await process.line("^t.o$") == "two"
        assert await process.line("one") == "one {"
        assert list(process.output.errors) == ["two"]
        assert list(process.output.unread) == ["one {"]
        with pytest.raises(ProcessFailed):
            await process.line("three", 0.05)


async def test_what_a_process_has_said_when_it_ended_is_whole() -> None:
    script = "for number in range(300): print('{\"number\": %d}' % number)"
    async with started([sys.executable, "-c", script]) as process:
        assert await process.wait() == 0
        assert [each["number"] for each in process.output.said()] == list(range(300))
        with pytest.raises(ProcessFailed, match="did not do its work"):
            await process.line("300")


async def test_a_server_is_awaited_until_it_listens_and_one_that_ends_is_told() -> None:
    script = """
import socket, sys
with socket.create_server(("127.0.0.1", 0)) as server:
    print('{"port": %d}' % server.getsockname()[1], flush=True)
    input()
print("it ends", file=sys.stderr)
"""
    async with running_process(sys.executable, "-c", script) as (process, ready):
        await process.listening(ready["port"])
        assert process.process.stdin is not None
        process.process.stdin.write(b"\n")
        await process.wait()
        with pytest.raises(ProcessFailed, match="it ends"):
            await process.listening(ready["port"])


async def test_a_process_that_does_not_end_by_itself_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.bench.harness.processes.STOP_SECONDS", 0.2)
    stubborn = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('{}', flush=True); input()"
    async with running_process(sys.executable, "-c", stubborn) as (process, _):
        assert not await process.end()
    async with running_process(sys.executable, "-c", "print('{}', flush=True); input()") as (process, _):
        assert await process.end()
        assert await asyncio.wait_for(process.wait(), 30) == -15

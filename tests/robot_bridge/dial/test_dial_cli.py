"""`lockstep robot … --console wss://…` and `lockstep serve --robot dial-in` as their users run them."""

import asyncio
import ssl
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx

from lockstep.bench.harness.processes import running_process
from lockstep.bench.harness.stack import LOCKSTEP
from tests.support.stack import Stack, running_console
from tests.waiting import PATIENCE, eventually

TLS = ("--tls", "self-signed", "--host", "127.0.0.1")


class Api:
    """A supervisor's requests."""

    def __init__(self, stack: Stack) -> None:
        token = stack.supervisor.partition("#token=")[2]
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        headers = {"Authorization": f"Bearer {token}"}
        self._http = httpx.AsyncClient(
            base_url=stack.console, verify=context, headers=headers, trust_env=False, timeout=PATIENCE
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._http.aclose()

    async def ask(self, method: str, path: str) -> dict[str, Any]:
        answer = await self._http.request(method, path)
        assert answer.is_success, answer.text
        found: dict[str, Any] = answer.json()
        return found

    async def until(self, state: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while (await self.ask("GET", "/api/dial-in"))["state"] != state:  # noqa: ASYNC110
                await asyncio.sleep(0.05)


def arguments(stack: Stack, directory: Path, *more: str) -> tuple[str, ...]:
    url = stack.console.replace("http", "ws", 1)
    return (LOCKSTEP, "robot", "planar", "--json", "--console", url, "--state-dir", str(directory / "robot"), *more)


async def ended(*command: str) -> tuple[int | None, str]:
    process = await asyncio.create_subprocess_exec(
        *command, stdin=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    _, errors = await process.communicate()
    return process.returncode, errors.decode()


async def test_a_robot_pairs_by_a_code_and_comes_back_without_it_until_it_is_forgotten(tmp_path: Path) -> None:
    async with running_console(tmp_path, "dial-in", tmp_path / "events", TLS) as stack, Api(stack) as api:
        made = await api.ask("POST", "/api/dial-in/code")
        assert made["command"].startswith("lockstep robot NAME --console wss://127.0.0.1:")
        pairing = arguments(stack, tmp_path, "--pair", made["code"])
        async with running_process(*pairing) as (_, ready):
            assert ready == {"console": stack.console.replace("http", "ws", 1)}
            await api.until("connected")
        await api.until("away")
        assert (tmp_path / "robot" / "console.json").stat().st_mode & 0o777 == 0o600
        async with running_process(*arguments(stack, tmp_path)):
            await api.until("connected")
        async with running_process(*pairing) as (robot, _):  # a service keeps its command line
            await api.until("connected")
            await api.ask("DELETE", "/api/dial-in/robot")
            await api.until("unpaired")
            await eventually(lambda: any("robot_unknown" in line for line in robot.output.errors))


async def test_a_command_that_cannot_be_meant_says_what_to_do_and_ends_with_2(tmp_path: Path) -> None:
    async with running_console(tmp_path, "dial-in", tmp_path / "events", TLS) as stack, Api(stack) as api:
        code, said = await ended(*arguments(stack, tmp_path))
        assert (code, "Pair a robot" in said) == (2, True)
        await api.ask("POST", "/api/dial-in/code")
        code, said = await ended(*arguments(stack, tmp_path, "--pair", "22-22222-22222"))
        assert code == 2
        assert "not_pairing" in said or "wrong_code" in said
        code, said = await ended(*arguments(stack, tmp_path, "--pair", "hello"))
        assert (code, "a pairing code has 12" in said) == (2, True)
        code, said = await ended(LOCKSTEP, "robot", "planar", "--console", "ws://192.0.2.1:80")
        assert (code, "TLS" in said) == (2, True)
        assert not (tmp_path / "robot" / "console.json").exists()

"""Bridge and console as processes, the link between them, people, and the judge of what the robot did.

Everything can fail as it does in life: processes are killed, the link breaks, disks fill up or are gone, and somebody
at the robot turns the switch.
"""

import asyncio
import json
import os
import resource
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, TypeVar

from lockstep.bench.harness.tcp_path import TcpPath
from lockstep.client.console import Console
from lockstep.client.errors import ConnectFailed, ConsoleLost
from lockstep.server.robot.console_name import console_name
from tests.robot_bridge.bridge_model import MotionWitness
from tests.server.rig import PATIENCE

__all__ = ["ConsoleProcess", "Judge", "Player", "Robot"]

START_SECONDS = 40.0  # a busy machine that imports everything
END_SECONDS = 30.0
LITTLE = 40  # bytes of a file that still fit on a full disk
LOST_AFTER = 1.5  # s of a console's silence

Result = TypeVar("Result")


class FailingDisk:
    """A folder that a process writes to and that takes nothing for a while."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._away = folder.with_name(f"{folder.name}-away")
        self._filled = 0  # the process whose disk is full; 0 for none

    def fill(self, pid: int) -> None:
        """A write takes a part and then fails, as on a full disk: the limit holds for files, not for pipes."""
        self._filled = pid
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (LITTLE, resource.RLIM_INFINITY))

    def lose(self) -> None:
        """Something else stands where the folder was."""
        self._folder.rename(self._away)
        self._folder.touch()

    def mend(self) -> None:
        """Also of a process that has ended meanwhile."""
        pid, self._filled = self._filled, 0
        if pid:
            with suppress(ProcessLookupError):
                resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        if self.lost:
            self._folder.unlink()
            self._away.rename(self._folder)

    @property
    def fails(self) -> bool:
        return bool(self._filled) or self.lost

    @property
    def lost(self) -> bool:
        return self._away.exists()


class Robot:
    """A bridge, whose state folder and records outlive its process."""

    def __init__(self, directory: Path, path: TcpPath) -> None:
        self.records: list[dict[str, Any]] = []  # of all runs but those of media, with a line "ended" after each
        self.numbers: dict[str, set[int]] = {}  # of each press; more than one where a disk has not kept it
        self.held: tuple[int, float] | None = None  # number and time of the newest stop, while one holds
        self._locked = False
        self.disk = FailingDisk(directory / "state")
        self._state = directory / "state"
        self._switch = directory / "locked"
        self._path = path
        self._process: Process | None = None
        self._reading: asyncio.Task[None] | None = None
        self._news = asyncio.Event()

    @property
    def pid(self) -> int:
        return 0 if self._process is None else self._process.pid

    async def start(self) -> None:
        """A disk that has been lost is missed: the bridge does not begin without its folder."""
        if self.disk.lost:
            await self._launch()
            assert self._process is not None
            assert await self._process.wait() == 1, "a bridge began without its state folder"
            await self._read_to_the_end()
        self.disk.mend()
        address = await self._launch()
        assert address, "the bridge did not start"
        self._path.target = ("127.0.0.1", int(address.rpartition(":")[2]))

    async def _launch(self) -> str:
        """Records come through a pipe, so that they are seen as they come and take no part in what a disk does."""
        ours, theirs = os.pipe()
        options = ("--port", "0", "--json", "--state-dir", str(self._state), "--lockout-file", str(self._switch))
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "lockstep.robot_bridge", "planar", *options, "--event-log", f"/dev/fd/{theirs}"),
            stdout=PIPE,
            stderr=DEVNULL,
            pass_fds=(theirs,),
        )
        os.close(theirs)
        self._reading = asyncio.create_task(self._read(ours))
        assert self._process.stdout is not None
        line = await self._process.stdout.readline()
        return str(json.loads(line)["robot"]) if line else ""

    async def end(self, how: signal.Signals) -> None:
        if self._process is None or self._process.returncode is not None:
            return
        self._process.send_signal(how)
        await ended(self._process, "the bridge")
        await self._read_to_the_end()
        self.records.append({"kind": "ended", "in_order": how is not signal.SIGKILL})

    async def until(self, found: Callable[[], bool]) -> None:
        """Returns when `found`, which looks at the records, says so."""
        async with asyncio.timeout(2 * PATIENCE):
            while not found():
                self._news.clear()
                await self._news.wait()

    async def lock(self) -> None:
        self._switch.touch()
        await self.until(lambda: self._locked)

    async def unlock(self) -> None:
        self._switch.unlink()
        await self.until(lambda: not self._locked)

    def fail_disk(self, random: Random) -> None:
        if random.random() < 0.5:
            self.disk.fill(self.pid)
        else:
            self.disk.lose()

    def _take(self, record: dict[str, Any]) -> None:
        match record["kind"]:
            case "media":
                return
            case "start":
                self.held = (record["number"], record["time"]) if record["stopped"] else None
                self._locked = False
            case "stop":
                self.held = record["number"], record["time"]
                self.numbers.setdefault(record["press"], set()).add(record["number"])
            case "reset":
                self.held = None
            case "locked_out" | "let_in" as kind:
                self._locked = kind == "locked_out"
        self.records.append(record)
        self._news.set()

    async def _read(self, end: int) -> None:
        reader = asyncio.StreamReader()
        loop = asyncio.get_running_loop()
        transport, _ = await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(end, "rb"))
        try:
            async for line in reader:
                if line.endswith(b"\n"):  # else a kill has cut it off
                    self._take(json.loads(line))
        finally:
            transport.close()

    async def _read_to_the_end(self) -> None:
        if self._reading is not None:
            await self._reading


async def ended(process: Process, name: str) -> None:
    """Returns when a process that was told to end has; kills it and fails where it goes on."""
    try:
        async with asyncio.timeout(END_SECONDS):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()
        raise AssertionError(f"{name} was told to end, and had not {END_SECONDS:.0f} s later") from None


class ConsoleProcess:
    """`lockstep serve` on the same port and the same state folder in every run."""

    def __init__(self, directory: Path, path: TcpPath) -> None:
        self.links: dict[str, str] = {}
        self.output: list[str] = []
        directory.mkdir()
        self.disk = FailingDisk(directory / "kept-stops")
        self._state = directory
        self._path = path
        self._process: Process | None = None
        self._reading: asyncio.Task[None] | None = None

    @property
    def url(self) -> str:
        return self.links["console"]

    @property
    def name(self) -> str:
        """What it is called at the bridge."""
        return console_name(self._state)

    def token(self, role: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {self.links[role].partition('#token=')[2]}"}

    async def start(self) -> None:
        """Returns when it has reached the robot."""
        self.disk.mend()
        port = self.links.get("console", ":0").rpartition(":")[2]
        command = ("serve", "--json", "--quiet", "--robot", f"tcp://127.0.0.1:{self._path.port}", "--port", port)
        settings = {
            "LOCKSTEP_STATE_DIR": str(self._state),
            "LOCKSTEP_SCENE": "false",
            "LOCKSTEP_LINK_BACKOFF": "0.02",
            "LOCKSTEP_LINK_BACKOFF_CAP": "0.1",
        }
        self._process = await asyncio.create_subprocess_exec(
            *(str(Path(sys.executable).with_name("lockstep")), *command),
            stdout=PIPE,
            stderr=PIPE,
            env=os.environ | settings,
        )
        self._reading = asyncio.create_task(self._read(self._process))
        assert self._process.stdout is not None
        async with asyncio.timeout(START_SECONDS):
            line = await self._process.stdout.readline()
        assert line, "the console did not start:\n" + "\n".join(self.output)
        self.links = self.links or json.loads(line)

    async def end(self, how: signal.Signals) -> None:
        if self._process is None or self._process.returncode is not None or self._reading is None:
            return
        self._process.send_signal(how)
        await ended(self._process, "the console")
        await self._reading

    def fail_disk(self, random: Random) -> None:
        assert self._process is not None
        if random.random() < 0.5:
            self.disk.fill(self._process.pid)
        else:
            (self._state / "kept-stops").mkdir(exist_ok=True)
            self.disk.lose()

    async def _read(self, process: Process) -> None:
        assert process.stderr is not None
        async for line in process.stderr:
            self.output.append(line.decode(errors="replace").rstrip())
            del self.output[:-200]


class Player:
    """A client that connects anew when its connection ends."""

    def __init__(self, link: str, name: str) -> None:
        self._link = link
        self._name = name
        self._console: Console | None = None
        self._connecting = asyncio.Lock()

    async def do(self, verb: Callable[[Console], Awaitable[Result]]) -> Result:
        async with asyncio.timeout(3 * PATIENCE):
            console: Console | None = None
            while True:
                try:
                    async with self._connecting:  # two steps at the same time share a connection
                        console = self._console = self._console or await self._connected()
                    return await verb(console)
                except ConsoleLost:
                    if self._console is console:
                        await self.leave()
                except ConnectFailed:
                    await asyncio.sleep(0.05)  # the console starts again

    async def _connected(self) -> Console:
        console = Console(self._link, video=False, audio=False, name=self._name, silence_seconds=LOST_AFTER)
        return await console.__aenter__()

    async def leave(self) -> None:
        console, self._console = self._console, None
        if console is not None:
            await console.__aexit__(None, None, None)


class Judge:
    """Reads the records of several runs of a bridge, and raises at what must not be."""

    def __init__(self) -> None:
        self.moved_after_a_stop = 0
        self._witness = MotionWitness()
        self._issued: dict[int, int] = {}  # issue of the current event -> how many issues there had been
        self._event = 0
        self._in_order = True  # how the run before has ended

    def read(self, line: dict[str, Any]) -> None:
        witness = self._witness
        match line["kind"]:
            case "start":
                self._start(line)
            case "ended":
                self._in_order = line["in_order"]
            case "stop":
                witness.stop(line["number"], line["time"])
            case "reset":
                witness.reset(line["number"], line["time"])
            case "locked_out":
                witness.locked = True
            case "let_in":
                witness.locked = False
                witness.cause()
            case "stall":
                witness.cause()
            case "feedback":
                self._feedback(line)
            case "executed":
                self._executed(line)

    def _start(self, line: dict[str, Any]) -> None:
        witness = self._witness
        if line["stopped"] and line["number"] not in witness.given:
            witness.stop(line["number"], line["time"])
        assert line["stopped"] or not witness.holds, "a restart released a stop"
        assert line["stopped"] or self._in_order, "a bridge that was killed began without a stop"
        witness.cause()
        witness.locked = False
        self._issued.clear()

    def _feedback(self, line: dict[str, Any]) -> None:
        if line["event"] != self._event:
            self._issued.clear()
        self._event = line["event"]
        self._witness.seen += 1
        self._issued[line["issue"]] = self._witness.seen
        if self._witness.holds:
            self._witness.shown = self._witness.given[-1]

    def _executed(self, line: dict[str, Any]) -> None:
        moving = any(line["values"])
        assert not self._witness.locked, "executed while somebody at the robot keeps it"
        assert line["values"][0] >= 0, "a command from without the seat was executed"
        self._witness.executed(moving=moving, answers=self._issued[line["issue"]])
        self.moved_after_a_stop += moving and bool(self._witness.given)

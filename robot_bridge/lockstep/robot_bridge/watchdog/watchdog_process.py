"""Brings a robot to rest from a separate process when the bridge is held up or dies.

    python -m lockstep.robot_bridge.watchdog.watchdog_process SECONDS package.module:function ARGUMENT...

The function is called at once. It returns the call that brings the robot to rest; that call returns False while no node
listens. The process is told of every tick through a pipe. If no tick comes for SECONDS while the robot moves, it makes
the call, and makes it again until a tick comes. If the pipe ends while the robot moves, the bridge was killed: the
process goes on with the call for three seconds after the first call that a listener could get, or for half a minute in
all. It needs nothing of the bridge's interpreter, so it also works while native code keeps that from running anything.
"""

import logging
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.errors import RobotUnavailable

__all__ = ["Act", "WatchdogProcess", "watch"]

MOVING, RESTING, LEAVING = b"m", b"r", b"q"
READY, ACTED = b"+", b"!"
START_SECONDS = 20.0  # for the function's module to be imported and the function to be called
CLOSE_SECONDS = 2.0
SAYS_PER_LIMIT = 4  # ticks reported at least in the time after which silence counts
TRIES = 3
LAST_ACTS, LAST_INTERVAL = 30, 0.1  # acts, and s between them, after the bridge was killed
LAST_SECONDS = 30.0  # s for a listener to get the message

Act = Callable[[], bool | None]  # False: no listener can have got the message

_logger = logging.getLogger(__name__)


class WatchdogProcess:
    """The bridge's side of the watchdog process. `start` blocks until the process is ready."""

    def __init__(self, limit: float, call: str, arguments: Sequence[str] = ()) -> None:
        """`call`: "package.module:function", called with `arguments`; it returns what brings the robot to rest."""
        self._limit = limit
        self._call = call
        self._arguments = arguments
        self._process: subprocess.Popen[bytes] | None = None
        self._moving = False
        self._said = float("-inf")

    @property
    def pid(self) -> int | None:
        """The process id; None while the process does not run."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start the process, and block until it is ready.

        Raises:
            RobotUnavailable: the function cannot be had.
        """
        self._process = process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(self._limit), self._call, *self._arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # signals from the bridge's terminal do not end the watchdog before the bridge
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [os.getcwd(), *sys.path]))},
        )
        assert process.stdin is not None  # pipes were asked for
        assert process.stdout is not None
        ready, _, _ = select.select([process.stdout], [], [], START_SECONDS)
        if not ready or os.read(process.stdout.fileno(), 1) != READY:
            process.kill()
            process.communicate()  # closes the pipes
            self._process = None
            raise RobotUnavailable(f"the watchdog process cannot call {self._call}")
        os.set_blocking(process.stdin.fileno(), False)
        os.set_blocking(process.stdout.fileno(), False)

    def ticked(self, now: float, moving: bool) -> None:
        """Report that a tick begins; `moving`: its values are not at rest.

        Raises:
            RobotUnavailable: the process has ended or does not read, so the robot has no watchdog.
        """
        if moving == self._moving and (not moving or now - self._said < self._limit / SAYS_PER_LIMIT):
            return
        self._moving, self._said = moving, now
        self._say(MOVING if moving else RESTING)

    def take_acted(self) -> bool:
        """Return whether the process has acted since the last call."""
        if self._process is None or self._process.stdout is None:
            return False
        try:
            return ACTED in os.read(self._process.stdout.fileno(), 64)
        except OSError:  # nothing to read
            return False

    def close(self) -> None:
        """End the process without its acting: call this when the robot rests. May be called again."""
        process, self._process = self._process, None
        if process is None or process.stdin is None:
            return
        try:
            os.write(process.stdin.fileno(), LEAVING)
        except OSError as error:
            _logger.error("the watchdog process has ended: %s", error)
        process.stdin.close()
        try:
            process.wait(CLOSE_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()

    def _say(self, what: bytes) -> None:
        if self._process is None or self._process.stdin is None:
            raise RobotUnavailable("the watchdog process does not run")
        try:
            os.write(self._process.stdin.fileno(), what)
        except OSError as error:
            raise RobotUnavailable(f"the watchdog process has ended: {error}") from error


def watch(heard: int, said: int, limit: float, act: Act, now: clock.Clock = clock.now) -> None:
    """Watch until the pipe `heard` ends or says that the bridge leaves in order. Each act is reported to `said`."""
    last, moving = now(), False
    while True:
        timeout = max(0.0, limit - (now() - last)) if moving else None
        if not select.select([heard], [], [], timeout)[0]:
            _logger.error("no tick of the bridge: its watchdog process brings the robot to rest")
            _act(act, said)
            last = now()  # act again if still nothing comes
            continue
        news = os.read(heard, 4096)
        if not news:
            if moving:
                _act_for_good(act, said, now)
            return
        if LEAVING in news:
            return
        last, moving = now(), news[-1:] == MOVING


def _act_for_good(act: Act, said: int, now: clock.Clock) -> None:
    """Act after the bridge is gone: `LAST_ACTS` times with a listener, for at most `LAST_SECONDS`.

    A listener may not have found this process yet, and no other process sends the message later.
    """
    _logger.error("the bridge has ended: its watchdog process brings the robot to rest")
    heard, end = 0, now() + LAST_SECONDS
    while heard < LAST_ACTS and now() < end:
        heard += _act(act, said)
        time.sleep(LAST_INTERVAL)
    if heard == 0:
        _logger.critical("no listener got the message that the robot has to rest")


def _act(act: Act, said: int) -> bool:
    """Act, and return whether a listener can have got the message."""
    is_heard = False
    for _ in range(TRIES):
        try:
            is_heard = act() is not False
            break
        except BaseException as error:
            _logger.critical("the watchdog process cannot bring the robot to rest: %r", error)
    with suppress(OSError):  # no process reads any more
        os.write(said, ACTED)
    return is_heard


def load(call: str, arguments: Sequence[str]) -> Act:
    """Call the function that "package.module:function" names, and return its result."""
    module, _, name = call.partition(":")
    function: Callable[..., Act] = getattr(import_module(module), name)
    return function(*arguments)


def main() -> None:
    # A service manager's signal is for the bridge, which then ends this process.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    said = os.dup(1)
    os.dup2(2, 1)  # output of a robot's library goes to the log
    limit, call, *arguments = sys.argv[1:]
    act = load(call, arguments)
    os.write(said, READY)
    watch(0, said, float(limit), act)


if __name__ == "__main__":
    main()

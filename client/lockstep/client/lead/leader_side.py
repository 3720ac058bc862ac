"""Runs in LeRobot's Python, as a file: reads a leader arm and prints each of its actions as a line of JSON.

It has nothing but LeRobot and the standard library. Its arguments are LeRobot's own flags, --teleop.type=… and so on,
and --rate=HZ. The first line says {"ready": [names]} or {"error": text}. It ends when its standard input does.
"""

import importlib
import json
import os
import pkgutil
import signal
import sys
import threading
import time
from typing import Any

PREFIX = "--teleop."
MAX_MISSES = 25  # readings in a row that fail until the leader counts as gone


class Unusable(Exception):
    """The leader cannot be used; the text says why."""


def make(flags: list[str]) -> Any:
    """Make the leader by LeRobot's flags, and connect it.

    Raises:
        Unusable: LeRobot is missing, the flags do not fit, or the leader does not answer or is not calibrated.
    """
    try:
        draccus = importlib.import_module("draccus")
        package = importlib.import_module("lerobot.teleoperators")
        base = importlib.import_module("lerobot.teleoperators.config").TeleoperatorConfig
    except ImportError as error:
        raise Unusable(f"LeRobot is missing ({error}): name the Python that has it with --lerobot-python") from error
    for module in pkgutil.iter_modules(package.__path__):
        if module.ispkg:
            try:
                importlib.import_module(f"{package.__name__}.{module.name}")
            except Exception as error:  # its own packages are missing; another type may be meant
                sys.stderr.write(f"{module.name}: {error}\n")
    importlib.import_module("lerobot.utils.import_utils").register_third_party_plugins()
    for flag in flags:
        if flag.startswith(f"{PREFIX}discover_packages_path="):
            importlib.import_module("lerobot.configs.parser").load_plugin(flag.partition("=")[2])
    kind = next((flag.partition("=")[2] for flag in flags if flag.startswith(f"{PREFIX}type=")), "")
    known = base.get_known_choices()
    if kind not in known:
        raise Unusable(f"LeRobot has no teleoperator {kind!r}; there are {', '.join(sorted(known))}")
    left_out = (f"{PREFIX}type=", f"{PREFIX}discover_packages_path=")
    words = [f"--{flag.removeprefix(PREFIX)}" for flag in flags if not flag.startswith(left_out)]
    try:
        config = draccus.parse(config_class=known[kind], args=words)
        leader = importlib.import_module("lerobot.teleoperators").make_teleoperator_from_config(config)
        leader.connect(calibrate=False)
    except (Exception, SystemExit) as error:
        raise Unusable(f"{kind} does not connect: {type(error).__name__}: {error}") from error
    if not leader.is_calibrated:
        leader.disconnect()
        raise Unusable(f"{kind} is not calibrated: run lerobot-calibrate with the same flags first")
    return leader


def read_on(leader: Any, rate: float, ended: threading.Event, say: Any) -> None:
    """Print an action `rate` times a second until the other side has gone."""
    misses, due = 0, time.monotonic()
    while not ended.wait(max(0.0, due - time.monotonic())):
        due = max(due + 1 / rate, time.monotonic())
        try:
            action = leader.get_action()
            misses = 0
        except Exception as error:  # a motor bus loses an answer now and then
            misses += 1
            if misses >= MAX_MISSES:
                raise Unusable(f"the leader does not answer: {type(error).__name__}: {error}") from error
            continue
        say({"action": {name: float(value) for name, value in action.items() if not isinstance(value, (str, dict))}})


def main() -> None:
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # Ctrl-C reaches all processes of a terminal; the pipe's end is the end
    output = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # a library that prints must not print among the actions

    def say(said: dict[str, Any]) -> None:
        output.write(json.dumps(said) + "\n")

    flags = [word for word in sys.argv[1:] if word.startswith(PREFIX)]
    rate = next((float(word.partition("=")[2]) for word in sys.argv[1:] if word.startswith("--rate=")), 60.0)
    ended = threading.Event()

    def wait() -> None:
        sys.stdin.buffer.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    leader = None
    try:
        leader = make(flags)
        say({"ready": sorted(leader.action_features)})
        read_on(leader, rate, ended, say)
    except Unusable as error:
        say({"error": str(error)})
    except BrokenPipeError:
        pass
    finally:
        if leader is not None:
            leader.disconnect()


if __name__ == "__main__":
    main()

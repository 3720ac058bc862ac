"""A kept run says when, by which command and on which machine it was made."""

import json
import subprocess
import sys

import pytest

from lockstep.bench.figures.kept_run import kept_run


def test_a_run_names_its_date_its_machine_and_what_it_found() -> None:
    found = kept_run(3.4, [{"figure": 1}])
    assert found["at"].endswith("+00:00")
    assert found["machine"]["cores"] >= 1
    assert (found["busy_percent"], found["runs"]) == (3, [{"figure": 1}])


def test_the_command_is_the_one_that_makes_it_again() -> None:
    code = "import json,sys; from lockstep.bench.figures import kept_run as k; json.dump(k.kept_run(0, []), sys.stdout)"
    # A module of the standard library that runs a program stands for a measurement: `-m` sets what the command names.
    done = subprocess.run(
        [sys.executable, "-m", "timeit", "-n", "1", "-r", "1", "-s", code, "pass"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    found = json.loads(done.stdout.partition("}1 loop")[0] + "}")
    assert found["command"].startswith("python -m timeit -n 1 -r 1 -s ")


def test_paths_of_this_machine_are_no_part_of_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    given = ["x", "--keep", "/tmp/kept", "--times", "3", "--json=/tmp/a.json", "--network", "lte-drive", "--json", "-"]
    monkeypatch.setattr(sys, "argv", given)
    assert kept_run(0, [])["command"].endswith(" --times 3 --network lte-drive")

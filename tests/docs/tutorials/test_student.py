"""docs/tutorials/student.md, done step by step."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from tests.docs.tutorials.reader import Reader, page
from tests.support.stack import running_stack

CORNER = re.compile(r"event (\d+): x (-?[\d.]+) m, y (-?[\d.]+) m")
SIDE = 0.2  # m, instead of the page's 0.5
NEAR = 0.15  # m; a busy machine holds a command up, and the robot comes to rest meanwhile


async def test_its_program_drives_a_square_and_prints_its_figures(tmp_path: Path) -> None:
    reader, file = Reader("student", tmp_path), tmp_path / "square.py"
    assert "SIDE, SPEED = 0.5, " in file.read_text()
    file.write_text(file.read_text().replace("SIDE, SPEED = 0.5, ", f"SIDE, SPEED = {SIDE}, "))
    async with running_stack(tmp_path) as stack:
        said = await reader.type(f"python square.py '{stack.operator}'")
    corners = [(float(x), float(y)) for _, x, y in CORNER.findall(said)]
    sides = [(x - u, y - v) for (u, v), (x, y) in pairwise(corners)]
    wanted = [(0.0, SIDE), (-SIDE, 0.0), (0.0, -SIDE)]
    assert all(abs(x - u) < NEAR and abs(y - v) < NEAR for (x, y), (u, v) in zip(sides, wanted, strict=True))
    assert re.search(r"overview: \d+ rendered, \d+ discarded, gap at most [0-4]\n", said)


@pytest.mark.long
@pytest.mark.timeout(500)
async def test_a_reader_gets_from_the_first_link_to_an_experiment(tmp_path: Path) -> None:
    reader = Reader("student", tmp_path)
    # `make run` is what the README begins with; it runs `lockstep up` with these arguments.
    assert reader.take("make run") == 'make run ARGS="--robot planar"'
    async with running_stack(tmp_path, robot="planar", port=int(reader.port("8000"))) as stack:
        reader.values = {r'"\$LINK"': f"'{stack.operator}'"}
        assert "LINK='http" in reader.take("source .venv/bin/activate")
        reader.compare(await reader.run("python square.py"))
        async with reader.running("lockstep network hong-kong", "open ") as said:
            reader.compare(said)
            (through_it,) = re.findall(r"open +(\S+)", said)
            reader.compare(await reader.type(f"python square.py '{through_it}'"))
        said = await reader.run("lockstep record start")
        reader.compare(said)
        reader.values |= {r"\d{8}T\d{6}Z-\w+": said.splitlines()[-1].split()[0]}
        reader.compare(await reader.run("lockstep verify"))
    reader.values = {}
    said = await reader.run("lockstep experiment macro-lan")
    shown = [line.split() for line in page("student").split("client       stream")[1].split("```")[0].splitlines()[1:]]
    printed = {tuple(words[2:4]): words for words in map(str.split, said.splitlines()) if len(words) > 10}
    assert {(client, stream) for client, stream, *_ in shown} == set(printed) - {("client", "stream")}
    violations = [words[11] for (client, _), words in printed.items() if client == "operator"]
    assert violations == ["0"] * 2
    assert reader.left == []

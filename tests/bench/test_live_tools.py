"""The bench of live tools: what it starts it can end."""

import pytest

from lockstep.bench.sections.costs.live_tools import viewer_program


def test_the_viewer_is_the_program_itself_and_no_script_that_leaves_it_running() -> None:
    pytest.importorskip("rerun_cli")
    with viewer_program().open("rb") as file:
        assert file.read(2) != b"#!"

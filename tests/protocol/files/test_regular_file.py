import os
from io import BytesIO
from pathlib import Path

import pytest

from lockstep.protocol.files.regular_file import MAX_LINE, bounded_lines, open_regular


def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for path in (tmp_path / "fifo", tmp_path, Path("/dev/zero")):
        with pytest.raises(OSError, match=r"not a regular file|Is a directory"):
            open_regular(path)
    (tmp_path / "file").write_bytes(b"whole")
    (tmp_path / "link").symlink_to("file")
    with open_regular(tmp_path / "link") as file:
        assert file.read() == b"whole"


def test_of_a_line_that_is_too_long_the_beginning_comes_and_the_next_one_as_it_is() -> None:
    lines = [b"one", b"x" * (3 * MAX_LINE), b"y" * (MAX_LINE - 1), b"", b"last"]
    found = list(bounded_lines(BytesIO(b"\n".join(lines))))
    assert found == [b"one", b"x" * MAX_LINE, b"y" * (MAX_LINE - 1), b"", b"last"]
    assert list(bounded_lines(BytesIO(b"z" * MAX_LINE))) == [b"z" * MAX_LINE]

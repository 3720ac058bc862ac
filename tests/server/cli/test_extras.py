import sys
from pathlib import Path

import pytest
import typer

from lockstep.server.cli.extras import load_extra
from lockstep.server.cli.recordings.replay_to import replay_to


def test_a_library_that_is_not_installed_is_named_with_the_extra_that_brings_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("pyarrow")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "lockstep.server.recording.export.export_parquet", raising=False)
    with pytest.raises(typer.Exit) as caught:
        load_extra("lockstep.server.recording.export.export_parquet", "export")
    assert caught.value.exit_code == 2
    said = capsys.readouterr().err
    assert "this needs pyarrow" in said
    assert "'.[export]'" in said


def test_a_module_of_the_project_that_is_missing_is_no_missing_extra() -> None:
    with pytest.raises(ModuleNotFoundError):
        load_extra("lockstep.server.no_such_module", "export")


def test_what_is_there_is_returned() -> None:
    assert (
        load_extra("lockstep.server.recording.export.export_csv", "export").__name__
        == "lockstep.server.recording.export.export_csv"
    )


def test_a_replay_of_a_dataset_names_what_reads_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in [name for name in sys.modules if name.startswith("pyarrow")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(typer.Exit) as caught:
        replay_to(tmp_path, "http://localhost/#token=none", 0, 1.0, from_anywhere=False, tls_ca=None, as_json=False)
    assert caught.value.exit_code == 2
    assert "'.[export]'" in capsys.readouterr().err

import pytest
from pydantic import ValidationError

from lockstep.server.rerun.settings import RerunSettings, Target, target_of


def test_a_file_an_address_and_a_port_are_told_apart() -> None:
    assert target_of("/tmp/a.rrd") == Target("file", "/tmp/a.rrd")
    assert target_of("127.0.0.1:9876") == Target("viewer", "rerun+http://127.0.0.1:9876/proxy")
    assert target_of("rerun+https://viewer.example:443/proxy").kind == "viewer"
    assert target_of("9876") == Target("server", "9876")


@pytest.mark.parametrize("to", ["", "viewer", "http://a:1/proxy", "rerun+http://a:1/other", "a:b", "0", "70000", "²"])
def test_what_leads_nowhere_is_refused(to: str) -> None:
    with pytest.raises(ValidationError):
        RerunSettings(to=to, public=True)


def test_a_server_that_everybody_reaches_has_to_be_called_public() -> None:
    with pytest.raises(ValidationError, match="set public"):
        RerunSettings(to="9876")
    assert RerunSettings(to="9876", public=True).served_port == 9876
    assert RerunSettings(to="127.0.0.1:9876").served_port is None
    assert RerunSettings().to is None

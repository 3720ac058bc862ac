import socket

import pytest

from lockstep.bench.harness import free_port as module
from lockstep.bench.harness.free_port import free_port


def test_a_port_that_is_used_for_either_is_not_free(monkeypatch: pytest.MonkeyPatch) -> None:
    used = [free_port(), free_port()]
    with socket.socket() as tcp, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        tcp.bind(("127.0.0.1", used[0]))
        udp.bind(("127.0.0.1", used[1]))
        monkeypatch.setattr(module, "PORTS", used)
        monkeypatch.setattr(module, "TRIES", 2)
        with pytest.raises(OSError, match="no free port"):
            free_port()
    assert free_port() in used

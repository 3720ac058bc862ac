import time

import httpx
import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from lockstep.emulator import Constant, Impairment, NetworkProcess, even_profile
from lockstep.server.http.transport.serve import bind, running

SLOW = even_profile("slow", Impairment(delay=Constant(0.02)))


def hello(request: object) -> PlainTextResponse:
    return PlainTextResponse("hello")


async def test_it_does_what_a_network_does_from_another_process() -> None:
    listener = bind("127.0.0.1", 0)
    url = "http://{}:{}".format(*listener.getsockname())
    app = Starlette(routes=[Route("/", hello)])
    async with running(app, listener), NetworkProcess(SLOW, robot=("127.0.0.1", 9)) as network:
        assert network.robot_address.startswith("tcp://127.0.0.1:")
        assert await network.open_console(url) == network.console_url != url
        assert network.link(f"{url}/#token=x") == f"{network.console_url}/#token=x"
        async with httpx.AsyncClient(trust_env=False) as browser:
            began = time.monotonic()
            assert (await browser.get(network.console_url)).text == "hello"
            assert time.monotonic() - began >= 0.04
            network.begin()
            network.outage(0.2, hold=True)
            began = time.monotonic()
            await browser.get(network.console_url)
            assert time.monotonic() - began >= 0.15
        network.cut_robot()
        assert network.statistics().paths["signalling"]["to_robot"].held == 1
        with pytest.raises(RuntimeError, match="already"):
            await network.open_console(url)
    listener.close()
    with pytest.raises(RuntimeError, match="has ended"):
        network.statistics()


async def test_what_keeps_it_from_starting_is_raised_here() -> None:
    listener = bind("127.0.0.1", 0)
    port = listener.getsockname()[1]
    with pytest.raises(Exception, match=f"cannot listen on 127.0.0.1:{port}"):
        async with NetworkProcess("perfect", console_url="http://127.0.0.1:9", port=port):
            pass
    listener.close()


def test_outside_of_it_there_is_no_network() -> None:
    with pytest.raises(RuntimeError, match="enter the network"):
        NetworkProcess("perfect").begin()

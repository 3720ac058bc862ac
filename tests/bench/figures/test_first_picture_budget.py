"""The time that a page has for its first picture on a long or narrow path."""

import json

import pytest

from lockstep.bench.sections.media.first_picture import FAR_PROFILES, budget_ms
from lockstep.emulator.impairment.profile import load_profile
from tests.docs.test_performance import HISTORY, RUNS

MEASURED = max(run for run in RUNS if "satellite" in (HISTORY / f"{run}.json").read_text())


@pytest.mark.parametrize(
    ("name", "limit"),
    [("hong-kong", 9 * 346 + 400), ("satellite", 9 * 600 + 400 + 48), ("narrow-uplink", 9 * 40 + 1337.5)],
)
def test_it_is_nine_round_trips_and_what_the_bytes_take(name: str, limit: float) -> None:
    assert budget_ms(load_profile(name), 60_000) == pytest.approx(limit, abs=1)


@pytest.mark.parametrize("name", FAR_PROFILES)
def test_the_newest_run_on_file_keeps_it(name: str) -> None:
    results = json.loads((HISTORY / f"{MEASURED}.json").read_text())["results"]
    value = {each["name"]: each["value"] for each in results if each["section"] == "first_picture"}
    asked = value[f"planar, {name}: asked for before it"]
    assert value[f"planar, {name}: median"] <= budget_ms(load_profile(name), asked)

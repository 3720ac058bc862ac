"""What the example policy does with the paths that it was shown, and with fingers that hold something or nothing."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lockstep.protocol.actions import StatusItem
from lockstep.protocol.messages import Feedback

SCRIPT = Path(__file__).parents[3] / "docs/examples/policy/demonstrated_paths.py"
DOWN = (0.0, np.pi / 2, 0.0)  # rad, rotation vector of a tool that points down
OPEN, SHUT, HOLDS = 0.75, -0.1, 0.12  # rad


@pytest.fixture(scope="module")
def paths() -> ModuleType:
    spec = importlib.util.spec_from_file_location("demonstrated_paths", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["demonstrated_paths"] = module
    spec.loader.exec_module(module)
    return module


def line(*corners: tuple[float, float, float]) -> list[tuple[float, ...]]:
    """A point each centimetre or so from corner to corner, with a tool that points down."""
    found: list[tuple[float, ...]] = []
    for one, other in zip(corners, corners[1:], strict=False):
        count = max(2, round(float(np.linalg.norm(np.subtract(other, one))) / 0.01))
        found += [(*place, *DOWN) for place in np.linspace(one, other, count)]
    return found


def demonstrated(paths: ModuleType) -> object:
    """From 10 cm beside a block at 0.25, 0 and above it down; up, over the bowl at 0.2, 0.16, and down; up."""
    ways = {
        "approach": line((0.25, 0.1, 0.1), (0.25, 0.0, 0.1), (0.25, 0.0, 0.016)),
        "carry": line((0.25, 0.0, 0.016), (0.25, 0.0, 0.13), (0.2, 0.16, 0.13), (0.2, 0.16, 0.085)),
        "leave": line((0.2, 0.16, 0.085), (0.2, 0.16, 0.13)),
    }
    fingers = {"approach": OPEN, "carry": SHUT, "leave": OPEN}
    block = paths.Block(0.25, 0.0, 0.0)
    return paths.Demonstration(block, {name: np.array(each) for name, each in ways.items()}, fingers, HOLDS)


def feedback(time: float, place: tuple[float, ...], fingers: float, commanded: float) -> Feedback:
    axes = [0.0] * 5 + [fingers, *place, *DOWN]
    return Feedback(event=1, issue=1, time=time, axes=axes, goals=[0.0] * 5 + [commanded, *place, *DOWN])


def followed(paths: ModuleType, block: object, place: tuple[float, float, float]) -> tuple[list[tuple[str, ...]], bool]:
    """Do at once what the policy asks for, 25 times a second; return each phase with its last place."""
    policy = paths.DemonstratedPaths([demonstrated(paths)])
    fingers, seen = OPEN, {}
    for number in range(1000):
        held = max(fingers, HOLDS) if place[2] < 0.03 or fingers == SHUT else fingers
        action = policy.action(feedback(number * 0.04, place, held, fingers), block)
        fingers = action["gripper"]
        place = tuple(action.get(f"tool.{name}", here) for name, here in zip("xyz", place, strict=True))
        seen[policy.phase] = tuple(f"{each:.3f}" for each in place)
        if policy.done:
            break
    return [(phase, *at) for phase, at in seen.items()], policy.done


def test_a_path_leads_to_where_the_block_lies_now_and_from_there_to_the_same_bowl(paths: ModuleType) -> None:
    seen, done = followed(paths, paths.Block(0.2, -0.08, 0.0), (0.25, 0.1, 0.1))
    assert done
    assert [phase for phase, *_ in seen] == ["approach", "carry", "leave"]
    assert seen[0][3] == "0.016"
    assert seen[1][1:] == ("0.200", "0.160", "0.085")


def test_a_bent_path_begins_at_the_tool_and_ends_straight_where_it_ended(paths: ModuleType) -> None:
    path = demonstrated(paths).paths["approach"]  # type: ignore[attr-defined]
    pose = np.array([0.15, 0.05, 0.12, *DOWN])
    _, found = paths.bent(path, pose)
    assert np.allclose(found[0], pose)
    low = found[found[:, 2] < 0.05]
    assert np.allclose(low[:, :2], (0.25, 0.0))
    assert np.allclose(found[-1], path[-1])


def test_a_tool_that_is_handed_over_low_beside_the_block_comes_from_above_again(paths: ModuleType) -> None:
    _, found = paths.bent(demonstrated(paths).paths["approach"], np.array([0.25, 0.02, 0.016, *DOWN]))  # type: ignore[attr-defined]
    assert found[:, 2].max() > 0.05


def test_fingers_that_hold_nothing_begin_anew_and_those_that_hold_something_go_on(paths: ModuleType) -> None:
    policy = paths.DemonstratedPaths([demonstrated(paths)])
    lies, place = paths.Block(0.25, 0.0, 0.0), (0.25, 0.0, 0.1)
    policy.action(feedback(0.0, place, HOLDS, SHUT), lies)
    assert policy.action(feedback(0.5, place, HOLDS, SHUT), lies)["gripper"] == SHUT, "it holds something"
    assert policy.action(feedback(0.6, place, SHUT, SHUT), lies) == {"gripper": OPEN}, "it has fallen"


def test_a_block_that_is_turned_a_quarter_looks_the_same(paths: ModuleType) -> None:
    path, was = demonstrated(paths).paths["approach"], paths.Block(0.25, 0.0, 0.0)  # type: ignore[attr-defined]
    one, other = (paths.moved(path, was, was._replace(turn=turn)) for turn in (0.2, 0.2 + np.pi / 2))
    assert np.allclose(one, other)


def test_a_robot_that_does_not_say_where_the_block_is_has_none(paths: ModuleType) -> None:
    assert paths.block_of([StatusItem(name="block_x", label="x", kind="number", value=0.1)]) is None


def test_nothing_is_learned_from_nothing(paths: ModuleType) -> None:
    with pytest.raises(ValueError, match="nothing to learn from"):
        paths.DemonstratedPaths([])

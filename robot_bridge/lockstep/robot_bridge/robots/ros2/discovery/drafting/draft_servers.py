"""Drafts the services, the actions and the grippers of a robot's file.

No graph says whether a call moves the robot. So each one is asked for, and stands in the file as a comment where nobody
answers, or the answer is no.
"""

from collections.abc import Iterable

from lockstep.robot_bridge.robots.ros2.discovery.drafting.yaml_text import Plain, Section, Value
from lockstep.robot_bridge.robots.ros2.discovery.graph import ActionServer, Graph, parts_of_name
from lockstep.robot_bridge.robots.ros2.discovery.message_kinds import GRIPPER, NAVIGATE
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Urdf

__all__ = ["draft_actions", "draft_grippers", "draft_services", "unique_name"]

MAX_SERVICES, MAX_ACTIONS, MAX_GRIPPERS = 32, 32, 4
MAX_PARAMETERS = 8
MOST = 1e6  # of a number in a goal
NUMBERS = ("float", "double", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
LEFT = ("distance_remaining",)
RESULT = ("error_msg", "message")


def draft_services(graph: Graph, ask: Ask) -> tuple[Section | None, list[str]]:
    """Return the section, or None without services, and remarks for the person."""
    section = Section(
        head=["Only services that move nothing: nobody can take a call back. The others stay switched off."]
    )
    names = set[str]()
    for each in sorted(graph.services)[:MAX_SERVICES]:
        kind = each.kind.rpartition("/")[2]
        question = f"May the page call {each.name} ({kind} of {each.node})? Yes, if it moves nothing"
        is_on = ask.answers and ask.agree(question, False)
        row: dict[str, Plain] = {"name": unique_name(each.name, names), "service": each.name}
        row |= {} if kind == "Trigger" else {"type": kind}
        section.items.append(Value(row, f"of {each.node}", off=not is_on))
    return _with_remark(section, "services", len(graph.services), MAX_SERVICES)


def draft_actions(graph: Graph, ask: Ask) -> tuple[Section | None, list[str]]:
    """Return the section with all actions but grippers and the goal on the map, and remarks."""
    section = Section(head=["Actions move the robot while armed events renew them, and are cancelled otherwise."])
    found = [each for each in graph.actions if each.kind not in (GRIPPER, NAVIGATE)]
    names = {"go_to"}
    for each in sorted(found, key=lambda each: each.name)[:MAX_ACTIONS]:
        section.items.append(_action(each, ask, names))
    return _with_remark(section, "actions", len(found), MAX_ACTIONS)


def _action(server: ActionServer, ask: Ask, names: set[str]) -> Value:
    package, name = server.kind.partition("/")[0], server.kind.rpartition("/")[2]
    row: dict[str, Plain] = {
        "name": unique_name(server.name, names),
        "action": server.name,
        "type": f"{package}/{name}",
    }
    if server.fields is None:
        return Value(row, f"{package} is not installed here, as it has to be beside the bridge", off=True)
    numbers = [field for field, kind in server.fields.goal.items() if kind in NUMBERS][:MAX_PARAMETERS]
    switches = [field for field, kind in server.fields.goal.items() if kind == "boolean"]
    switches = switches[: MAX_PARAMETERS - len(numbers)]
    for key, fields, wanted in (("left", server.fields.feedback, LEFT), ("result", server.fields.result, RESULT)):
        if (field := next((each for each in wanted if each in fields), "")) != "":
            row[key] = field
    goal = ", ".join(f"{field} ({kind})" for field, kind in server.fields.goal.items()) or "nothing"
    note = f"moves the robot; its goal has {goal}"
    is_on = ask.answers and ask.agree(f"Put {server.name} ({name}) on the page? It may move the robot", False)
    parameters: list[Plain] = [{"field": field, "kind": "switch", "default": False} for field in switches]
    if is_on:
        for field in numbers:
            least = ask.number(f"Least {field} of {server.name}", 0.0, -MOST, MOST)
            parameters.append(
                {
                    "field": field,
                    "minimum": least,
                    "maximum": ask.number(f"Greatest {field} of {server.name}", max(least, 1.0), least, MOST),
                }
            )
    if parameters:
        row["parameters"] = parameters
    return Value(row, note, off=not is_on)


def draft_grippers(graph: Graph, ask: Ask, urdf: Urdf | None) -> tuple[Section | None, list[str]]:
    """Return the section, and remarks. Which end of its range is open, only a person knows."""
    section = Section(head=["open and closed: positions of the controller, at 100 % and at 0 %."])
    found = sorted((each for each in graph.actions if each.kind == GRIPPER), key=lambda each: each.name)
    names = set[str]()
    for each in found[:MAX_GRIPPERS]:
        joint = graph.parameters.get(each.node, {}).get("joint")
        known = urdf.joints.get(joint) if urdf is not None and isinstance(joint, str) else None
        low = known.lower if known is not None and known.lower is not None else 0.0
        high = known.upper if known is not None and known.upper is not None else 0.0
        is_on = ask.answers and ask.agree(f"Put the gripper {each.name} on the page? It moves its fingers", False)
        opened, closed = high, low
        if is_on:
            opened = ask.number(f"Position of {each.name} when it is open", high, -MOST, MOST)
            closed = ask.number(f"Position of {each.name} when it is closed", low, -MOST, MOST)
        row: dict[str, Plain] = {"name": unique_name("gripper", names), "action": each.name}
        row |= {"open": opened, "closed": closed, "effort": 0}
        if known is not None and known.kind == "revolute":
            row["unit"] = "rad"
        place = f"of the joint {joint} in the URDF: which end is open?" if known is not None else "not known: set open"
        section.items.append(Value(row, "as you said" if is_on else place, off=not is_on))
    return _with_remark(section, "grippers", len(found), MAX_GRIPPERS)


def unique_name(topic: str, names: set[str]) -> str:
    """Return a name for an action of the robot, which no other one has, from the name of a service or an action."""
    stem = "-".join(part for part in parts_of_name(topic) if part not in ("", "~"))[-80:] or "action"
    name = next(each for each in (stem, *(f"{stem}-{number}" for number in range(2, 1000))) if each not in names)
    names.add(name)
    return name


def _with_remark(section: Section, what: str, found: int, most: int) -> tuple[Section | None, list[str]]:
    off = _names_of(item for item in section.items if item.off)
    remarks = [f"{what} that stand in the file, switched off: {', '.join(off[:8])}"] if off else []
    if found > most:
        remarks.append(f"{found} {what} were found; the file has {most}")
    return (section if section.items else None), remarks


def _names_of(items: Iterable[Value]) -> list[str]:
    return [str(item.value["name"]) for item in items if isinstance(item.value, dict)]

"""`lockstep robot new`: writes a folder with a new robot, its test and its packaging.

The files come from `template/`, where $package, $class_name and $label stand for the new robot's names.
"""

import keyword
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from string import Template

__all__ = ["CannotWrite", "class_name", "write_new_robot"]

TEMPLATE = Path(__file__).parent / "template"
SUFFIX = ".txt"  # of a template's file, so that no tool takes it for the file that it becomes
PACKAGE = "package"  # stands for the robot's name in the template's paths
TAKEN = ("tests", "test", "src")  # folders of the new robot, and of tools that look into them
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


class CannotWrite(Exception):
    """The robot cannot be written; the text says why."""


def class_name(name: str) -> str:
    """Return the class name for a module name: "MyArm" for "my_arm"."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def write_new_robot(name: str, parent: Path) -> Path:
    """Write the robot's folder `parent`/`name` and return it.

    Raises:
        CannotWrite: the name cannot be used, or the folder exists already.
        OSError: the folder cannot be written.
    """
    _check(name)
    folder = parent / name
    try:
        folder.mkdir()
    except FileExistsError as error:
        raise CannotWrite(f"{folder} exists already") from error
    names = {"package": name, "class_name": class_name(name), "label": name.replace("_", " ").strip().capitalize()}
    for source in sorted(TEMPLATE.rglob(f"*{SUFFIX}")):
        relative = source.relative_to(TEMPLATE).as_posix().removesuffix(SUFFIX)
        target = folder / relative.replace(PACKAGE, name)
        target.parent.mkdir(exist_ok=True)
        target.write_text(Template(source.read_text()).substitute(names))
    return folder


def _check(name: str) -> None:
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise CannotWrite(f"{name!r} is not a Python identifier of ASCII letters, digits and _, such as my_arm")
    if name in TAKEN or name in sys.stdlib_module_names or (find_spec(name) is not None and name not in _here()):
        raise CannotWrite(f"{name!r} is the name of a module that exists already; choose another")


def _here() -> set[str]:
    """Return the names in the working directory, which Python may take for modules; they have their own error."""
    return {each.name for each in Path.cwd().iterdir()}

"""Builds ROS 2 interfaces that the wheels do not have, with the generators that they do have, and a C++ compiler.

`python build_interfaces.py TARGET`: makes the packages of `interfaces/` beside this file in TARGET, which then belongs
on PYTHONPATH and LD_LIBRARY_PATH. Run with ROS' Python. Only the type support that rclpy needs is made.
"""

import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy
from rosidl_adapter.action import convert_action_to_idl
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_typesupport_c
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

SOURCES = Path(__file__).with_name("interfaces")
PREFIX = Path(sys.prefix)
SHARE, LIB, INCLUDE = PREFIX / "share", PREFIX / "lib", PREFIX / "include"
DEPENDENCIES = (
    "builtin_interfaces",
    "std_msgs",
    "geometry_msgs",
    "action_msgs",
    "unique_identifier_msgs",
    "service_msgs",
)
RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    "rosidl_typesupport_fastrtps_c",
    "rosidl_typesupport_fastrtps_cpp",
    "fastcdr",
)
SUPPORTS = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]  # the second is never asked for


def build(package: str, target: Path) -> None:
    work = target / "build" / package
    work.mkdir(parents=True)
    idls = convert(package, work)
    hashes = work / "type_description"
    (target / package).mkdir(parents=True)
    common = {
        "package_name": package,
        "idl_tuples": [f"{work}:{path.relative_to(work)}" for path in idls],
        "ros_interface_dependencies": [
            f"{name}:{path}" for name in DEPENDENCIES for path in sorted((SHARE / name).glob("*/*.idl"))
        ],
        "target_dependencies": [],
        "type_description_tuples": [],
    }

    def arguments(generator: str, output: Path, **more: object) -> str:
        output.mkdir(parents=True, exist_ok=True)
        file = work / f"{generator}.json"
        templates = str(SHARE / generator / "resource")
        file.write_text(json.dumps({**common, "output_dir": str(output), "template_dir": templates, **more}))
        return str(file)

    include_paths = [f"{name}:{SHARE / name}" for name in DEPENDENCIES]
    generate_type_hash(arguments("rosidl_generator_type_description", hashes, include_paths=include_paths))
    common["type_description_tuples"] = [
        f"{path.relative_to(work)}:{hashes / path.relative_to(work).with_suffix('.json')}" for path in idls
    ]
    out = {name: work / name / package for name in ("c", "fastrtps", "dispatch")}
    generate_c(arguments("rosidl_generator_c", out["c"]), False)
    generate_typesupport_fastrtps_c(arguments("rosidl_typesupport_fastrtps_c", out["fastrtps"]))
    generate_typesupport_c(arguments("rosidl_typesupport_c", out["dispatch"]), SUPPORTS)
    python = target / package
    (python / "__init__.py").write_text("")
    generate_py(arguments("rosidl_generator_py", python), ["rosidl_typesupport_c"])
    visibility(package, work)
    compile_all(package, work, out, target)


def convert(package: str, work: Path) -> list[Path]:
    made = []
    for source in sorted((SOURCES / package).glob("*/*")):
        convert_to = convert_action_to_idl if source.suffix == ".action" else convert_msg_to_idl
        folder = work / source.parent.name
        folder.mkdir(exist_ok=True)
        relative = source.relative_to(SOURCES / package)
        made.append(Path(convert_to(SOURCES / package, package, relative, folder)))
    return made


def visibility(package: str, work: Path) -> None:
    """Make the headers that CMake would fill in."""
    for generator, folder, name in (
        ("rosidl_generator_c", "c", "rosidl_generator_c__visibility_control.h"),
        ("rosidl_typesupport_fastrtps_c", "fastrtps", "rosidl_typesupport_fastrtps_c__visibility_control.h"),
    ):
        text = (SHARE / generator / "resource" / f"{name}.in").read_text()
        text = text.replace("@PROJECT_NAME@", package).replace("@PROJECT_NAME_UPPER@", package.upper())
        file = work / folder / package / "msg" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)


def libraries(ending: str) -> list[str]:
    """Return the wheels' libraries of the packages that are depended on."""
    return [path.name for package in DEPENDENCIES for path in sorted(LIB.glob(f"lib{package}{ending}"))]


def compile_all(package: str, work: Path, out: dict[str, Path], target: Path) -> None:
    includes = [work / "c", work / "fastrtps", work / "dispatch", INCLUDE, Path(sysconfig.get_path("include"))]
    includes += [Path(numpy.get_include()), *(path for path in INCLUDE.iterdir() if path.is_dir())]
    includes += sorted((target / "build").glob("*/c"))  # of packages that were built before
    flags = ["-O0", "-w", "-fPIC", "-shared", *(f"-I{path}" for path in includes), f"-L{LIB}", f"-L{target}"]
    wheels = [f"-l:{name}" for name in libraries("__rosidl_*_c.so")]
    wheels += [f"-l{name}" for name in RUNTIME]
    pythons = [f"-l:{name}" for name in libraries("__rosidl_generator_py.so")]

    def link(name: str, sources: list[Path], *more: str, compiler: str = "gcc", folder: Path = target) -> None:
        subprocess.run([compiler, *flags, "-o", str(folder / name), *map(str, sources), *more, *wheels], check=True)

    own = f"-l{package}__rosidl_"
    link(f"lib{package}__rosidl_generator_c.so", sorted(out["c"].rglob("*.c")))
    link(f"lib{package}__rosidl_typesupport_fastrtps_c.so", sorted(out["fastrtps"].rglob("*.cpp")), f"{own}generator_c",
         compiler="g++")  # fmt: skip
    dispatch = sorted([*out["dispatch"].rglob("*.cpp"), *out["dispatch"].rglob("*.c")])
    link(f"lib{package}__rosidl_typesupport_c.so", dispatch, f"{own}generator_c", f"{own}typesupport_fastrtps_c",
         compiler="g++")  # fmt: skip
    python = target / package
    link(f"lib{package}__rosidl_generator_py.so", sorted(python.rglob("*_s.c")), f"{own}generator_c",
         f"{own}typesupport_c", *pythons)  # fmt: skip
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    entry = python / f"_{package}_s.ep.rosidl_typesupport_c.c"
    link(f"{package}_s__rosidl_typesupport_c{suffix}", [entry], f"{own}generator_py", f"{own}generator_c",
         f"{own}typesupport_c", *pythons, folder=python)  # fmt: skip


def main() -> None:
    target = Path(sys.argv[1])
    for package in sorted(path.name for path in SOURCES.iterdir()):
        build(package, target)


if __name__ == "__main__":
    main()

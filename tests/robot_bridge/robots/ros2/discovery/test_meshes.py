"""The triangles of a mesh that a URDF names, and what is not read."""

import io
import math
import os
import struct
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

from lockstep.robot_bridge.robots.ros2.discovery import meshes
from lockstep.robot_bridge.robots.ros2.discovery.meshes import MeshReader, mesh_file, read_mesh, simplified
from lockstep.robot_bridge.robots.ros2.discovery.urdf import Mesh

CORNERS = ((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (0.0, 4.0, -6.0))


def binary(corners: tuple[tuple[float, ...], ...] = CORNERS, head: bytes = b"solid by some program") -> bytes:
    numbers = [0.0] * 3 + [value for corner in corners for value in corner]
    return head.ljust(80) + struct.pack("<I", 1) + struct.pack("<12fH", *numbers, 0)


def text() -> bytes:
    corners = "".join(f"  vertex {x} {y} {z}\n" for x, y, z in CORNERS)
    return f"solid x\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid x\n".encode()


def wavefront() -> bytes:
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    return f"mtllib none.mtl\no link\n{corners}vn 0 0 1\nusemtl red\nf 1//1 2//1 -1//1\n".encode()


def collada(unit: float = 1.0, shape: str = "triangles", move: str = "", up: str = "Z_UP") -> bytes:
    """A scene of one node, with a texture that is nowhere."""
    numbers = " ".join(str(value / unit) for corner in CORNERS for value in corner)
    count = "<vcount>3</vcount>" if shape == "polylist" else ""
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="some" meter="{unit}"/><up_axis>{up}</up_axis></asset>
<library_images><image id="i"><init_from>../../nowhere.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><phong><diffuse><texture texture="t" texcoord="UV"/></diffuse></phong></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">{numbers}</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<{shape} count="1" material="red"><input semantic="VERTEX" source="#v" offset="0"/>{count}<p>0 1 2</p></{shape}>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n">{move}<instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="red" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene>
</COLLADA>""".encode()


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("link.STL", binary()),
        ("link.stl", text()),
        ("link.obj", wavefront()),
        ("link.dae", collada()),
        ("link.DAE", collada(unit=0.001, shape="polylist")),
        ("link.dae", collada(up="Y_UP")),  # as RViz reads it
    ],
)
def test_a_mesh_in_a_file_has_its_triangles_in_meters(name: str, data: bytes, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(data)
    mesh = read_mesh(f"file://{file}", 8)
    assert mesh is not None
    found = [mesh.vertices[number] for triangle in mesh.triangles for number in triangle]
    assert np.array(found) == pytest.approx(np.array(CORNERS), abs=1e-6)


def test_a_face_of_many_corners_is_a_fan(tmp_path: Path) -> None:
    file = tmp_path / "link.obj"
    file.write_bytes(b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2/2 3/3 4/4\nl 1 2\n")
    mesh = read_mesh(f"file://{file}", 8)
    assert mesh is not None
    assert (len(mesh.vertices), len(mesh.triangles)) == (4, 2)


def test_the_nodes_of_a_scene_are_where_it_places_them(tmp_path: Path) -> None:
    file = tmp_path / "link.dae"
    file.write_bytes(collada(unit=0.01, move="<translate>100 0 0</translate>"))
    mesh = read_mesh(f"file://{file}", 8)
    assert mesh is not None
    assert sorted(round(x, 6) for x, _, _ in mesh.vertices) == [1.0, 1.0, 3.0]


def packed() -> bytes:
    room = io.BytesIO()
    with zipfile.ZipFile(room, "w") as archive:
        archive.writestr("link.dae", collada())
    return room.getvalue()


def doubled(levels: int) -> bytes:
    """Each node of a library has the one before twice."""
    nodes = '<node id="n0"><instance_geometry url="#g"/></node>'
    for level in range(1, levels + 1):
        nodes += f'<node id="n{level}">' + f'<instance_node url="#n{level - 1}"/>' * 2 + "</node>"
    text = (
        collada()
        .decode()
        .replace("<library_visual_scenes>", f"<library_nodes>{nodes}</library_nodes><library_visual_scenes>")
    )
    return text.replace('<node id="n">', f'<node id="n"><instance_node url="#n{levels}"/>').encode()


@pytest.mark.parametrize(
    "data",
    [
        packed(),
        b"<" + packed(),
        collada().replace(b"<COLLADA", b'<!DOCTYPE c [<!ENTITY a SYSTEM "file:///etc/hostname">]><COLLADA'),
        collada().replace(b"<COLLADA", b"<!DOCTYPE c><COLLADA"),
        collada().replace(b"<asset>", b'<asset><Name_array id="x" count="1">a</Name_array>'),
        collada().replace(b"<asset>", b"<asset>" + b'<instance_node url="#n"/>' * 501),
        doubled(20),
        collada(shape="polylist").replace(b"<vcount>3</vcount>", b"<vcount>2000000000</vcount>"),
        collada()
        .replace(b"</node></visual_scene>", b'<instance_geometry url="#g"/>' * 3 + b"</node></visual_scene>")
        .replace(
            b"</mesh>",
            b'<lines count="0"><input semantic="VERTEX" source="#v" offset="0"/><p/></lines>' * 40000 + b"</mesh>",
        ),
        doubled(240).replace(b'<instance_geometry url="#g"/></node>', b"<node/>" * 5000 + b"</node>"),
    ],
)
def test_a_mesh_cannot_open_other_files_nor_grow_as_it_is_read(data: bytes, tmp_path: Path) -> None:
    file = tmp_path / "link.dae"
    file.write_bytes(data)
    assert read_mesh(f"file://{file}", 8) is None


def test_instances_of_nodes_are_drawn(tmp_path: Path) -> None:
    file = tmp_path / "link.dae"
    file.write_bytes(doubled(3))
    assert read_mesh(f"file://{file}", 8) is not None


def ball(rings: int) -> list[list[float]]:
    """The corners of a ball's triangles, three each, counter-clockwise from outside."""

    def at(ring: int, side: int) -> list[float]:
        polar, around = math.pi * ring / rings, 2 * math.pi * side / rings
        return [math.sin(polar) * math.cos(around), math.sin(polar) * math.sin(around), math.cos(polar)]

    corners = []
    for ring in range(rings):
        for side in range(rings):
            a, b = at(ring, side), at(ring + 1, side)
            c, d = at(ring + 1, side + 1), at(ring, side + 1)
            corners += [a, b, c, a, c, d]
    return corners


@pytest.mark.parametrize("most", [20, 60, 150])
def test_a_fine_mesh_keeps_its_form_in_few_triangles_that_look_outwards(most: int) -> None:
    mesh = simplified(np.array(ball(60)), most)
    assert mesh is not None
    assert most / 3 < len(mesh.vertices) <= most
    for vertex in mesh.vertices:
        assert 0.6 < math.hypot(*vertex) < 1.01
    outwards = 0
    for triangle in mesh.triangles:
        a, b, c = (np.array(mesh.vertices[number]) for number in triangle)
        outwards += float(np.dot(np.cross(b - a, c - a), a + b + c)) > 0
    assert outwards > 0.9 * len(mesh.triangles)


def test_a_mesh_without_an_extent_and_one_that_is_too_fine_for_its_room_are_none() -> None:
    assert simplified(np.zeros((3, 3)), 8) is None
    assert simplified(np.full((3, 3), 1e7) * np.arange(9).reshape(3, 3), 8) is None
    assert simplified(np.array(ball(60)), 3) is None


def test_few_triangles_stay_as_they_are() -> None:
    corners = np.array([*CORNERS, CORNERS[1], CORNERS[0], (0.0, -1.0, 0.0)], dtype=float)
    mesh = simplified(corners, 8)
    assert mesh == Mesh([(0, -1, 0), (0, 0, 0), (0, 4, -6), (2, 0, 0)], mesh.triangles if mesh else [])
    assert len(mesh.triangles) == 2


def test_a_mesh_of_a_package_is_looked_for_where_packages_are(tmp_path: Path) -> None:
    file = tmp_path / "second" / "share" / "tug" / "meshes" / "link.stl"
    file.parent.mkdir(parents=True)
    file.write_bytes(binary())
    places = {"AMENT_PREFIX_PATH": f"{tmp_path / 'first'}:{tmp_path / 'second'}"}
    assert mesh_file("package://tug/meshes/link.stl", places) == file
    assert mesh_file("package://tug/meshes/other.stl", places) is None
    assert mesh_file("package://tug/meshes/link.stl", {}) is None


@pytest.mark.parametrize(
    ("kind", "data"),
    [
        *(("stl", data) for data in (b"", b"no mesh", binary()[:-1], binary(((float("nan"),) * 3,) * 3))),
        ("stl", b"solid\nvertex a b c\n"),
        *(("obj", data) for data in (b"", b"no mesh", b"v 1 2\nf 1 1 1\n", b"f\n", b"\xff\xfe")),
        *(
            ("obj", b"v 0 0 0\nf " + face)
            for face in (b"1 2 3\n", b"-9 1 1\n", b"a b c\n", b"1 1 99999999999999999999\n")
        ),
        ("obj", wavefront() + b"v" + b" " * (1 << 17) + b"0 0 0\n"),
        ("stl", text() + b" " * (1 << 17)),
        *(("dae", data) for data in (b"", b"<a/>", collada()[:-20], collada().replace(b"0 1 2", b"0 1 9"))),
    ],
)
def test_what_is_no_mesh_is_not_drawn(kind: str, data: bytes, tmp_path: Path) -> None:
    file = tmp_path / f"link.{kind}"
    file.write_bytes(data)
    assert read_mesh(f"file://{file}", 8) is None


def test_only_regular_files_of_meshes_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "secret").write_bytes(binary())
    (tmp_path / "link.stl").write_bytes(binary())
    for uri in (
        f"file://{tmp_path}/pipe.stl",
        f"file://{tmp_path}/secret",
        f"file://{tmp_path}/x/../link.stl",
        f"http://localhost{tmp_path}/link.stl",
        "",
    ):
        assert read_mesh(uri, 8) is None


def test_a_large_mesh_needs_memory_for_few_copies_of_its_file(tmp_path: Path) -> None:
    corners = np.array(ball(200), dtype=np.float32).reshape(-1, 3, 3)
    triangles = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = corners
    data = bytes(80) + struct.pack("<I", len(triangles)) + triangles.tobytes()
    file = tmp_path / "link.stl"
    file.write_bytes(data)
    tracemalloc.start()
    try:
        mesh = read_mesh(f"file://{file}", 150)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert mesh is not None
    assert len(mesh.vertices) <= 150
    assert peak < 6 * len(data)


def test_a_mesh_that_needs_a_reader_which_is_not_installed_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "collada", None)
    (tmp_path / "link.dae").write_bytes(collada())
    read = MeshReader()
    assert read(f"file://{tmp_path}/link.dae", 8) is None
    assert "python3-collada" in read.left_out[0]


def test_meshes_above_the_bounds_are_not_read_but_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = len(binary())
    monkeypatch.setattr(meshes, "MAX_BYTES", {".stl": size})
    monkeypatch.setattr(meshes, "MAX_ALL_BYTES", 2 * size)
    for name in ("a", "b", "c"):
        (tmp_path / f"{name}.stl").write_bytes(binary())
    (tmp_path / "large.stl").write_bytes(binary() + b"x")
    read = MeshReader()
    found = [read(f"file://{tmp_path}/{name}.stl", 8) for name in ("large", "a", "a", "b", "c", "c", "none")]
    assert [mesh is not None for mesh in found] == [False, True, True, True, False, False, False]
    assert [each.rpartition("/")[2].partition(":")[0] for each in read.left_out] == ["large.stl", "c.stl"]

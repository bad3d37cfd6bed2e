"""Files of strangers, and scenes that name them: broken, endless, huge, or programs in disguise."""

import os
import random
import re
import struct

from surfaces import box

SQUARE = b"""$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
2
1 2 2 1 1 1 2 3
2 2 2 1 1 1 3 4
$EndElements
"""
TETRAHEDRON = b"""$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 0 0 1
1 0 0 0 1 1 1 0 0
$EndEntities
$Nodes
1 4 1 4
3 1 0 4
1
2
3
4
0 0 0
1 0 0
0 1 0
0 0 1
$EndNodes
$Elements
1 1 1 1
3 1 4 1
1 1 2 3 4
$EndElements
"""
SCRIPT = b"""SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1};
Mesh.MeshSizeMax = 0.5;
"""
STEP = b"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\nENDSEC;\n"
CORNERS = box()
TEXT_STL = b"solid s\n" + b"".join(
    b"facet normal 0 0 0\nouter loop\n"
    + b"".join(b"vertex %g %g %g\n" % tuple(point) for point in triangle)
    + b"endloop\nendfacet\n"
    for triangle in CORNERS
) + b"endsolid s\n"  # fmt: skip
STL = bytes(80) + struct.pack("<I", 12) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in CORNERS
)  # fmt: skip
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
LINK = '<inertial><origin xyz="0.5 0 0"/><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'  # noqa: E501
JOINT = '<limit lower="-2" upper="2" effort="1" velocity="1"/><axis xyz="0 0 1"/>'
URDF = f"""<robot name="r"><link name="base"/>
<link name="a">{LINK}<collision><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
<link name="b">{LINK}<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="one" type="revolute"><parent link="base"/><child link="a"/>{JOINT}</joint>
<joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>{JOINT}
</joint></robot>"""
MJCF = """<mujoco model="m"><compiler angle="radian"/><default><default class="d"/></default>
<worldbody><body name="a"><joint name="one" type="hinge" axis="0 0 1" class="d"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size="0.05" mass="1"/><body name="b" pos="1 0 0">
<joint name="two" type="hinge" axis="0 0 1"/><geom type="sphere" size="0.1" mass="1"/></body>
</body></worldbody></mujoco>"""
MESH = '<collision><geometry><mesh filename="{}" scale="{}"/></geometry></collision>'

FLOOR = """[[obstacle]]
kind = "half_space"
name = "floor"
point = [0.0, -9.0{zero}]
normal = [0.0, 1.0{zero}]
"""
HEAD = 'title = "t"\nduration = 0.01\n'
USERS = {
    "rigid": HEAD + '[[body]]\nkind = "rigid"\nmesh = "{file}"\ndensity = 1.0\n{size}'
    + FLOOR.format(zero=", 0.0"),
    "obstacle": HEAD + '[[body]]\nkind = "rigid"\ndensity = 1.0\n'
    'shape = {{ kind = "sphere", radius = 0.1, center = [0.3, 5.0, 0.3] }}\n'
    '[[obstacle]]\nkind = "mesh"\nmesh = "{file}"\n{size}',
    "solid": HEAD + '[[body]]\nkind = "solid"\nmodel = "plane_strain"\nmesh = "{file}"\n'
    "density = 1.0\nyoungs_modulus = 1.0\npoisson_ratio = 0.3\n{size}"
    + FLOOR.format(zero=""),
    "mechanism": HEAD + 'gravity = [0.0, 0.0, -9.81]\n[[body]]\nkind = "mechanism"\n'
    'file = "{file}"\n',
}  # fmt: skip


def scene(user, file):
    """A scene that names a file."""
    size = "mesh_size = 0.5\n" if file.lower().endswith((".step", ".geo")) else ""
    return USERS[user].format(file=file, size=size)


def mutated(random_, content):
    """A file after a mishap."""
    kind, size = (
        random_.choice(("cut", "noise", "number", "chunk", "zeros", "doubled")),
        len(content),
    )
    start = random_.randrange(size)
    if kind == "cut":
        return content[:start]
    if kind == "noise":
        return content[:start] + random_.randbytes(40) + content[start + 40 :]
    if kind == "number":
        numbers = [*re.finditer(rb"-?\d+(\.\d+)?", content)] or [re.search(b"", content)]
        found = random_.choice(numbers)
        other = random_.choice((b"nan", b"-1", b"1e308", b"99999999999", b"0", b"inf", b"-1e-300"))
        return content[: found.start()] + other + content[found.end() :]
    if kind == "chunk":
        return content[:start] + content[start + random_.randrange(1, 60) :]
    if kind == "zeros":
        return content[:start] + bytes(30) + content[start:]
    return content[:start] + content[max(0, start - 90) :]


def _named(old, new, text=URDF):
    assert old in text
    return text.replace(old, new, 1).encode()


def _chain(count):
    """An MJCF file of one long chain."""
    link = '<body name="b{}"><joint name="j{}" type="hinge"/><geom type="sphere" size="1"/>'
    inner = "".join(link.format(k, k) for k in range(count)) + "</body>" * count
    return f"<mujoco><worldbody>{inner}</worldbody></mujoco>".encode()


LAUGHS = b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + b"".join(
    b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(20)
) + b"]><robot>&u;</robot>"  # fmt: skip
FORMAT = b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
MANY = "".join(f'<link name="l{k}"/>' for k in range(1500))
# Name of a file: its content, and what is said of it.
KNOWN = {
    "mass_nan.urdf": (_named('<mass value="1"', '<mass value="nan"'), "<mass> of .a. has value"),
    "mass_word.urdf": (_named('<mass value="1"', '<mass value="heavy"'), "has the mass"),
    "mass_less.urdf": (_named('<mass value="1"', '<mass value="-1"'), "has the mass"),
    # Taken as they stand, and told: refused only where ``strict`` (tests/system).
    "mass_zero.urdf": (_named('<mass value="1"', '<mass value="0"'), None),
    "inertia_minus.urdf": (_named('ixx="0.1"', 'ixx="-0.1"'), "all have to be >= 0"),
    "inertia_large.urdf": (_named('izz="0.1"', 'izz="0.3"'), None),
    "place_inf.urdf": (_named('xyz="1 0 0"', 'xyz="inf 0 0"'), "give finite numbers"),
    "box_flat.urdf": (_named("1 0.1 0.1", "1 0 0.1"), "has no volume"),
    "ball_nothing.urdf": (_named('radius="0.1"', 'radius="0"'), "has no volume"),
    "mesh_flat.urdf": (_named(LINK, LINK + MESH.format("cube.stl", "1 1 0")), "has no volume"),
    "mesh_pipe.urdf": (_named(LINK, LINK + MESH.format("pipe.stl", "1 1 1")), "no regular file"),
    "mesh_zero.urdf": (_named(LINK, LINK + MESH.format("zero.stl", "1 1 1")), "outside the folder"),
    "mesh_away.urdf": (_named(LINK, LINK + MESH.format("../x.stl", "1 1 1")), "outside the folder"),
    "mesh_link.urdf": (_named(LINK, LINK + MESH.format("away.stl", "1 1 1")), "outside the folder"),
    "mesh_script.urdf": (_named(LINK, LINK + MESH.format("x.py", "1 1 1")), r"give one of \.stl"),
    "mesh_noise.urdf": (_named(LINK, LINK + MESH.format("noise.dae", "1 1 1")), "Pinocchio says"),
    "ring.urdf": (_named('link="base"/><child', 'link="b"/><child'), "hangs on itself"),
    "two_above.urdf": (_named('<child link="a"/>', '<child link="b"/>'), "hangs on two joints"),
    "apart.urdf": (_named("</robot>", '<link name="c"/></robot>'), "2 first links"),
    "many.urdf": (_named("</robot>", MANY + "</robot>"), "has 1503 links"),
    "deep.urdf": (_named("</robot>", "<x>" * 9000 + "</x>" * 9000 + "</robot>"), "deeper than"),
    "laughs.urdf": (LAUGHS, "declares a document type"),
    "entity.urdf": (b'<!DOCTYPE r [<!ENTITY x SYSTEM "/etc/passwd">]><robot>&x;</robot>', "docum"),
    "wide.urdf": (URDF.encode("utf-16"), "cannot be read"),
    "chain.xml": (_chain(600), "deeper than"),
    "no_class.xml": (_named('class="d"/>\n', 'class="e"/>\n', MJCF), 'class.*"e"'),
    "no_child.xml": (_named('name="a"', 'name="a" childclass="e"', MJCF), 'childclass.*"e"'),
    "no_type.xml": (_named('type="hinge"', 'type="bend"', MJCF), 'has type = "bend"'),
    "light.xml": (_named('mass="1"', 'mass="-1"', MJCF), 'mass = "-1"'),
    "by_mesh.xml": (
        _named('type="sphere" size="0.1" mass="1"', 'type="mesh" mesh="c"', MJCF)
        .replace(b"<worldbody>", b'<asset><mesh name="c" file="cube.stl"/></asset><worldbody>'),
        "has its mass from a mesh"),
    "script.msh": (b'SystemCall "touch hit";\n' + SCRIPT, r"begin with \$MeshFormat"),
    "script.step": (b'SystemCall "touch hit";\n' + SCRIPT, "begin with ISO"),
    "script.stl": (b'SystemCall "touch hit";\n' + SCRIPT, "is no STL file"),
    "spaces.msh": (b'  \nSystemCall "touch hit";\n' + FORMAT, r"begin with \$MeshFormat"),
    "behind.msh": (FORMAT + b'SystemCall "touch hit";\n' + SCRIPT, ""),
    "include.geo": (b'Include "script.msh";\n' + SCRIPT, "is not allowed"),
    "listed.geo": (b'a() = ListFromFile("pipe.stl");\n' + SCRIPT, "is not allowed"),
    "nodes.msh": (FORMAT + b"$Nodes\n1 99999999999 1 99999999999\n", ""),
    "packed.stl": (bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(500), "is no STL file"),
    "nan.stl": (TEXT_STL.replace(b"1 1 1", b"1 nan 1"), "not finite"),
    "flat.stl": (TEXT_STL.replace(b"vertex 1", b"vertex 0"), ""),
    "empty.stl": (b"", ""),
    "empty.msh": (b"", "empty"),
    "pipe.stl": (None, "no regular file"),
    "zero.stl": (None, "no regular file"),
    "zero.msh": (None, "no regular file"),
    "zero.urdf": (None, "no regular file"),
    "folder.msh": (None, "no regular file|directory"),
    "loop.stl": (None, "levels of symbolic links"),
    "huge.msh": (None, "more than the"),
    "huge.urdf": (None, "more than the"),
}  # fmt: skip
BEGINS = {
    "square.msh": SQUARE, "tetrahedron.msh": TETRAHEDRON, "script.geo": SCRIPT, "part.step": STEP,
    "text.stl": TEXT_STL, "cube.stl": STL, "arm.urdf": URDF.encode(), "arm.xml": MJCF.encode(),
    "hull.obj": OBJ, "hull.stl": STL,
}  # fmt: skip


def special(folder, name):
    """What is no file, or too large a one."""
    kind, path = name.partition(".")[0], folder / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "zero":
        path.symlink_to("/dev/zero")
    elif kind == "loop":
        path.symlink_to(name)
    elif kind == "folder":
        path.mkdir()
    else:
        with path.open("wb") as file:
            file.truncate(2**30)  # takes no room


def users(name):
    """Who may name a file."""
    ending = name.rpartition(".")[2]
    if ending in {"urdf", "xml"}:
        return ["mechanism"]
    return {"geo": ["solid"], "stl": ["rigid", "obstacle"]}.get(
        ending, ["rigid", "obstacle", "solid"]
    )


def written(folder, seed, count):
    """Write files and scenes; returns of each scene which file it names and what is said of it."""
    random_ = random.Random(seed)  # noqa: S311
    for name, (content, _) in KNOWN.items():
        special(folder, name) if content is None else (folder / name).write_bytes(content)
    (folder / "cube.stl").write_bytes(STL)
    (folder / "noise.dae").write_bytes(random_.randbytes(2000))
    (folder / "x.py").write_text("open('hit', 'w')")
    (folder / "away.stl").symlink_to("/etc/passwd")
    files = {name: said for name, (_, said) in KNOWN.items()}
    for number in range(count - len(files)):
        begin = random_.choice([*BEGINS])
        name = f"{number}_{begin}"
        content = BEGINS[begin]
        for _ in range(random_.choice((1, 1, 2))):
            content = mutated(random_, content) or b"x"
        (folder / name).write_bytes(content)
        if begin.startswith("hull"):
            shape = LINK + MESH.format(name, "1 1 1")
            name += ".urdf"
            (folder / name).write_bytes(_named(LINK, shape))
        files[name] = None
    scenes = {}
    for name, said in files.items():
        known = users(name)
        for user in known if name.startswith("script.") else [random_.choice(known)]:
            (folder / f"{name}.{user}.toml").write_text(scene(user, name))
            scenes[f"{name}.{user}.toml"] = name, said
    return scenes

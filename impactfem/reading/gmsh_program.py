"""What Gmsh does with a file in a process of its own."""

import inspect

from impactfem.reading import meshio_mesh

# What only Gmsh knows is done here; the rest happens outside, where it can be tested.
PROGRAM = inspect.getsource(meshio_mesh)
PROGRAM += """
import json

source, target, job = sys.argv[4:]
try:
    import gmsh
except (ImportError, OSError) as error:
    print(f"Gmsh cannot be loaded ({error}); pip install 'impactfem[fem]'", file=sys.stderr)
    sys.exit(3)
job = json.loads(job)
dim, degree = job["dim"], job["degree"]
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
gmsh.logger.start()
errors = []

def choose():
    # The parts of an assembly that are meant; those that touch share their faces.
    paths = {}
    for entity, tag in gmsh.model.getEntities(dim):
        name = gmsh.model.getEntityName(entity, tag)
        paths[tag] = tuple(name.split("/")) if name else (f"part_{tag}",)
    asked = tuple((job["part"] or "").split("/"))
    count = len(asked)

    def within(path):
        return any(path[k : k + count] == asked for k in range(len(path)))

    def told(path):
        others = [other for other in paths.values() if other is not path]
        tails = (path[k:] for k in range(len(path) - 1, -1, -1))
        alone = (t for t in tails if not any(o[-len(t):] == t for o in others))
        return "/".join(next(alone, path))

    found = [tag for tag, path in paths.items() if not job["part"] or within(path)]
    if not found:
        names = [told(path) for path in paths.values()]
        more = f" and {len(names) - 30} more" if len(names) > 30 else ""
        print(
            f"it has no part {job['part']!r}, it has {', '.join(map(repr, names[:30]))}{more}; "
            "give one of these, or the name of an assembly among them", file=sys.stderr
        )
        sys.exit(4)
    if others := [(dim, tag) for tag in paths if tag not in found]:
        gmsh.model.occ.remove(others, recursive=True)
    if len(found) > 1:
        gmsh.model.occ.fragment([(dim, found[0])], [(dim, tag) for tag in found[1:]])
    gmsh.model.occ.synchronize()
    return len(paths)

def label(parts):
    for side in (dim, dim - 1):
        named = {}
        for number, (entity, tag) in enumerate(gmsh.model.getEntities(side), 1):
            name = gmsh.model.getEntityName(entity, tag).split("/")[-1]
            plain = "body" if parts == 1 else f"part_{tag}"
            fallback = plain if side == dim else ("edge_", "face_")[side - 1] + str(number)
            named.setdefault(name or fallback, []).append(tag)
        for name, tags in named.items():
            gmsh.model.addPhysicalGroup(side, tags, name=name)

def grade():
    field = gmsh.model.mesh.field
    tags = []
    for values in job["balls"]:
        tags.append(field.add("Ball"))
        for name, value in values.items():
            field.setNumber(tags[-1], name, value)
    if tags:
        least = field.add("Min")
        field.setNumbers(least, "FieldsList", tags)
        field.setAsBackgroundMesh(least)

def off_straight(kind):
    # Largest distance of nodes from where the corners alone would have them, over the element.
    import numpy as np
    mesh = gmsh.model.mesh
    name, _, order, count, local, corners = mesh.getElementProperties(kind)
    if order == 1:
        return 0.0
    family = name.split()[0].replace("Quadrilateral", "Quadrangle")  # Gmsh has two words
    first = mesh.getElementType(family, 1)
    places = np.zeros((count, 3))
    places[:, :dim] = np.reshape(local, (count, dim))
    _, values, _ = mesh.getBasisFunctions(first, places.ravel(), "Lagrange")
    shapes = np.reshape(values, (count, corners))
    tags, points, _ = mesh.getNodes()
    sort = np.argsort(tags)
    tags, points = tags[sort], np.reshape(points, (-1, 3))[sort]
    nodes = np.reshape(mesh.getElementsByType(kind)[1], (-1, count))
    worst = 0.0
    for some in np.array_split(nodes, 1 + len(nodes) // 100000):
        at = points[np.searchsorted(tags, some)]
        away = np.linalg.norm(at - np.einsum("nc,ecd->end", shapes, at[:, :corners]), axis=2)
        size = np.ptp(at, axis=1).max(axis=1)
        worst = max(worst, float((away.max(axis=1) / size).max(initial=0.0)))
    return worst

def holdings():
    mesh = gmsh.model.mesh
    elements, order, bent, groups = {}, 1, 0.0, []
    for kind in mesh.getElementTypes(dim):
        name, _, degree, *_ = mesh.getElementProperties(kind)
        name = name.split()[0].lower()
        elements[name] = elements.get(name, 0) + len(mesh.getElementsByType(kind)[0])
        order = max(order, degree)
        if not meshed:  # others have nodes on the geometry
            bent = max(bent, off_straight(kind))
    for side, tag in gmsh.model.getPhysicalGroups():
        entities = [int(entity) for entity in gmsh.model.getEntitiesForPhysicalGroup(side, tag)]
        lists = [tags for entity in entities for tags in mesh.getElements(side, abs(entity))[1]]
        points = mesh.getNodesForPhysicalGroup(side, tag)[1]
        axes = [points[axis::3] for axis in range(3)]
        groups.append({
            "name": gmsh.model.getPhysicalName(side, tag) or str(tag), "dim": side,
            "elements": sum(len(tags) for tags in lists), "entities": entities,
            "low": [float(min(axis, default=0.0)) for axis in axes],
            "high": [float(max(axis, default=0.0)) for axis in axes],
        })
    return {"elements": elements, "order": order, "bent": bent, "groups": groups}

def arrays():
    import numpy as np
    mesh = gmsh.model.mesh
    tags, points, _ = mesh.getNodes()
    found = {"tags": tags, "points": points}
    found |= {f"cells{n}": mesh.getElementsByType(kind)[1] for n, kind in ((3, 2), (4, 4))}
    lists = mesh.getElements(dim)[2]
    found["used"] = np.unique(np.concatenate(lists)) if lists else np.zeros(0, dtype=np.uint64)
    others = [kind for kind in mesh.getElementTypes() if kind not in (1, 2, 4, 15)]
    kinds = [mesh.getElementProperties(kind)[0] for kind in others]
    np.savez(target, others=np.array(kinds, dtype=str), **found)

try:
    with bounded():
        if job["meshio"]:
            load(source, job["meshio"], gmsh)
        else:
            gmsh.open(source)
    step = source.endswith((".step", ".stp"))
    meshed = step or source.endswith(".geo")
    if step:
        label(choose())
    if meshed:
        box = gmsh.model.getBoundingBox(-1, -1)
        extent = max(b - a for a, b in zip(box[:3], box[3:]))
        along = [(extent, job["size"] or extent)]
        along += [(min(extent, 2.0 * ball["Radius"]), ball["VIn"]) for ball in job["balls"]]
        for length, size in along:
            if length > job["most"] * size:
                sys.exit(
                    f"{length / size:.2g} elements of {job['unit'] * size:.2g} m would lie along "
                    "the body or a ball of refine, which no memory holds; give larger sizes"
                )
        for name, value in job["options"].items():
            gmsh.option.setNumber(name, value)
        grade()
        gmsh.model.mesh.generate(dim)
    found = holdings()
    if job["cut"]:
        gmsh.model.mesh.refine()
    kinds = [int(kind) for kind in gmsh.model.mesh.getElementTypes(dim)]
    if degree and kinds and not set(kinds) <= set(job["kinds"]):
        gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
        if not meshed:  # its surfaces may be in units of their own
            gmsh.option.setNumber("Mesh.SecondOrderLinear", 1)
        gmsh.model.mesh.setOrder(degree)
    gmsh.model.mesh.renumberElements()
    errors += [line for line in gmsh.logger.get() if line.startswith("Error")]
    for option, value in (("SaveAll", 1), ("MshFileVersion", 4.1), ("Binary", 1)):
        gmsh.option.setNumber("Mesh." + option, value)
    if job["arrays"]:
        arrays()
    else:
        gmsh.write(target)
    with open(target + ".json", "w", encoding="utf-8") as file:
        json.dump(found, file)
except UnicodeError:  # Gmsh repeats what it cannot read, which here is no text
    errors.insert(0, "the file holds bytes that are no text where a mesh file has words")
except MemoryError:
    errors.insert(0, "it takes more memory than a file of its size may")
except Exception as error:
    errors.insert(0, str(error))
sys.exit(errors[0] if errors else 0)
"""

"""A scene of `rigid_peers.py` in Drake: python rigid_drake.py CASE as JSON.

With contact: discrete steps with the approximation and solver that the case names (``sap`` or
``tamsi``), point contact of stiffness 1e8 N/m a point, stiction tolerance 1e-7 m/s; boxes stand on
four spheres of 1 mm at their corners, which meet the box below, and start as deep as their weight
presses them; stacks settle for 1 s, not timed. Top and chain: continuous,
Runge and Kutta's third order, its steps fixed.
"""

import json
import sys
import time
from importlib.metadata import version

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    CollisionFilterDeclaration,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

STIFF, FOOT, SETTLE = 1e8, 1e-3, 1.0
TOUCHING = {"floor", "plane_top"}


def inertia(mass: float, center: list, principal: list) -> SpatialInertia:
    """With moments about the centre."""
    about = UnitInertia(*(np.array(principal) / mass))
    return SpatialInertia.MakeFromCentralInertia(mass, center, about * mass)


def floor(case: dict, plant: object, graph: object) -> list:
    """Ball or boxes; bodies with their heights."""
    laws = ProximityProperties()
    AddContactMaterial(
        dissipation=case.get("dissipation", 1.0), point_stiffness=STIFF,
        friction=CoulombFriction(case["mu"], case["mu"]), properties=laws,
    )  # fmt: skip
    up = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2.0))
    geometry = plant.RegisterCollisionGeometry(plant.world_body(), up, HalfSpace(), "f", laws)
    flat, feet, made = [geometry], [], []
    load = np.cumsum(case["masses"][::-1])[::-1] * -case["gravity"][1]
    sunk = 0.0
    for k, (mass, y) in enumerate(zip(case["masses"], case["heights"], strict=True)):
        if case["ball"]:
            own = SpatialInertia.SolidSphereWithMass(mass, 0.1)
        else:
            own = SpatialInertia.SolidBoxWithMass(mass, 0.2, 0.1, 0.2)
        body = plant.AddRigidBody(f"b{k}", own)
        if case["ball"]:
            plant.RegisterCollisionGeometry(body, RigidTransform(), Sphere(0.1), "s", laws)
            sunk += 2.0 * load[k] / STIFF  # two surfaces in series: half the stiffness
        else:
            flat.append(plant.RegisterCollisionGeometry(
                body, RigidTransform(), Box(0.2, 0.1, 0.2), f"box{k}", laws
            ))  # fmt: skip
            for n, (x, z) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
                at = RigidTransform([0.099 * x, FOOT - 0.05, 0.099 * z])
                feet.append(plant.RegisterCollisionGeometry(
                    body, at, Sphere(FOOT), f"foot{k}{n}", laws
                ))  # fmt: skip
            sunk += 0.5 * load[k] / STIFF
        made.append((body, y - sunk))
    if not case["ball"]:
        for group in (flat, feet):
            graph.collision_filter_manager().Apply(
                CollisionFilterDeclaration().ExcludeWithin(GeometrySet(group))
            )
    return made


def plane_top(case: dict, plant: object) -> list:
    """A top on its ball, as deep as its weight presses it; with its height."""
    laws = ProximityProperties()
    AddContactMaterial(
        dissipation=1.0, point_stiffness=STIFF, friction=CoulombFriction(0.0, 0.0),
        properties=laws,
    )  # fmt: skip
    up = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2.0))
    plant.RegisterCollisionGeometry(plant.world_body(), up, HalfSpace(), "f", laws)
    body = plant.AddRigidBody("top", inertia(1.0, [0.0] * 3, case["inertia"]))
    low = RigidTransform([0.0, -case["height"], 0.0])
    plant.RegisterCollisionGeometry(body, low, Sphere(case["radius"]), "s", laws)
    sunk = 2.0 * -case["gravity"][1] / STIFF
    return [(body, case["height"] * np.cos(case["tilt"]) + case["radius"] - sunk)]


def links(case: dict, plant: object) -> None:
    """A chain that hangs from the origin."""
    length, mass = case["link"]
    about, last = mass * length**2 / 12.0, plant.world_body()
    for k in range(case["links"]):
        link = plant.AddRigidBody(f"l{k}", inertia(mass, [length / 2, 0.0, 0.0], [about] * 3))
        at = RigidTransform([length if k else 0.0, 0.0, 0.0])
        nail = plant.AddFrame(FixedOffsetFrame(f"f{k}", last.body_frame(), at))
        plant.AddJoint(RevoluteJoint(f"j{k}", nail, link.body_frame(), [0.0, 0.0, 1.0]))
        last = link


def modelled(case: dict, plant: object, graph: object) -> list:
    """All bodies; those that are free, with their heights."""
    plant.mutable_gravity_field().set_gravity_vector(case["gravity"])
    if case["kind"] in TOUCHING:
        plant.set_discrete_contact_approximation(
            {
                "sap": DiscreteContactApproximation.kSap,
                "tamsi": DiscreteContactApproximation.kTamsi,
            }[case["solver"]]
        )
        plant.set_stiction_tolerance(1e-7)
        return floor(case, plant, graph) if case["kind"] == "floor" else plane_top(case, plant)
    if case["kind"] == "top":
        return [(plant.AddRigidBody("top", inertia(1.0, [0.0] * 3, [1.0, 2.0, 3.0])), 0.0)]
    links(case, plant)
    return []


def told(case: dict, plant: object, context: object, first: object) -> dict:
    """What is compared."""
    if case["kind"] == "chain":
        angles = np.cumsum(plant.GetPositions(context))
        tip = case["link"][0] * np.array([np.cos(angles).sum(), np.sin(angles).sum()])
        return {"tip": tip.tolist()}
    if case["kind"] == "plane_top":
        pose = plant.EvalBodyPoseInWorld(context, first).rotation().matrix()
        return {"axis": pose[:, 1].tolist()}
    results = plant.get_contact_results_output_port().Eval(context)
    force, ground = 0.0, plant.world_body().index()
    for k in range(results.num_point_pair_contacts()):
        pair = results.point_pair_contact_info(k)
        if ground in (pair.bodyA_index(), pair.bodyB_index()):
            force += abs(pair.contact_force()[1])
    way = plant.EvalBodyPoseInWorld(context, first).translation()[0]
    return {"way": way, "speed": plant.GetVelocities(context)[3], "force": force}


def run(case: dict) -> dict:
    """What the case asks for, and seconds."""
    builder, still = DiagramBuilder(), case["kind"] not in TOUCHING
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0 if still else case["dt"])
    made = modelled(case, plant, graph)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    if still:
        ApplySimulatorConfig(
            SimulatorConfig(
                integration_scheme="runge_kutta3", max_step_size=case["dt"],
                use_error_control=False,
            ),
            simulator,
        )  # fmt: skip
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for body, y in made:
        turn = RotationMatrix.MakeXRotation(case.get("tilt", 0.0))
        plant.SetFreeBodyPose(context, body, RigidTransform(turn, [0.0, y, 0.0]))
    if made:  # spin before velocity
        speeds = plant.GetVelocities(context)
        speeds[:3], speeds[3] = turn @ case.get("spin", [0.0] * 3), case.get("speed", 0.0)
        plant.SetVelocities(context, speeds)
    simulator.Initialize()
    from_when, spins = 0.0, []
    if case["kind"] == "floor" and not case["speed"] and not case["gravity"][0]:
        from_when = SETTLE
        simulator.AdvanceTo(from_when)

    def look(_: object) -> None:
        pose = plant.EvalBodyPoseInWorld(context, made[0][0]).rotation().matrix()
        spins.append(float((pose.T @ plant.GetVelocities(context)[:3])[1]))

    if case["kind"] == "top":
        simulator.set_monitor(look)
    begin = time.process_time()
    simulator.AdvanceTo(from_when + case["duration"])
    found = {"seconds": time.process_time() - begin, "version": version("drake")}
    if case["kind"] == "top":
        return found | {"spins": spins}
    return found | told(case, plant, context, made[0][0] if made else None)


if __name__ == "__main__":
    print(json.dumps(run(json.loads(sys.argv[1]))))

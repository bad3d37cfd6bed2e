"""Scenes: what is modelled and how, read from TOML or made in Python; no finite elements."""

from impactfem.scene.beam_loads import EndLoad
from impactfem.scene.beam_supports import BeamSupport
from impactfem.scene.beams import Beam, Rod
from impactfem.scene.bodies import Bar
from impactfem.scene.boundary import Pressure, Support, Traction
from impactfem.scene.contacts import Contact
from impactfem.scene.control import Control
from impactfem.scene.controllers import Controller
from impactfem.scene.couplings import SpringElement
from impactfem.scene.formula import Formula
from impactfem.scene.inverse import Limit, Measure, Objective, Parameter, Term
from impactfem.scene.joints import Joint, Soft
from impactfem.scene.loads import PiecewiseConstant, PiecewiseVector
from impactfem.scene.masses import PointMass
from impactfem.scene.materials import Material
from impactfem.scene.mechanism import JointStart, Mechanism, Place
from impactfem.scene.obstacles import (
    HalfSpace,
    RigidBox,
    RigidCylinder,
    RigidMesh,
    RigidPolyline,
    RigidSphere,
    Wall,
)
from impactfem.scene.obstacles.rotation import Rotation
from impactfem.scene.ogden import OgdenTerm
from impactfem.scene.orthotropic import OrthotropicSolid
from impactfem.scene.plate import Plate
from impactfem.scene.plate_keys import EdgeSupport, FacePressure, Layer, Orthotropic
from impactfem.scene.plate_outlines import (
    DiscOutline,
    PolygonOutline,
    RectangleOutline,
    RingOutline,
)
from impactfem.scene.points import Point, Spring
from impactfem.scene.probes import Probe
from impactfem.scene.rigid import RigidBody
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.rigid_shapes import Capsule, Ellipsoid, Hull
from impactfem.scene.scene import Scene
from impactfem.scene.schema import describe
from impactfem.scene.settings import Output, Solve
from impactfem.scene.shapes import Block, Cylinder, Disc, Ring, Sphere
from impactfem.scene.solids import Refinement, Solid
from impactfem.scene.springs import SpringNet
from impactfem.scene.ties import Tie
from impactfem.scene.toml import parse_assignment
from impactfem.scene.viscoelastic import KelvinVoigt, Maxwell, MaxwellTerm

__all__ = [
    "Bar",
    "Beam",
    "BeamSupport",
    "Block",
    "Capsule",
    "Contact",
    "Control",
    "Controller",
    "Cylinder",
    "Disc",
    "DiscOutline",
    "EdgeSupport",
    "Ellipsoid",
    "EndLoad",
    "FacePressure",
    "Formula",
    "HalfSpace",
    "Hull",
    "Joint",
    "JointStart",
    "KelvinVoigt",
    "Layer",
    "Limit",
    "Material",
    "Maxwell",
    "MaxwellTerm",
    "Measure",
    "Mechanism",
    "Objective",
    "OgdenTerm",
    "Orientation",
    "Orthotropic",
    "OrthotropicSolid",
    "Output",
    "Parameter",
    "PiecewiseConstant",
    "PiecewiseVector",
    "Place",
    "Plate",
    "Point",
    "PointMass",
    "PolygonOutline",
    "Pressure",
    "Probe",
    "RectangleOutline",
    "Refinement",
    "RigidBody",
    "RigidBox",
    "RigidCylinder",
    "RigidMesh",
    "RigidPolyline",
    "RigidSphere",
    "Ring",
    "RingOutline",
    "Rod",
    "Rotation",
    "Scene",
    "Soft",
    "Solid",
    "Solve",
    "Sphere",
    "Spring",
    "SpringElement",
    "SpringNet",
    "Support",
    "Term",
    "Tie",
    "Traction",
    "Wall",
    "describe",
    "parse_assignment",
]

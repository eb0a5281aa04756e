"""Meshes, collocation points, and trajectories on them."""

from .domain import Domain
from .gauss import GaussRule
from .grid import ConjugatePoint, Grid, RiccatiPass, adjoint, backward
from .interpolation import interpolate
from .mesh import aligned_mesh, extended, graded_mesh, growing_mesh, halved
from .mesh_settings import CLAIRVOYANT, GrowingMesh, MeshChanges, MeshSettings
from .plant import Plant, Policy
from .radau import RadauRule, radau_rule
from .settling import settle
from .trajectory import Trajectory
from .verification import reintegrate, sign_changes

__all__ = [
    "CLAIRVOYANT",
    "ConjugatePoint",
    "Domain",
    "GaussRule",
    "Grid",
    "GrowingMesh",
    "MeshChanges",
    "MeshSettings",
    "Plant",
    "Policy",
    "RadauRule",
    "RiccatiPass",
    "Trajectory",
    "adjoint",
    "aligned_mesh",
    "backward",
    "extended",
    "graded_mesh",
    "growing_mesh",
    "halved",
    "interpolate",
    "radau_rule",
    "reintegrate",
    "settle",
    "sign_changes",
]

"""Offline optimum: collocation, IPOPT, and the checks that don't trust its status."""

from .certificate import Certificate
from .direct import DirectSolution, DirectSolver
from .gamma_curve import GammaCurve, GammaCurveSolver, GammaPoint, value_against_gamma
from .plant import Plant
from .saddle import SaddleSolution, SaddleSolver
from .settings import OfflineSettings
from .solve import OfflineSolution, OfflineSolver, horizon_of, solve
from .trajectory import Trajectory

__all__ = [
    "Certificate",
    "DirectSolution",
    "DirectSolver",
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "OfflineSettings",
    "OfflineSolution",
    "OfflineSolver",
    "Plant",
    "SaddleSolution",
    "SaddleSolver",
    "Trajectory",
    "horizon_of",
    "solve",
    "value_against_gamma",
]

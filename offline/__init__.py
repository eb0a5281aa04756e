"""Offline optimum: collocation, IPOPT, and the checks that don't trust its status."""

from .certificate import Certificate
from .direct import DirectSolution, DirectSolver
from .gamma_curve import GammaCurve, GammaCurveSolver, GammaPoint, value_against_gamma
from .ideal_weights import ErrorSize, IdealWeights, Pairs, error_sizes, fit_weights
from .plant import Plant
from .saddle import SaddleSolution, SaddleSolver
from .settings import OfflineSettings
from .solve import OfflineSolution, OfflineSolver, horizon_of, solve
from .trajectory import Trajectory

__all__ = [
    "Certificate",
    "DirectSolution",
    "DirectSolver",
    "ErrorSize",
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "IdealWeights",
    "OfflineSettings",
    "OfflineSolution",
    "OfflineSolver",
    "Pairs",
    "Plant",
    "SaddleSolution",
    "SaddleSolver",
    "Trajectory",
    "error_sizes",
    "fit_weights",
    "horizon_of",
    "solve",
    "value_against_gamma",
]

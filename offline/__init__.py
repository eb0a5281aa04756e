"""Offline optimum: collocation, IPOPT, and the checks that don't trust its status."""

from .best_response import BestResponse, SaddleGap
from .certificate import Certificate
from .direct import DirectSolution, DirectSolver
from .gamma_curve import GammaCurve, GammaCurveSolver, GammaPoint, value_against_gamma
from .ideal_weights import ErrorSize, IdealWeights, Pairs, error_sizes, fit_weights
from .l2_gain import GainMeter, MeasuredGain
from .plant import Plant
from .policy import ControlPolicy, learned_policy, linear_policy
from .saddle import SaddleSolution, SaddleSolver
from .schedule import ScheduledWorstCase, WeightSchedule
from .settings import OfflineSettings
from .solve import OfflineSolution, OfflineSolver, horizon_of, solve
from .trajectory import Trajectory
from .worst_case import WorstCase, WorstCaseSolver

__all__ = [
    "BestResponse",
    "Certificate",
    "ControlPolicy",
    "DirectSolution",
    "DirectSolver",
    "ErrorSize",
    "GainMeter",
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "IdealWeights",
    "MeasuredGain",
    "OfflineSettings",
    "OfflineSolution",
    "OfflineSolver",
    "Pairs",
    "Plant",
    "SaddleGap",
    "SaddleSolution",
    "SaddleSolver",
    "ScheduledWorstCase",
    "Trajectory",
    "WeightSchedule",
    "WorstCase",
    "WorstCaseSolver",
    "error_sizes",
    "fit_weights",
    "horizon_of",
    "learned_policy",
    "linear_policy",
    "solve",
    "value_against_gamma",
]

"""Offline optimum: collocation, IPOPT, and the checks that don't trust its status."""

from .certificate import Certificate
from .direct import DirectSolution, DirectSolver
from .ideal_weights import ErrorSize, IdealWeights, Pairs, error_sizes, fit_weights
from .path import Plant, Trajectory
from .responses import (
    BestResponse,
    ControlPolicy,
    GainMeter,
    MeasuredGain,
    SaddleGap,
    ScheduledWorstCase,
    WeightSchedule,
    WorstCase,
    WorstCaseSolver,
    learned_policy,
    linear_policy,
)
from .saddle import (
    GammaCurve,
    GammaCurveSolver,
    GammaPoint,
    SaddleSolution,
    SaddleSolver,
    value_against_gamma,
)
from .settings import OfflineSettings
from .solve import OfflineSolution, OfflineSolver, horizon_of, solve

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

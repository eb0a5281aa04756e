"""Offline optimum: collocation, IPOPT, and the checks that don't trust its status."""

from .certificate import Certificate
from .direct import DirectSolution, DirectSolver, QuickValue
from .ideal_weights import ErrorSize, IdealWeights, Pairs, error_sizes, fit_weights
from .limits import EndedByLimitError, Limits, Reached
from .path import MeshSettings, Plant, Trajectory
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
    saddle_gap,
    worst_case,
)
from .saddle import (
    GammaCurve,
    GammaCurveSolver,
    GammaPoint,
    SaddleSolution,
    SaddleSolver,
    gamma_curve,
)
from .settings import OfflineSettings, horizon_of
from .solve import OfflineSolution, OfflineSolver, solve

__all__ = [
    "BestResponse",
    "Certificate",
    "ControlPolicy",
    "DirectSolution",
    "DirectSolver",
    "EndedByLimitError",
    "ErrorSize",
    "GainMeter",
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "IdealWeights",
    "Limits",
    "MeasuredGain",
    "MeshSettings",
    "OfflineSettings",
    "OfflineSolution",
    "OfflineSolver",
    "Pairs",
    "Plant",
    "QuickValue",
    "Reached",
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
    "gamma_curve",
    "horizon_of",
    "learned_policy",
    "linear_policy",
    "saddle_gap",
    "solve",
    "worst_case",
]

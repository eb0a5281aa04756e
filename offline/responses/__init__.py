"""Responses of one player to the other: best response, worst case, gain, clairvoyant control."""

from .best_response import BestResponse, SaddleGap
from .clairvoyant import Clairvoyant, ClairvoyantSolver, Policy
from .l2_gain import GainMeter, MeasuredGain
from .policy import ControlPolicy, learned_policy, linear_policy
from .schedule import ScheduledWorstCase, WeightSchedule
from .worst_case import WorstCase, WorstCaseSolver, unbounded

__all__ = [
    "BestResponse",
    "Clairvoyant",
    "ClairvoyantSolver",
    "ControlPolicy",
    "GainMeter",
    "MeasuredGain",
    "Policy",
    "SaddleGap",
    "ScheduledWorstCase",
    "WeightSchedule",
    "WorstCase",
    "WorstCaseSolver",
    "learned_policy",
    "linear_policy",
    "unbounded",
]

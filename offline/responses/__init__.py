"""Responses of one player to the other: best response, worst case, gain, clairvoyant control."""

from .best_response import BestResponse, SaddleGap, saddle_gap
from .clairvoyant import Clairvoyant, ClairvoyantSolver, Policy
from .l2_gain import GainMeter, MeasuredGain
from .policy import ControlPolicy, learned_policy, linear_policy
from .schedule import ScheduledWorstCase, WeightSchedule
from .worst_case import WorstCase, WorstCaseSolver, unbounded, worst_case

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
    "saddle_gap",
    "unbounded",
    "worst_case",
]

"""The saddle point by Pontryagin's equations, and the value against γ."""

from .gamma_curve import GammaCurve, GammaCurveSolver, GammaPoint, value_against_gamma
from .saddle import SaddleSolution, SaddleSolver

__all__ = [
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "SaddleSolution",
    "SaddleSolver",
    "value_against_gamma",
]

"""The saddle point by Pontryagin's equations, and the value against γ."""

from .gamma import GammaCurve, GammaCurveSolver, GammaPoint, gamma_curve
from .saddle import SaddleSolution, SaddleSolver

__all__ = [
    "GammaCurve",
    "GammaCurveSolver",
    "GammaPoint",
    "SaddleSolution",
    "SaddleSolver",
    "gamma_curve",
]

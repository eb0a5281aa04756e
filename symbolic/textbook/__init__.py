"""Problems with few states and known answers, or known difficulties: each a function that makes one."""

from .integrators import double_integrators
from .quadrotor import quadrotor
from .two_state import two_state_game

__all__ = ["double_integrators", "quadrotor", "two_state_game"]

"""Problems of other kinds than a vehicle: for tests, examples and first steps."""

from .integrators import double_integrators
from .quadrotor import quadrotor
from .two_state import two_state_game

__all__ = ["double_integrators", "quadrotor", "two_state_game"]

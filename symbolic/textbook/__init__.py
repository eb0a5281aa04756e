"""Problems of other kinds than a vehicle: for tests, examples and first steps."""

from .two_state import two_state_game

__all__ = ["two_state_game"]

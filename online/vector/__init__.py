"""The learner's inner loops in compiled vector code, `vector_rows.c`; without it numpy does it."""

from .compiled import library
from .covariance import largest_covariance

__all__ = ["largest_covariance", "library"]

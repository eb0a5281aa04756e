"""Regret and worst cases for benchmarks."""

__all__ = []

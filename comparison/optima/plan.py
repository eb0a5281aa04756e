"""Which state's optimum starts from which other's: a plan that follows from the states alone.

Boxes of at most 8 states, halved at the median of the longest side, bound what a process does in a row.
In a box each state starts from the nearest one solved before it, if that is near for its size; others
begin a chunk of their own with the linear policy. So neither the number of processes nor what an
earlier run left decides what a state starts from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...symbolic.arrays import Array

Rows = NDArray[np.int64]
LARGEST = 8
NEAR = 0.03  # beyond it the linear policy is the better start


@dataclass(frozen=True)
class Step:
    """One solve.

    Attributes
    ----------
    state : row of the states
    after : row of the state whose optimum it starts from; None for the linear policy
    """

    state: int
    after: int | None


def plan(states: Array, half_widths: Array) -> list[list[Step]]:
    """Return chunks of steps that together solve every state once; chunks don't depend on each other.

    Distances are in half-widths; a neighbour is near when it is closer than 0.03 of the state's norm.

    Parameters
    ----------
    states : (N, n)
    half_widths : (n,) of the envelope
    """
    x = states / half_widths
    chunks: list[list[Step]] = []
    for box in _boxes(x, np.arange(len(x))):
        chunks += _chunks(x, box)
    return chunks


def _boxes(x: Array, rows: Rows) -> list[Rows]:
    if len(rows) <= LARGEST:
        return [rows] if len(rows) else []
    longest = int(np.ptp(x[rows], axis=0).argmax())
    ordered = rows[np.argsort(x[rows, longest], kind="stable")]
    half = len(ordered) // 2
    return _boxes(x, ordered[:half]) + _boxes(x, ordered[half:])


def _chunks(x: Array, box: Rows) -> list[list[Step]]:
    """Grow from the state nearest to the origin, always by the state nearest to those solved."""
    points = x[box]
    size = np.linalg.norm(points, axis=1)
    gaps = np.linalg.norm(points[:, None] - points, axis=2)
    # gap to a neighbour relative to a state's own size, one row a state
    relative = np.divide(gaps, size[:, None], out=np.full_like(gaps, np.inf), where=size[:, None] > 0.0)
    first = int(size.argmin())
    chunk_of = {first: [Step(int(box[first]), None)]}
    chunks = [chunk_of[first]]
    left = [i for i in range(len(box)) if i != first]
    while left:
        solved = list(chunk_of)
        among = relative[np.ix_(left, solved)]
        row, column = np.unravel_index(int(among.argmin()), among.shape)
        state, neighbour = left.pop(int(row)), solved[int(column)]
        if among[row, column] <= NEAR:
            chunk_of[state] = chunk_of[neighbour]
            chunk_of[state].append(Step(int(box[state]), int(box[neighbour])))
        else:
            chunk_of[state] = [Step(int(box[state]), None)]
            chunks.append(chunk_of[state])
    return chunks

"""The least cost over a given time for a control that knows the whole disturbance in advance.

    V_c = min over u_1(t) of  ∫_0^T ζ'Qζ + u_1'R u_1 dt,   ζ_dot = F(ζ, u_1, t),  ζ(0) = ζ_0

without a cost after T, so that no control costs less over [0, T], whatever it knows or learns. The
disturbance is part of F as an expression of the time, and of the position where it depends on that.
F may jump at given times: these are mesh points, and the Radau point at an interval's end is taken just
before it.

IPOPT solves the collocated problem from several starts, and from the best of these on finer meshes. The
value is that of degree d + 1, its error the gap to degree d on the same mesh, of which the intervals
that miss their share are halved. What IPOPT finds are local minima. Where the starts lead to one, V_c
is that; a strong current has many, as the vehicle may lean either way and change over at any time, and
there V_c is the least that was found.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...symbolic import RunError
from ...symbolic.arrays import Array
from ..direct import PointDerivatives, SecondOrder, Stage, input_errors
from ..limits import LimitError, Limits, limited
from ..path import CLAIRVOYANT, GrowingMesh, Trajectory, halved
from .response import Guess, Responder, Response

PATIENCE = 120  # iterations of one solve
BUDGET = 250  # iterations after which no further start or mesh is tried, once there is an answer

Policy = Callable[[float, Array], Array]
"""(t, ζ) -> u_1"""


@dataclass(frozen=True)
class Clairvoyant:
    """The optimum under a known disturbance.

    Attributes
    ----------
    value : V_c
    path : trajectory; its input is u_1
    mesh_error : relative change of the value by one degree; NaN where IPOPT did not converge with one
        more, and the value is that of degree d
    second_order : whether it is a strict local minimum
    starts : (s,) cost reached from each start on the first mesh, NaN where IPOPT did not converge
        inside the domain
    rounds : of refinement
    ended : which limit ended the search before it was over, or nothing
    iterations : of IPOPT, all solves together
    seconds : wall time
    """

    value: float
    path: Trajectory
    mesh_error: float
    second_order: SecondOrder
    starts: Array
    rounds: int
    ended: str
    iterations: int
    seconds: float


@dataclass(frozen=True)
class _Pair:
    """Answers of degree d and d + 1 on one mesh."""

    coarse: Response
    fine: Response
    confirmed: bool = True

    @property
    def size(self) -> float:
        return max(self.fine.cost, np.finfo(float).tiny)

    @property
    def error(self) -> float:
        """Relative change of the cost by the degree; NaN where degree d + 1 did not converge."""
        if not self.confirmed:
            return np.nan
        return abs(self.fine.cost - self.coarse.cost) / self.size


class ClairvoyantSolver:
    """Solves a stage of `against_known`, whose parameter is the time.

    Parameters
    ----------
    stage : the plant with its disturbance, and the cost
    R : (k, k) weight of the input, for the mesh
    horizon : T [s]
    breaks : times at which F is not smooth [s]
    mesh : the first, and d of the Radau collocation
    tolerance : relative change of the value at which refinement ends
    rounds : of refinement at most
    limits : of one solve; one that reaches them gives the best that it has
    compiled : the derivatives, with the disturbance's own numbers in them
    """

    def __init__(
        self,
        stage: Stage,
        R: Array,
        horizon: float,
        breaks: tuple[float, ...] = (),
        *,
        mesh: GrowingMesh = CLAIRVOYANT,
        tolerance: float = 1e-5,
        rounds: int = 5,
        limits: Limits | None = None,
        compiled: bool = False,
    ) -> None:
        self.limits = Limits() if limits is None else limits
        self.stage, self.R = stage, R
        self.tolerance, self.rounds = tolerance, rounds
        self._mesh = mesh.points(horizon, np.array(breaks))
        derivatives = PointDerivatives(stage, compiled=compiled)
        self._coarse, self._fine = (
            Responder(stage, d, derivatives=derivatives, patience=PATIENCE)
            for d in (mesh.degree, mesh.degree + 1)
        )

    def solve(self, zeta0: Array, policies: Iterable[Policy]) -> Clairvoyant:
        """Return the optimum from ζ_0.

        Parameters
        ----------
        policies : simulated for starts, of which a plain return to rest is another

        Raises
        ------
        RunError
            If IPOPT converges from no start; the message holds its last status, or the limit.
        """
        with limited(self.limits) as work:
            return replace(self._solve(zeta0, policies), ended=work.ended)

    def _solve(self, zeta0: Array, policies: Iterable[Policy]) -> Clairvoyant:
        started = time.perf_counter()
        found, starts, iterations = self._search(zeta0, self._starts(zeta0, policies))
        pair = self._confirmed(zeta0, found)
        iterations += pair.fine.iterations
        rounds = 1
        while pair.error > self.tolerance and rounds < self.rounds and iterations < BUDGET:
            try:
                finer = self._refined(zeta0, pair)
            except (RunError, LimitError):
                break  # what was found stays, with its error
            rounds, iterations = (
                rounds + 1,
                iterations + finer.coarse.iterations + finer.fine.iterations,
            )
            if finer.fine.cost > pair.fine.cost + pair.error * pair.size:
                break  # another, dearer minimum
            pair = finer
        return Clairvoyant(
            value=pair.fine.cost,
            path=pair.fine.path,
            mesh_error=pair.error,
            second_order=pair.fine.second_order,
            starts=starts,
            rounds=rounds,
            ended="",
            iterations=iterations,
            seconds=time.perf_counter() - started,
        )

    def _confirmed(self, zeta0: Array, found: list[Response]) -> _Pair:
        """Return the pair of the cheapest answer that a degree more confirms, else of the cheapest."""
        ordered = sorted(found, key=lambda response: response.cost)
        for coarse in ordered:
            with suppress(RunError, LimitError):
                return _Pair(coarse, self._continued(self._fine, zeta0, self._mesh, coarse.path))
        return _Pair(ordered[0], ordered[0], confirmed=False)

    def _refined(self, zeta0: Array, pair: _Pair) -> _Pair:
        """Return the pair on a mesh with the intervals halved whose error of the input is too large."""
        path = pair.fine.path
        shares = input_errors(pair.coarse.path, path, self.R) / pair.size
        over = shares > self.tolerance / len(shares)
        mesh = halved(path.mesh, over if over.any() else ~over)
        coarse = self._continued(self._coarse, zeta0, mesh, path)
        return _Pair(coarse, self._continued(self._fine, zeta0, mesh, coarse.path))

    def _search(self, zeta0: Array, guesses: Iterable[Guess]) -> tuple[list[Response], Array, int]:
        """Return the answers from the guesses, the cost from each, and the iterations spent."""
        found, costs, iterations = list[Response](), list[float](), 0
        failure = RunError("there is no start")
        for guess in guesses:
            try:
                found.append(self._respond(self._coarse, zeta0, self._mesh, [guess]))
                costs.append(found[-1].cost)
                iterations += found[-1].iterations
            except RunError as error:
                failure = error
                costs.append(np.nan)
                iterations += PATIENCE
            except LimitError:
                if not found:
                    raise
                break
            if found and iterations >= BUDGET:
                break
        if not found:
            raise failure
        return found, np.array(costs), iterations

    def _starts(self, zeta0: Array, policies: Iterable[Policy]) -> Iterator[Guess]:
        """Yield a return to rest without control, and a simulation of each policy that allows it."""
        times = self._coarse.times(self._mesh)
        yield zeta0 * np.exp(-times[:, None]), np.zeros((len(times), self.stage.w.shape[0]))
        for policy in policies:
            with suppress(RunError):
                yield self._coarse.rollout(zeta0, times, policy, lambda t: np.array([t]))

    def _continued(self, responder: Responder, zeta0: Array, mesh: Array, path: Trajectory) -> Response:
        return self._respond(responder, zeta0, mesh, [path.sample(responder.times(mesh))])

    def _respond(
        self, responder: Responder, zeta0: Array, mesh: Array, guesses: Iterable[Guess]
    ) -> Response:
        """Solve with the time as parameter, at an interval's end that of the instant before it."""
        clock = np.nextafter(responder.times(mesh), 0.0)
        return responder.best(zeta0, mesh, guesses, clock[:, None])

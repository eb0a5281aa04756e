"""The paper's central claim: the weights converge without persistence of excitation.

The same run without and with sample points, from half of the Riccati weights: how many
directions of the regressor the trajectory has excited so far, the rank margin of (18), and the distance
to the weights that are right. Those are known exactly for the linearised problem (ζ'P ζ is its value);
for the problem itself the reference is the fixed point of the same rule on ten times as many samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...offline import Plant
from ...online import AS_PRINTED, Learner, LearnerSettings, draw_samples, rank_margin
from ...online.learning import learning_period
from ...symbolic import Basis, Problem, RunError, Setup, quadratic
from ...symbolic.arrays import Array
from ..scenario import Scenario
from .game_run import advance
from .pace import pace
from .words import subject

# the Bellman error alone, without what holds the weights
PLAIN: dict[str, Any] = AS_PRINTED | {
    "rule": "least_squares",
    "normalizer": "state_cost",
    "forgetting": 2.0,
    "weight_factor": 0.5,
}


@dataclass(frozen=True)
class ExcitationRun:
    """One run of the comparison, sampled at the learning steps.

    Attributes
    ----------
    name : for the legend
    n_samples : N
    time : (T,) [s]
    excited : (T,) eigenvalues of ∫ ω ω' / (1 + ω'ω) dt above 1e-6 of the largest
    rank_margin : (T,) λ_min of (18)
    weight_error : (T,) |Ŵ_c - W*| / |W*|
    n_basis : m
    stopped : why the run ended early, or None
    """

    name: str
    n_samples: int
    time: Array
    excited: Array
    rank_margin: Array
    weight_error: Array
    n_basis: int
    stopped: str | None


def excitation_runs(
    scenario: Scenario, *, n_samples: int = 300, duration: float = 30.0, shrink: float = 0.3
) -> dict[str, list[ExcitationRun]]:
    """Return three runs each on the linearised problem and on the problem, by what they are called.

    N = 0 and N = `n_samples` under the very same settings, and N = 0 again with the covariance held so
    low that the run can't jump: without samples the first rows, few and alike, throw the weights far
    off in every direction they don't know.

    With the quadratic monomials and without leash, so that nothing but the data moves the weights, and
    in the part `shrink` of the scenario's envelope, where the monomials still have a meaning. The time
    [s] and the gains are for the pace of the shipped vehicle, and follow that of another problem.
    """
    setup, name = scenario.setup(), subject(scenario.setup())
    period = learning_period(setup.problem, scenario.learner)
    eager = scenario.learner.model_copy(update=plain(setup, period) | {"period": period})
    cautious = eager.model_copy(update={"covariance": 1e2, "covariance_bound": 1e3})
    envelope, start = shrink * setup.envelope, shrink * scenario.initial_state
    seed = scenario.samples.seed
    runs = {}
    linearized = setup.problem.linearized()
    for label, problem in ((f"linearised {name}", linearized), (name, setup.problem)):
        basis = Basis.build("quadratic", quadratic, problem.zeta, setup.half_widths)
        many = draw_samples(envelope, 10 * n_samples, seed + 1)
        riccati = basis.quadratic_weights(problem.P)
        exact = problem is linearized
        ideal = riccati if exact else fixed_point(problem, basis, eager, many)
        runs[label] = [
            excitation_run(
                run,
                problem,
                basis,
                settings,
                draw_samples(envelope, n, seed),
                start,
                ideal,
                duration / pace(setup),
            )
            for run, settings, n in (
                ("N = 0", eager, 0),
                ("N = 0, covariance held low", cautious, 0),
                (f"N = {n_samples}", eager, n_samples),
            )
        ]
    return runs


def plain(setup: Setup, period: float) -> dict[str, Any]:
    """Return `PLAIN` at the pace of a problem that is learned in periods [s]."""
    faster = pace(setup)
    gain = 2.0 * faster
    rates = {"gain_actor_1": gain, "gain_actor_2": gain, "forgetting": min(gain, 0.99 / period)}
    return PLAIN if faster == 1.0 else PLAIN | rates


def fixed_point(
    problem: Problem, basis: Basis, settings: LearnerSettings, samples: Array, steps: int = 60
) -> Array:
    """Return the weights at which the rule comes to rest on `samples`, shape (m,)."""
    learner = Learner(problem, basis, settings, samples, basis.quadratic_weights(problem.P))
    origin = np.zeros(problem.n_states)
    for _ in range(steps):
        learner.step(origin, 1.0 / settings.forgetting)
    return learner.critic


def excitation_run(
    name: str,
    problem: Problem,
    basis: Basis,
    settings: LearnerSettings,
    samples: Array,
    zeta0: Array,
    ideal: Array,
    duration: float,
) -> ExcitationRun:
    """Learn along one trajectory in game mode, policies evaluated continuously."""
    learner = Learner(problem, basis, settings, samples, basis.quadratic_weights(problem.P))
    plant = Plant(problem)
    zeta, dt = zeta0, learning_period(problem, settings)
    gram = np.zeros((basis.n_basis, basis.n_basis))
    rows: list[tuple[float, float, float, float]] = []
    stopped = None
    for i in range(round(duration / dt) + 1):
        omega = _regressor(learner, plant, zeta)
        gram += dt * np.outer(omega, omega) / (1.0 + omega @ omega)
        spectrum = np.linalg.eigvalsh(gram)
        excited = float(np.sum(spectrum > 1e-6 * max(spectrum[-1], 1e-300)))
        error = float(np.linalg.norm(learner.critic - ideal) / np.linalg.norm(ideal))
        margin = rank_margin(learner.sample_residual().omega)
        rows.append((i * dt, excited, margin, error))
        try:
            learner.step(zeta, dt)
            zeta = advance(learner, plant, zeta, dt)
        except (RunError, np.linalg.LinAlgError) as fault:
            stopped = f"ended at t = {i * dt:.2f} s: {fault}"
            break
    time, excited_count, margins, error_series = np.array(rows).T
    return ExcitationRun(
        name=name,
        n_samples=len(samples),
        time=time,
        excited=excited_count,
        rank_margin=margins,
        weight_error=error_series,
        n_basis=basis.n_basis,
        stopped=stopped,
    )


def _regressor(learner: Learner, plant: Plant, zeta: Array) -> Array:
    u_control, u_disturbance = learner.policies(zeta)
    (sigma_prime,) = learner.functions.sigma_prime(zeta)
    return np.asarray(sigma_prime @ plant.rate(zeta, u_control + u_disturbance))

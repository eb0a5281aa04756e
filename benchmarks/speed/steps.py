"""Time of a step: model functions, policy, learner and closed loop, beside numpy, bounds and MPC.

    python benchmarks/speed/steps.py

Processor time, medians over repeated batches in one process; compare the ratios, not the absolute times
of a machine. The numpy beside the learner is the straightforward one: einsum of dense σ' f and σ' g, an
explicit step of (19) or numpy.linalg.solve. The bounds are what any implementation has to do once a
step, at the rates that this machine reaches in this run: the multiplications and additions of the rows
from sparse terms (and for least squares of the normal matrix and its Cholesky factor) at the rate of
numpy's product of 512 x 512 matrices; and one reading of the terms and one writing and reading of ω at
the rate of a dot product of vectors of that size. Our gradient step is the exact flow: it needs more.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable

import numpy as np
from stationkeep.comparison import Scenario
from stationkeep.comparison.merit import run_metrics
from stationkeep.comparison.policies import CONTENDERS
from stationkeep.comparison.policies.mpc import ModelPredictive, PredictionSettings
from stationkeep.comparison.records import online_record
from stationkeep.offline import QuickValue
from stationkeep.online import AS_PRINTED, Controller, Learner, Policy, draw_samples, run
from stationkeep.online.laws import row_weights
from stationkeep.symbolic import Kernel, Model, StationKeeping, ValueFunctions
from stationkeep.symbolic.arrays import Array

FIXED = ("learner.error=bellman", "learner.safeguard=false")
FAR = (2.0, -1.0, 1.0, 0.3, -0.2, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ACADOS = 960.0  # us a step at a horizon of 4 s, real-time iteration; on another machine


def microseconds(call: Callable[[], object], calls: int, batches: int = 9) -> float:
    """Return the median time of one call [us]."""
    times = []
    for _ in range(batches):
        started = time.process_time()
        for _ in range(calls):
            call()
        times.append((time.process_time() - started) / calls)
    return 1e6 * statistics.median(times)


def functions() -> None:
    """Print compiled against virtual machine, and through buffers against CasADi's own call."""
    station = Scenario.load().station_keeping()
    zeta = 0.1 * np.ones(12)
    print(
        f"{'function':<16}{'compiled [us]':>15}{'virtual m. [us]':>17}{'ratio':>8}{'__call__ [us]':>15}"
    )
    kernels: dict[str, tuple[Kernel, Kernel]] = {}
    models = [Model(station.model.vehicle, compiled=c) for c in (True, False)]
    values = [ValueFunctions(station.problem, station.basis, compiled=c) for c in (True, False)]
    for name in ("plant", "drift_jacobian"):
        kernels[name] = (getattr(models[0], name), getattr(models[1], name))
    for name in ("sigma", "sigma_prime", "policies"):
        kernels[name] = (getattr(values[0], name), getattr(values[1], name))
    for name, (compiled, virtual) in kernels.items():
        compiled.inputs[0][...] = zeta
        virtual.inputs[0][...] = zeta
        fast, slow = microseconds(compiled.evaluate, 3000), microseconds(virtual.evaluate, 1000)
        arguments = [np.array(array) for array in compiled.inputs]
        call = microseconds(lambda f=compiled.function, a=arguments: f(*a), 200)  # type: ignore[misc]
        print(f"{name:<16}{fast:>15.2f}{slow:>17.2f}{slow / fast:>8.1f}{call:>15.1f}")


def straightforward(
    station: StationKeeping, points: Array, weights: tuple[Array, Array, Array], rule: str
) -> Callable[[], object]:
    """Return a learner step as one would write it first, of fixed samples."""
    terms, game = station.functions.at(points), station.game
    f, g, sigma_prime = (np.array(a) for a in (terms.f, terms.g, terms.sigma_prime))
    state_cost = np.einsum("ni,ij,nj->n", points, game.Q, points)
    critic, actor_1, actor_2 = weights
    ridge = 1e-6 * np.eye(len(critic))

    def step() -> object:
        push = [
            np.einsum("nik,nmi,m->nk", g, sigma_prime, a, optimize=True) for a in (actor_1, actor_2)
        ]
        u_1, u_2 = -0.5 * push[0] @ game.R_inverse, 0.5 * push[1] @ game.disturbance_inverse
        rates = f + np.einsum("nik,nk->ni", g, u_1 + u_2)
        omega = np.einsum("nmi,ni->nm", sigma_prime, rates)
        cost = state_cost + np.einsum("ni,ij,nj->n", u_1, game.R, u_1)
        cost -= game.gamma**2 * np.einsum("ni,ij,nj->n", u_2, game.W_d, u_2)
        delta = cost + omega @ critic
        w = row_weights("paper", omega, state_cost, 1.0)
        gradient = np.einsum("n,nm,n->m", w, omega, delta)
        if rule == "gradient":
            return critic - 1e-3 * gradient
        normal = np.einsum("n,nm,nl->ml", w, omega, omega, optimize=True)
        return critic - np.linalg.solve(normal + ridge, gradient)

    return step


def bounds(station: StationKeeping, n_rows: int, rule: str) -> tuple[float, float]:
    """Return the bounds by arithmetic and by memory traffic [us]."""
    layout, m = station.functions.term_layout, station.basis.n_basis
    a = np.random.default_rng(0).standard_normal((512, 512))
    rate = 2.0 * 512**3 / microseconds(lambda: a @ a, 3)  # operations per us
    operations = n_rows * (6.0 * len(layout.row) + 8.0 * len(layout.state) + 6.0 * m)
    if rule == "least_squares":
        operations += n_rows * m * (m + 1.0) + m**3 / 3.0
    size = n_rows * (layout.n_entries + 2 * m)
    x = np.ones(size)
    return operations / rate, microseconds(lambda: x @ x, 50)


def learner() -> None:
    """Print the time of a learning step for both laws and two sizes."""
    print(f"\nnumpy {np.__version__}; times in us, fixed samples, w = 1/p")
    print(
        f"{'learner step':<16}{'functions':>10}{'samples':>9}{'ours':>8}{'numpy':>8}{'ratio':>7}"
        f"{'arithmetic':>12}{'memory':>8}{'ours/bound':>12}"
    )
    for basis, number in (("quadratic", 300), ("drag", 800)):
        scenario = Scenario.load(overrides=[f"basis.name={basis}"])
        station = scenario.station_keeping()
        points = draw_samples(station.envelope, number, 1)
        weights = station.riccati_weights
        for rule, dt in (("gradient", 0.01), ("least_squares", 0.05)):
            settings = scenario.learner.model_copy(update=AS_PRINTED | {"rule": rule})
            actor_critic = Learner(
                station.problem, station.basis, settings, points, weights, None, station.functions
            )
            zeta = scenario.initial_state
            ours = microseconds(lambda a=actor_critic, z=zeta, d=dt: a.step(z, d), 100)  # type: ignore[misc]
            plain = microseconds(straightforward(station, points, (weights,) * 3, rule), 20)
            arithmetic, memory = bounds(station, number + 1, rule)
            print(
                f"{rule:<16}{station.basis.n_basis:>10}{number:>9}{ours:>8.0f}{plain:>8.0f}"
                f"{plain / ours:>7.1f}{arithmetic:>12.1f}{memory:>8.1f}"
                f"{ours / max(arithmetic, memory):>12.1f}"
            )


def closed_loops(duration: float = 30.0) -> None:
    """Print how much faster than real time whole runs are."""
    fixed = [*FIXED, "basis.name=quadratic", "samples.number=300", "simulation.control_period=0.01"]
    runs = {
        "gradient 100 Hz, 78 functions": [*fixed, "learner.rule=gradient", "learner.period=0.01"],
        "least squares 20 Hz, control 100 Hz, 78": [*fixed, "learner.period=0.05"],
        "least squares 20 Hz, control 50 Hz, 78": [
            *fixed,
            "learner.period=0.05",
            "simulation.control_period=0.02",
        ],
        "shipped: predictions 4 Hz, 144": [],
    }
    print(
        f"\n{'closed loop':<42}{'x real time, processor':>24}{'wall clock':>12}{'policy mean [us]':>18}"
    )
    for name, overrides in runs.items():
        scenario = Scenario.load(overrides=[*overrides, f"simulation.duration={duration}"])
        policy = Controller(scenario)
        history = run(scenario, policy)
        print(
            f"{name:<42}{history.time[-1] / history.processor_seconds:>24.0f}"
            f"{history.time[-1] / history.wall_seconds:>12.0f}{1e6 * history.policy_mean:>18.1f}"
            f"  {history.stopped or ''}",
            flush=True,
        )


def predictive_control() -> None:
    """Print regret and time a control step of learned, linear and predictive policies, from afar."""
    scenario = Scenario.load().with_settings(simulation={"initial_state": FAR})
    station = scenario.station_keeping()
    optimum = QuickValue(station.problem)(np.array(FAR))
    makers: dict[str, Callable[[], Policy]] = {
        "learned": lambda: Controller(scenario),
        "linear H-infinity": lambda: CONTENDERS["linear"].make(scenario),
        "MPC 3 s": lambda: ModelPredictive(station, PredictionSettings(horizon=3.0)),
        "MPC 4 s": lambda: ModelPredictive(station, PredictionSettings(horizon=4.0)),
    }
    print(
        f"\nfrom (2, -1, 1, .3, -.2, 1, 0, ...); acados' real-time iteration, horizon 4 s: "
        f"{ACADOS:.0f} us a step, 1.2 % (cited)\n"
        f"{'policy':<20}{'regret [%]':>11}{'median step [us]':>18}{'mean step [us]':>16}"
    )
    for name, make in makers.items():
        metrics = run_metrics(online_record(scenario, policy=make, kind=name), station, optimum)
        regret = np.nan if metrics.regret is None else 100.0 * metrics.regret
        print(
            f"{name:<20}{regret:>11.3f}{metrics.policy_microseconds:>18.1f}{metrics.policy_mean:>16.1f}"
            f"  {metrics.stopped or ''}",
            flush=True,
        )
    controller = Controller(scenario)
    kernel = controller.learner.functions.policies
    evaluated = microseconds(kernel.evaluate, 3000)
    called = microseconds(lambda: controller.learner.policies(controller.zeta), 300)
    print(f"learned policy alone: evaluation {evaluated:.2f} us, Learner.policies {called:.1f} us")


if __name__ == "__main__":
    functions()
    learner()
    closed_loops()
    predictive_control()

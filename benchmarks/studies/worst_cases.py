"""Worst cases of linear and learned policies from one state, each solved for and played."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from casadi import DM
from stationkeep.comparison.merit import regret
from stationkeep.comparison.policies import LQR, LinearPolicy, OnVehicle
from stationkeep.comparison.scenario import Scenario
from stationkeep.offline import (
    ControlPolicy,
    QuickValue,
    ScheduledWorstCase,
    Trajectory,
    WeightSchedule,
    WorstCase,
    WorstCaseSolver,
    learned_policy,
    linear_policy,
)
from stationkeep.offline.responses import unbounded
from stationkeep.online import VehiclePolicy
from stationkeep.symbolic.arrays import Array

from .adversary import FrozenPolicy, Played, WatchedController, play, settled_weights

ROUNDS = 2  # of the search against the learner; the cost that is played has settled to 1e-5 of V* then
REACH = 4.0  # half-widths at which a vehicle counts as lost


@dataclass(frozen=True)
class Exposure:
    """What a disturbance makes of a policy; costs relative to V*, (cost - V*) / V*.

    Attributes
    ----------
    excess : of the worst disturbance that was solved for; infinite if there is none
    played : of that disturbance in the closed loop; None if the run ended early or there is none
    strict : whether the second-order condition says that it is a strict local maximum
    reintegration : relative difference of the cost when scipy integrates the closed loop
    note : why there is no figure, or None
    """

    excess: float
    played: float | None
    strict: bool
    reintegration: float
    note: str | None


@dataclass(frozen=True)
class StateWorstCases:
    """All policies from one state.

    Attributes
    ----------
    zeta, value : (n,) the state and V* there
    policies : of `linear`, `lqr`, `settled` and `remembered` weights that are frozen, and `schedule`,
        the weights that the learner left behind when it met the disturbance of the round before
    against_learner : what was played against the learner while it learned on: `game` (its own
        disturbance player), `round 1`, ..., the worst disturbances of the other policies by their name,
        and `probe 1`, ...; None where the run ended early
    """

    zeta: Array
    value: float
    policies: dict[str, Exposure]
    against_learner: dict[str, float | None]

    @property
    def learner(self) -> float:
        """The largest that was played against the learner, infinite if a run ended early."""
        return max(np.inf if cost is None else cost for cost in self.against_learner.values())


class WorstCases:
    """Finds the worst cases of one scenario's policies; what can be shared is built once.

    Parameters
    ----------
    scenario : of the learner; its duration is that of every run
    remembered : (m,) weights for the whole envelope
    probes : random variations of the last disturbance that are also played against the learner
    seed : of the probes
    """

    def __init__(
        self, scenario: Scenario, remembered: Array, *, probes: int = 2, seed: int = 0
    ) -> None:
        self.scenario = scenario.with_settings(simulation={"mode": "game", "chi": REACH})
        self.station = self.scenario.station_keeping()
        self.remembered, self.probes, self.seed = remembered, probes, seed
        problem, basis, horizon = self.station.problem, self.station.basis, scenario.simulation.duration
        self._value = QuickValue(self.station.problem)
        lqr = DM(-LQR(self.station.problem).gain) @ problem.zeta
        self._linear, self._lqr = (
            WorstCaseSolver(ControlPolicy(problem, policy), reach=REACH)
            for policy in (linear_policy(problem), lqr)
        )
        self._frozen = ScheduledWorstCase(problem, basis, reach=REACH)
        self._scheduled = ScheduledWorstCase(
            problem, basis, horizon=horizon, degree=4, starts=1, reach=REACH
        )

    def at(self, zeta: Array) -> StateWorstCases:
        """Return the worst cases from ζ (n,).

        Raises
        ------
        RunError
            If V* is not found there.
        """
        scenario = self.scenario.with_settings(simulation={"initial_state": tuple(zeta.tolist())})
        value = self._value(zeta)
        settled, problem = settled_weights(scenario, zeta), self.station.problem
        solved = {
            "linear": self._linear.solve(zeta),
            "lqr": self._lqr.solve(zeta),
            "settled": self._of_frozen(zeta, settled),
            "remembered": self._of_frozen(zeta, self.remembered),
        }
        makers: dict[str, Callable[[], VehiclePolicy]] = {
            "linear": lambda: OnVehicle(LinearPolicy(problem), self.station),
            "lqr": lambda: OnVehicle(LQR(problem), self.station),
            "settled": lambda: OnVehicle(FrozenPolicy(self.station, settled), self.station),
            "remembered": lambda: OnVehicle(FrozenPolicy(self.station, self.remembered), self.station),
        }
        policies = {
            name: _exposure(
                worst, value, None if worst.path is None else play(scenario, makers[name](), worst.path)
            )
            for name, worst in solved.items()
        }
        last, played, against = self._rounds(scenario, zeta)
        for name, path in self._others(solved, last):
            against[name] = play(scenario, WatchedController(scenario), path)
        policies["schedule"] = _exposure(last, value, played)
        relative = {name: regret(run.cost, value) for name, run in against.items()}
        return StateWorstCases(zeta, value, policies, relative)

    def _of_frozen(self, zeta: Array, weights: Array) -> WorstCase:
        problem = self.station.problem
        policy = ControlPolicy(problem, learned_policy(problem, self.station.basis, weights))
        reason = policy.excludes(problem.game.gamma)
        if reason is not None:
            return unbounded(zeta, reason, 0.0)
        return self._frozen.solve(zeta, WeightSchedule.constant(weights))

    def _rounds(self, scenario: Scenario, zeta: Array) -> tuple[WorstCase, Played, dict[str, Played]]:
        """Return the last schedule's worst case, its run, and all runs against the learner."""
        played = play(scenario, WatchedController(scenario), None)
        against, tries = {"game": played}, list[Trajectory]()
        for i in range(ROUNDS):
            assert played.schedule is not None
            worst = self._scheduled.solve(zeta, played.schedule, tries)
            if worst.path is None:
                break
            tries = [worst.path]
            played = play(scenario, WatchedController(scenario), worst.path)
            against[f"round {i + 1}"] = played
            if played.stopped is not None:
                break
        return worst, played, against

    def _others(self, solved: dict[str, WorstCase], last: WorstCase) -> list[tuple[str, Trajectory]]:
        """Return the other disturbances to play against the learner."""
        others = [(name, worst.path) for name, worst in solved.items() if worst.path is not None]
        rng = np.random.default_rng(self.seed)
        for i in range(self.probes if last.path is not None else 0):
            assert last.path is not None
            factors = 1.0 + 0.2 * rng.standard_normal(last.path.v.shape[1])
            others.append((f"probe {i + 1}", replace(last.path, v=factors * last.path.v)))
        return others


def _exposure(worst: WorstCase, value: float, played: Played | None) -> Exposure:
    cost = None if played is None or worst.path is None else played.cost
    return Exposure(
        excess=worst.excess(value),
        played=regret(cost, value),
        strict=worst.second_order is not None and worst.second_order.holds,
        reintegration=abs(worst.reintegrated / worst.cost - 1.0) if worst.path is not None else np.inf,
        note=worst.unbounded if played is None or played.stopped is None else played.stopped,
    )

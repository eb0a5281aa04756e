"""Each public function of the package once, with small settings: on the two-state game, 1 / 2 + 1."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from stationkeep import (
    Scenario,
    check,
    compare,
    export,
    gamma_curve,
    generate,
    replay,
    saddle_gap,
    solve,
    sweep,
    worst_case,
)
from stationkeep.offline import Pairs, fit_weights
from stationkeep.symbolic import two_state_game

problem = two_state_game()
ZETA = np.array([1.0, -1.0])


def main() -> dict[str, float]:
    """Return a number of each; the offline ones know the value from (1, -1), 3 / 2."""
    scenario = Scenario.load(f"{__file__}:problem", ["samples.number=50"])
    found: dict[str, float] = {"generate": len(generate(scenario).functions)}
    found["solve"] = solve(problem, ZETA).value
    found["saddle_gap"] = saddle_gap(problem, ZETA).gap
    found["worst_case"] = worst_case(problem, ZETA).cost
    found["gamma_curve"] = gamma_curve(problem, ZETA, [2.0]).points[0].value
    optima = [solve(problem, zeta) for zeta in ([1.0, 0.0], [0.0, 1.0], [0.5, 0.5])]
    basis = scenario.setup().basis  # of the state scaled by 2
    found |= zip(("11", "12", "22"), fit_weights(basis, Pairs.of(optima)).weights / 4.0, strict=True)
    found["check"] = sum(bool(condition.holds) for condition in check(scenario))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = compare(scenario, states=1, out=folder / "compare")
        assert study.regret is not None
        found["compare"] = study.regret["learned"].median
        found["write_report"] = study.write_report().stat().st_size
        record = folder / "compare" / "records" / "learned.nc"
        found["replay"] = replay(record).max_difference
        found["export"] = len(export(record)[1])
        found["sweep"] = sweep(scenario, folder / "sweep", states=2, workers=1).runs
    for function, number in found.items():
        print(f"{function:12} {number:.6g}")
    return found


if __name__ == "__main__":
    main()

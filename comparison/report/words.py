"""What a report says around its numbers, with the name of what moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...symbolic import StationKeeping
from ..optima import unit_text
from ..study import Comparison, subject

_COUNT = (
    *("no", "one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_CAPTIONS = {
    "regret": "Regret is how much more than the optimum a policy costs, from the same state. Each dot "
    "is one initial state.",
    "states": "All states under the learned policy and at the optimum.",
    "controls": "What the control asks for, with R of the cost constant.",
    "cost": "Cost so far, and how far it lies above.",
    "errors": "At each moment the optimum is solved again from the state that the {subject} is in: how "
    "far off the learned value and control are there, and how far the linear ones.",
    "weights": "The weights of the value while it is learned. W* fits the optimum best over the "
    "whole envelope; the learner fits the way that the {subject} is on, so it need not end there.",
    "bellman": "The error that is learned from, and the Bellman error at the state.",
    "monitor": "What the proof asks for along the learned run: (18) at fixed samples under the policy "
    "of the moment; in how many directions what is learned from outweighs the leash; the "
    "regressors; the bound on the weights; how far the policies are from the value; and the "
    "proof's V_L.",
    "field": "How well the equation of the optimum (HJI) is met around the {subject} (dot), over two "
    "of its {count} states; the line is its way.",
    "excitation": "The paper's claim: with sample points the weights converge although the way excites "
    "only a few directions; without, they stay where they were or the run is lost. The right weights "
    "are known exactly for the linearised {subject}.",
}
_VEHICLE_CAPTIONS = {
    "energy": "What it takes to hold the station, against how well it is held. Energy is that of "
    "the thrusters where their power is known.",
    "path": "The way back in space and from above.",
    "states": "The pose on the way back, under the learned policy and at the optimum.",
    "rates": "The rates on the same way.",
    "forces_body": "Wrench that the thrusters are asked for, with what they can give on each axis "
    "alone.",
    "forces_earth": "Control in the earth frame. The cost weighs this, J⁻ᵀτ_b, not the body effort.",
    "thrusters": "Thrust of each thruster, with the least sum of squares.",
}
_COLUMNS = (
    "From the state above; median and worst are those of the regret from all states. {sizes} Step: "
    "mean computing time of one control step, learning or predicting included."
)
_VEHICLE_SIZES = (
    "rms: distance from the station. Energy: electrical, of the thrusters. Peak thrust: largest share "
    "of a thruster's limit."
)
_SCALED_SIZE = "rms: of the state in half-widths of the envelope, over the run."
_WORDS = {
    "optimum": "the least cost that the game allows, computed offline for the exact model, with a "
    "certificate of its error",
    "learned": "the policy that learns while the {subject} moves, from the linear one on",
    "linear H-infinity": "the policy of the linearised game (its Riccati equation); learns nothing",
    "regret": "cost of a policy minus V*, divided by V*",
    "V*": "the cost of the optimum",
    "γ": "how dear the disturbance's effort is; a small γ prepares for a strong disturbance",
}
_LEARNER = (
    "The learner has {m} basis functions, starts from the linear H-infinity policy, and learns only "
    "during the run that is scored."
)
CHECKED = (
    "The certificate above is that of the game's optimum, which V* and the errors along the way refer "
    "to. The clairvoyant optimum is checked on its own: the plant of the runs is integrated with its "
    "control, and it is solved from several starts. Where these lead to different minima, it is the "
    "least of them, and one that was not found may be lower still."
)


@dataclass(frozen=True)
class Words:
    """What a report says.

    Attributes
    ----------
    title : of the problem
    asked : what was asked
    columns : what stands in the columns of the summary
    captions : of figures by name
    words : what is explained, by the word
    """

    title: str
    asked: str
    columns: str
    captions: dict[str, str]
    words: dict[str, str]


def words_of(comparison: Comparison) -> Words:
    """Return what the report of a comparison says."""
    setup = comparison.setup
    vehicle = isinstance(setup, StationKeeping)
    moving, n = subject(setup), setup.problem.n_states
    count = _COUNT[n] if n < len(_COUNT) else str(n)
    captions = _CAPTIONS | (_VEHICLE_CAPTIONS if vehicle else {})
    words = _WORDS | dict(comparison.reference.words)
    sizes = _VEHICLE_SIZES if vehicle else _SCALED_SIZE
    return Words(
        title=f"Station keeping of {setup.problem.name}" if vehicle else setup.problem.name,
        asked=_asked(comparison),
        columns=_COLUMNS.format(sizes=sizes),
        captions={k: v.format(subject=moving, count=count) for k, v in captions.items()},
        words={k: v.format(subject=moving) for k, v in words.items()},
    )


def _asked(comparison: Comparison) -> str:
    scenario, setup = comparison.scenario, comparison.setup
    state = ", ".join(f"{value:g}" for value in np.asarray(scenario.initial_state))
    units = unit_text(setup.problem.state_units)
    start = f"From the state ({state})" + ("" if units == "1" else f" [{units}]")
    others = comparison.n_states - 1
    more = f" and from {others} random states of the envelope" if others else ""
    against = comparison.reference.against.format(
        gamma=setup.game.gamma, disturbance=scenario.simulation.disturbance.kind
    )
    goal, squares = "goes back to the origin", "the states and the control"
    if isinstance(setup, StationKeeping):
        goal, squares = "goes back to its station", "position, attitude, rates and control"
    learner = _LEARNER.format(m=setup.basis.n_basis)
    return (
        f"{start}{more} the {subject(setup)} {goal}. The cost is the integral of weighted squares of "
        f"{squares}. {against} {learner}"
    )

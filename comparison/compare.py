"""Learned beside optimal in one call: what `stationkeep compare` does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..symbolic import InputError, StationKeeping
from ..symbolic.pyfile import is_named
from .policies import require_own
from .scenario import Scenario
from .study import Comparison, Field, Tell, compared


@dataclass(frozen=True)
class Study(Comparison):
    """A comparison in a folder: records there already, figures and report when they are asked for.

    Attributes
    ----------
    out : the folder
    figures : PNG file of each figure by name, once the report is written
    """

    out: Path
    figures: dict[str, Path] = field(default_factory=dict)

    def write_report(self, commands: Sequence[str] = (), tell: Tell | None = None) -> Path:
        """Draw every figure, write `report.html`, which needs no other file, and return its path.

        Parameters
        ----------
        commands : what the report says gives the same numbers again; this call if empty
        tell : called with the name of the present stage and the part of it that is done

        Raises
        ------
        InputError
            If the folder can't be written.
        """
        from .report import Page, draw_all, write_report  # and with it matplotlib

        told = _silent if tell is None else tell
        pages = (Page(self.out / "figures"), Page(None))
        for i, page in enumerate(pages):
            told("figures", i / len(pages))
            draw_all(self, page)
        self.figures.update(pages[0].files)
        told("report", 0.0)
        own = [name for name in self.metrics if is_named(name)]
        asked = f"states={self.n_states}, " + (f"policies={own}, " if own else "")
        again = commands or (f"compare(scenario, {asked}out=...).write_report()",)
        return write_report(self.out / "report.html", self, *pages, again)

    def animate(self) -> Path:
        """Write the film of the learned run of a vehicle beside the optimum and return its path.

        Raises
        ------
        InputError
            If the problem is no vehicle, or matplotlib finds nothing that writes a film.
        """
        from .report import animate

        require_film(self.scenario)
        return animate(self.out / "figures", self.records["learned"], self.shown)


def compare(
    scenario: Scenario | str,
    *,
    states: int = 10,
    out: Path | str,
    policies: Sequence[str] = (),
    field: str | None = None,
    workers: int = 1,
    tell: Tell | None = None,
) -> Study:
    """Run every policy and the optimum from the same states; reuse what is in the folder already.

    Parameters
    ----------
    scenario : what is run, or its name
    states : number of initial states: the scenario's own, and seeded ones of its envelope
    out : folder of the records, later of the figures and the report
    policies : of one's own that take part from every state, each as "file.py:make"
    field : two states, 'x,y', over which the Bellman error is drawn; the first two if None
    workers : processes that run at the same time
    tell : called with the name of the present stage and the part of it that is done

    Raises
    ------
    InputError
        If a number is not positive, a state is not known, or the scenario or a policy breaks a rule.
    RunError
        If the offline solver does not converge from the scenario's own state, or a worker was lost.

    Examples
    --------
    >>> study = compare("bluerov2-heavy", states=10, out="results")
    >>> study.regret["learned"].median
    >>> study.write_report()
    """
    for name, number in (("number of states", states), ("number of workers", workers)):
        if number < 1:
            raise InputError(f"the {name} is {number}, but must be at least 1")
    if isinstance(scenario, str):
        scenario = Scenario.load(scenario)
    require_own(policies, scenario.setup())
    over, folder = Field.of(field, scenario.setup().problem), Path(out)
    told = _silent if tell is None else tell
    found = compared(scenario, states, policies, over, folder / "records", workers, told)
    return Study(**vars(found), out=folder)


def require_film(scenario: Scenario) -> None:
    """Raise InputError unless there can be a film of a scenario's run: of a vehicle from above."""
    setup = scenario.setup()
    if not isinstance(setup, StationKeeping):
        raise InputError(
            f"there is no animation of '{setup.problem.name}', which is no vehicle; leave it out"
        )


def _silent(name: str, part: float) -> None:
    """Tell nobody."""

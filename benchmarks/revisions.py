"""Two revisions of this repository: whether their numbers are equal, and how their times compare.

    python benchmarks/revisions.py OLD [NEW] [--folder DIR] [--only numbers times] [--pairs N]

Each revision (a commit, a tag; NEW is HEAD if not given) is exported, and installed with
`pip install .` in an environment of its own in DIR, which a later comparison uses again, like the
results of its commands. Its cache of compiled functions is its own too, and it has one thread.

numbers: the commands of `revision/results.py` are run in both (5 minutes each on 2 cores), and every
variable and number in the attributes of their records, every number of their JSON and CSV is compared
bit by bit, but for `EXCLUDED` of `revision/differences.py` (times, versions, keys, paths); renamed ones
are told in `RENAMED` there.
times: imports, `--help`, a learner step, the closed loop and the offline optimum, N (20) times in
processes that take turns, OLD NEW OLD NEW ...; ratios NEW / OLD pair by pair, their median and the 95 %
interval of it by order statistics.

The same commit twice is run twice: what that prints, chance does. The exit code is 1 if a number
differs or is missing in NEW, 2 if there can be no comparison.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from revision.differences import Difference, compare
from revision.environment import ROOT, Revision, is_changed, make, revisions
from revision.results import COMMANDS, fault, numbers, run_all
from revision.times import time_all

SHOWN = 12  # names in a sentence


def print_numbers(both: Sequence[Revision]) -> bool:
    """Run what is missing, print what differs, and return whether nothing does."""
    for revision in both:
        run_all(revision)
    print(f"{'results':<28}{'numbers':>12}{'differ':>10}{'largest, relative':>20}  where")
    sentences, equal, total = [], True, 0
    for name in COMMANDS:
        faults = [text for revision in both if (text := fault(revision, name))]
        sentences += faults
        old, new = (numbers(revision, name) for revision in both)
        for kind in old | new:
            found = compare(old.get(kind, {}), new.get(kind, {}))
            print(
                f"{f'{name}, {kind}':<28}{found.compared:>12,}{found.differing:>10,}"
                f"{found.largest:>20.1e}  {found.where}"
            )
            sentences += [] if faults else _lacking(f"{name}, {kind}", found)
            equal = equal and not (found.differing or found.only_old)
            total += found.compared
    print("\n".join(sentences), end="\n" if sentences else "")
    verdict = "all are equal" if equal else "not all are equal, or some are missing in NEW"
    print(f"{total:,} numbers compared: {verdict}", flush=True)
    return equal


def _lacking(what: str, found: Difference) -> list[str]:
    """Return a sentence for what only one revision has."""
    sides = {"OLD": found.only_old, "NEW": found.only_new}
    return [
        f"{what}: only {label} has {', '.join(names[:SHOWN])}"
        + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
        for label, names in sides.items()
        if names
    ]


def print_times(both: Sequence[Revision], pairs: int) -> None:
    """Print times and their ratios."""
    ratios, sentences = time_all(both, pairs)
    print(f"\n{pairs} pairs of processes; medians, and of the ratio NEW / OLD its 95 % interval")
    print(f"{'what':<30}{'clock':<40}{'OLD [ms]':>11}{'NEW [ms]':>11}{'ratio':>8}{'interval':>16}")
    for (name, clock), ratio in ratios.items():
        print(
            f"{name:<30}{clock:<40}{1e3 * ratio.old:>11.3f}{1e3 * ratio.new:>11.3f}"
            f"{ratio.median:>8.3f}{f'{ratio.low:.3f}, {ratio.high:.3f}':>16}"
        )
    print("\n".join(sentences), end="\n" if sentences else "", flush=True)


def main() -> None:
    """Read the options, make both environments and print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("old", metavar="OLD")
    parser.add_argument("new", metavar="NEW", nargs="?", default="HEAD")
    parser.add_argument("--folder", type=Path, default=ROOT / "results" / "revisions", metavar="DIR")
    parser.add_argument("--only", nargs="+", choices=["numbers", "times"], default=["numbers", "times"])
    parser.add_argument("--pairs", type=int, default=20, metavar="N", help="of processes (default: 20)")
    options = parser.parse_args()
    both = revisions(options.old, options.new, options.folder)
    for revision in both:
        make(revision)
        print(f"{revision.label}: {revision.commit[:12]} in {revision.folder.name}")
    if options.new == "HEAD" and is_changed():
        print("The working tree has changes that are in no commit; they are not part of NEW.")
    if both[0].packages != both[1].packages:
        others = sorted(set(both[0].packages) ^ set(both[1].packages))
        print(
            f"The environments have different packages, which may change numbers: {', '.join(others)}"
        )
    print(flush=True)
    equal = "numbers" not in options.only or print_numbers(both)
    if "times" in options.only:
        print_times(both, options.pairs)
    sys.exit(0 if equal else 1)


if __name__ == "__main__":
    main()

"""A scenario: the one input of the online run and of the offline optimum."""

from .building import find_problem, named_in
from .files import Files
from .generation import Generated, generate
from .overrides import parse_values, replace_value, value_at
from .scenario import DEFAULT, Scenario, restored

__all__ = [
    "DEFAULT",
    "Files",
    "Generated",
    "Scenario",
    "find_problem",
    "generate",
    "named_in",
    "parse_values",
    "replace_value",
    "restored",
    "value_at",
]

"""What a user's Python file defines, named as 'path/to/file.py:name'."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .errors import InputError, StationkeepError


def is_named(text: str) -> bool:
    """Return whether a text names something in a Python file: 'file.py:name'."""
    file, separator, attribute = text.rpartition(":")
    return bool(separator) and file.endswith(".py") and attribute.isidentifier()


def find_attribute(text: str, what: str) -> Any:
    """Return what 'path/to/file.py:name' names; the file is executed.

    Parameters
    ----------
    what : "the basis", "the policy", ...: for messages

    Raises
    ------
    InputError
        If there is no such file, it can't be loaded, or it defines no such name.
    """
    file, _, attribute = text.rpartition(":")
    path = Path(file).expanduser()
    specification = importlib.util.spec_from_file_location(path.stem, path)
    if not path.is_file() or specification is None or specification.loader is None:
        raise InputError(f"there is no Python file '{file}'; give {what} as file.py:function")
    module = importlib.util.module_from_spec(specification)
    try:
        specification.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"'{file}' can't be loaded ({one_line(error)})") from error
    found = getattr(module, attribute, None)
    if found is None:
        raise InputError(f"'{file}' has no function '{attribute}'")
    return found


def find_callable(text: str, what: str) -> Callable[..., Any]:
    """Return the function that 'path/to/file.py:name' names; raises as `find_attribute`."""
    found = find_attribute(text, what)
    if not callable(found):
        file, _, attribute = text.rpartition(":")
        raise InputError(f"'{file}' has no function '{attribute}'; give {what} as file.py:function")
    return found  # type: ignore[no-any-return]


def called(function: Callable[..., Any], text: str, *arguments: object) -> Any:
    """Return what the function that `text` names gives; raises InputError for what it raises."""
    try:
        return function(*arguments)
    except StationkeepError:
        raise
    except Exception as error:
        raise InputError(f"'{text}' raises {one_line(error)}") from error


def file_content(text: str) -> str:
    """Return what is in the file of 'path/to/file.py:name', hexadecimal; '' where there is none."""
    path = Path(text.rpartition(":")[0]).expanduser()
    return path.read_bytes().hex() if path.is_file() else ""


def one_line(error: Exception) -> str:
    """Return an exception's name and message in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"

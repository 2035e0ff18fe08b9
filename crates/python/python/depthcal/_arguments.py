"""Arguments of calls, checked."""

from __future__ import annotations

import operator
import os
from typing import Any

from ._depthcal import InputError


def whole(name: str, value: Any, least: int) -> int:
    """A whole number of any type, at least ``least``. Raises :class:`InputError` with the argument's name."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise InputError(f"{name} is {value!r}: give a whole number from {least} on") from None
    if number < least:
        raise InputError(f"{name} is {number}: give at least {least}")
    return number


def is_path(value: Any) -> bool:
    """Whether a value names a file or a folder."""
    return isinstance(value, (str, os.PathLike))


def type_of(value: Any) -> str:
    """The name of a value's class."""
    return type(value).__name__

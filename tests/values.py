"""The values of the control law in tests: they have fields, but no equality and no `replace` of their own."""

from collections.abc import Iterable
from typing import Any, TypeVar

from shared.messages import Vector

T = TypeVar("T")


def fields(value: object) -> dict[str, Any]:
    """The public fields of a value by name, compiled or not."""
    kinds = reversed(type(value).__mro__)
    # Compiled ones have no dictionary.
    names = [name for kind in kinds for name in _slots(kind)] or vars(value)
    return {name: getattr(value, name) for name in dict.fromkeys(names) if not name.startswith("_")}


def _slots(kind: type) -> Iterable[str]:
    found: Iterable[str] = getattr(kind, "__mypyc_attrs__", None) or vars(kind).get("__slots__", ())
    return found


def replace(value: T, **changes: Any) -> T:
    """The same value with some fields changed."""
    return type(value)(**{**fields(value), **changes})


def vector(numbers: Iterable[float]) -> Vector:
    """A vector of any three numbers, such as a row of an array."""
    x, y, z = map(float, numbers)
    return (x, y, z)

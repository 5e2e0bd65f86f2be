"""What stands in a section of a faulty file for a value that could not be read."""

from __future__ import annotations

from typing import Any

from pydantic_core import ErrorDetails


class NotRead(Exception):
    """A check asked for a value that could not be read."""


class Unread:
    """A value that could not be read; whatever is done with it raises `NotRead`.

    Attributes:
        errors: what pydantic said of the value.
    """

    __slots__ = ("errors",)

    def __init__(self, errors: list[ErrorDetails]) -> None:
        self.errors = errors

    def _refuse(self, *_: Any) -> Any:
        raise NotRead

    __getattr__ = __getitem__ = __call__ = __iter__ = __len__ = __contains__ = __bool__ = __float__ = __index__ = (
        _refuse
    )
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = __abs__ = __neg__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = _refuse

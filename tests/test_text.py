from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len

from vedette.internal.text import elided, elided_apart


def test_the_middle_is_left_out() -> None:
    assert elided("abcdefghij", 5) == "ab\N{HORIZONTAL ELLIPSIS}ij"
    assert elided("two\n words", 24) == "two words"


def test_names_that_would_look_alike_are_numbered() -> None:
    names = [f"{'a' * 20}{middle}{'b' * 20}" for middle in "xy"]
    assert elided_apart(["short", *names], 16) == (
        "short",
        "aaaaa\N{HORIZONTAL ELLIPSIS}bbbbb (2)",
        "aaaaa\N{HORIZONTAL ELLIPSIS}bbbbb (3)",
    )


@given(st.text(max_size=60), st.integers(3, 30))
def test_nothing_is_wider_than_allowed(text: str, most: int) -> None:
    assert cell_len(elided(text, most)) <= most

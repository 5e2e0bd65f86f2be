"""Shares of a campaign that know nothing of each other: which runs each has, and where it leaves them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeVar

from vedette.errors import InputError
from vedette.internal.text import shown
from vedette.kernels.base.types import Ints

_MOST_SHARDS = 1_000_000
_Runs = TypeVar("_Runs", int, Ints)


@dataclass(frozen=True, slots=True)
class Shard:
    """One share of `count`; shares of equal count are disjoint and hold every run together.

    Shares differ by at most one run, in all and in each cell. Which share a run is of does not depend on how many runs
    there are, so that a campaign can be made longer.

    Attributes:
        number: of the share, from 1.
        count: number of shares.

    Raises `InputError` for numbers of no share.
    """

    number: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= _MOST_SHARDS:
            wanted = f"a number from 1 to the number of shards (at most {_MOST_SHARDS})"
            raise InputError(f"shard: expected {wanted}; got {self}")

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def folder(self) -> str:
        """What its results folder is called beside those of the others."""
        return f"{self.number:0{len(str(self.count))}}-of-{self.count}"

    def runs(self, cell: int, num_cells: int, num_runs: int) -> Sequence[int]:
        """Numbers of its runs of the cell at that place, increasing."""
        if self.count == 1:
            return range(num_runs)
        # As `owner`, solved for the run: at most one a round, in every so many rounds one.
        shared = math.gcd(num_cells, self.count)
        length = self.count // shared  # of a round, in runs
        inverse = pow(num_cells // shared, -1, length)
        found = []
        for number in range((self.number - 1 - cell) % shared, -(-num_runs // length), shared):
            turn = (self.number - 1 - number) % self.count
            found.append(number * length + (turn - cell) // shared * inverse % length)
        return found if not found or found[-1] < num_runs else found[:-1]


WHOLE = Shard()


def owner(run: _Runs, cell: int, num_cells: int, count: int) -> _Runs:
    """Number of the share that has a run of the cell at that place; of many runs, that of each.

    Runs are dealt out one after the other, all cells of a run number together. Where that would come back to the same
    cell before every cell had its turn, the next round begins one share further.
    """
    place = run * num_cells + cell
    return (place + place // math.lcm(num_cells, count)) % count + 1


def parse_shard(text: str) -> Shard:
    """A share as `17/1000`. Raises `InputError` for another text."""
    found = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip(), re.ASCII)
    if found is None:
        raise InputError(f"shard: expected NUMBER/COUNT, such as 17/1000; got {shown(text)}")
    return Shard(int(found[1]), int(found[2]))


def ranges(numbers: Collection[int]) -> str:
    """Increasing numbers as `3,17-19`, as job arrays take them."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and spans[-1][-1] == number - 1:
            spans[-1] = [spans[-1][0], number]
        else:
            spans.append([number])
    return ",".join("-".join(map(str, span)) for span in spans)


def _minutes(text: str) -> int:
    """Minutes of a time such as `4h`, `90m` or `1d12h`. Raises `InputError` for another text, or none at all."""
    found = re.fullmatch(r"(?:([0-9]{1,4})d)?(?:([0-9]{1,4})h)?(?:([0-9]{1,6})m)?", text.strip(), re.ASCII)
    days, hours, minutes = (int(part or 0) for part in found.groups()) if found else (0, 0, 0)
    if not days + hours + minutes:
        raise InputError(f"time: expected days, hours or minutes, such as 4h or 1d12h; got {shown(text)}")
    return minutes + 60 * (hours + 24 * days)


def slurm_script(name: str, count: int, time: str, command: str, merge: str) -> str:
    """A job array of SLURM, one task a share.

    Args:
        name: of the job.
        count: number of shares.
        time: that a task may take, such as `4h`.
        command: what runs one share, up to its number.
        merge: what is done when all have ended.

    Raises `InputError` for a time that is none.
    """
    Shard(1, count)
    minutes = _minutes(time)
    return f"""#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=1-{count}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --time={minutes // 60:02}:{minutes % 60:02}:00

# The same script again runs what is missing. When all tasks have ended: {merge}
{command} --shard "$SLURM_ARRAY_TASK_ID/{count}"
"""

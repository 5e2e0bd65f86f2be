"""Shards: independent shares of the runs of a campaign, and their folders."""

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
    """One shard of `count`. Shards of equal count are disjoint and together contain every run.

    Sizes differ by at most one run, in total and in each cell. The shard of a run does not depend on the number of
    runs, so that a campaign can be extended.

    Attributes:
        number: number of the shard, from 1.
        count: number of shards.

    Raises `InputError` for invalid numbers.
    """

    number: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= _MOST_SHARDS:
            expected = f"a number from 1 to the number of shards (at most {_MOST_SHARDS})"
            raise InputError(f"shard: expected {expected}; got {self}")

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    @property
    def folder(self) -> str:
        """Name of its results folder among those of the other shards."""
        return f"{self.number:0{len(str(self.count))}}-of-{self.count}"

    def runs(self, cell: int, num_cells: int, num_runs: int) -> Sequence[int]:
        """Return the increasing numbers of its runs of the cell at that place."""
        if self.count == 1:
            return range(num_runs)
        # `owner` solved for the run: at most one per round, at regular intervals of rounds.
        shared = math.gcd(num_cells, self.count)
        length = self.count // shared  # length of a round in runs
        inverse = pow(num_cells // shared, -1, length)
        numbers = []
        for number in range((self.number - 1 - cell) % shared, -(-num_runs // length), shared):
            turn = (self.number - 1 - number) % self.count
            numbers.append(number * length + (turn - cell) // shared * inverse % length)
        return numbers if not numbers or numbers[-1] < num_runs else numbers[:-1]


WHOLE = Shard()


def owner(run: _Runs, cell: int, num_cells: int, count: int) -> _Runs:
    """Return the number of the shard that has a run of the cell at that place, elementwise for arrays.

    Runs are dealt in turn, all cells of a run number together. When the turn would return to the same cell before every
    cell had it, the next round starts one shard later.
    """
    place = run * num_cells + cell
    return (place + place // math.lcm(num_cells, count)) % count + 1


def parse_shard(text: str) -> Shard:
    """Return the shard written as `17/1000`. Raises `InputError` for other texts."""
    match = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text.strip(), re.ASCII)
    if match is None:
        raise InputError(f"shard: expected NUMBER/COUNT, such as 17/1000; got {shown(text)}")
    return Shard(int(match[1]), int(match[2]))


def ranges(numbers: Collection[int]) -> str:
    """Return increasing numbers as `3,17-19`, the syntax of job arrays."""
    spans: list[list[int]] = []
    for number in numbers:
        if spans and spans[-1][-1] == number - 1:
            spans[-1] = [spans[-1][0], number]
        else:
            spans.append([number])
    return ",".join("-".join(map(str, span)) for span in spans)


def _minutes(text: str) -> int:
    """Return the minutes of a time such as `4h`, `90m` or `1d12h`. Raises `InputError` for other texts or zero."""
    match = re.fullmatch(r"(?:([0-9]{1,4})d)?(?:([0-9]{1,4})h)?(?:([0-9]{1,6})m)?", text.strip(), re.ASCII)
    days, hours, minutes = (int(part or 0) for part in match.groups()) if match else (0, 0, 0)
    if not days + hours + minutes:
        raise InputError(f"time: expected days, hours or minutes, such as 4h or 1d12h; got {shown(text)}")
    return minutes + 60 * (hours + 24 * days)


def slurm_script(name: str, count: int, time: str, command: str, merge: str) -> str:
    """Return a SLURM job array script with one task per shard.

    Args:
        name: name of the job.
        count: number of shards.
        time: time limit of a task, such as `4h`.
        command: command that runs one shard, up to its number.
        merge: command to run when all tasks have ended.

    Raises `InputError` for an invalid time.
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

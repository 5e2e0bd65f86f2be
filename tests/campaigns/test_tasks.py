"""How the runs of a campaign are cut into tasks, and what becomes of each."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from campaigns.examples import small_campaign
from vedette.campaigns import tasks
from vedette.campaigns.cells import Campaign
from vedette.campaigns.codec import decode
from vedette.campaigns.rows import row_of, unpack
from vedette.campaigns.tasks import MIN_TASK_SECONDS, CompletedRun, FailedRun, Task, TaskQueue, perform
from vedette.errors import ModelError, VedetteError
from vedette.evaluation.metrics.run import measure
from vedette.evaluation.metrics.serialization import decode_metrics
from vedette.evaluation.runs import run_scenario


def landed(cell: str, seconds: float) -> CompletedRun:
    return CompletedRun(row_of(cell, 0, b"", b""), 1.0, seconds)


def drain(queue: TaskQueue) -> list[tuple[str, tuple[int, ...]]]:
    """What is handed out where each task ends before the next is taken."""
    taken = []
    while (task := queue.take()) is not None:
        taken.append((task.cell.name, task.runs))
        queue.note_outcome(task, ())
    return taken


def first_task(campaign: Campaign) -> Task:
    task = TaskQueue(campaign, ()).take()
    assert task is not None
    return task


def learnt(queue: TaskQueue, *results: CompletedRun) -> None:
    for result in results:
        task = queue.take()
        assert task is not None
        queue.note_outcome(task, (result,))


def test_runs_of_equal_number_come_together() -> None:
    assert drain(TaskQueue(small_campaign(runs=2), ())) == [
        ("idm", (0,)),
        ("stationary", (0,)),
        ("idm", (1,)),
        ("stationary", (1,)),
    ]


def test_finished_runs_are_left_out() -> None:
    queue = TaskQueue(small_campaign(runs=2), {("idm", 0), ("stationary", 1)})
    assert len(queue) == 2
    assert drain(queue) == [("stationary", (0,)), ("idm", (1,))]
    assert len(queue) == 0


def test_a_task_holds_a_least_time_of_work_once_that_is_known() -> None:
    queue = TaskQueue(small_campaign(runs=30), ())
    # The second run of idm is learnt from: the first of a process also loads the kernels.
    learnt(queue, landed("idm", 7.0), landed("stationary", 3.0), landed("idm", 0.1 * MIN_TASK_SECONDS))
    assert drain(queue)[:3] == [("stationary", (1,)), ("idm", tuple(range(2, 12))), ("stationary", (2,))]


def test_the_more_workers_the_longer_are_tasks_until_little_is_left() -> None:
    queue = TaskQueue(small_campaign(planners=["stationary"], runs=1000), ())
    learnt(queue, landed("stationary", 0.1), landed("stationary", 0.1))
    sizes = []
    while (task := queue.take(200)) is not None:
        sizes.append(len(task.runs))
    assert sum(sizes) == 998
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == 5  # of 998 runs that 200 tasks share; 200 times .005 s would be 10 runs
    assert sizes[-1] == 1


def test_the_first_run_of_each_set_of_kernels_goes_before_the_others() -> None:
    campaign = small_campaign(
        planners=["jdm", "idm", "random", "stationary"], fusions=["cm_delta_glmb", "clmb"], runs=2
    )
    queue = TaskQueue(campaign, {("jdm-clmb", run) for run in range(2)})
    first = []
    while (task := queue.take()) is not None:
        first.append(task)
    assert [(task.cell.name, task.runs) for task in first] == [
        (f"{cell}", (0,))
        for cell in ("jdm-cm_delta_glmb", "idm-cm_delta_glmb", "idm-clmb", "random-cm_delta_glmb", "random-clmb")
    ]
    assert len(queue) == 16 - 2 - len(first)
    for task in first:  # however it ends
        queue.note_outcome(task, ())
    assert sum(len(runs) for _, runs in drain(queue)) == 16 - 2 - len(first)


def test_a_task_gives_back_the_runs_it_was_given() -> None:
    campaign = small_campaign()
    task = replace(first_task(campaign), runs=(0, 2))
    first, second = perform(task)
    assert isinstance(first, CompletedRun)
    assert isinstance(second, CompletedRun)
    assert (first.cell, first.run, second.run) == ("idm", 0, 2)
    record = decode(unpack(second.row.payload.content))
    metrics, own = decode_metrics(unpack(second.row.metrics.content), record.num_scans)
    assert metrics is not None
    assert own == {}
    again = run_scenario(task.cell.scenario, "idm", seed=0, run=2)
    assert record.ospa.tobytes() == again.ospa.tobytes()
    assert second.ospa == again.ospa[:, 0].mean()
    score = task.cell.scenario.model.ospa
    expected = measure(again, cutoff=score.cutoff, order=score.order, window=score.window).columns()
    assert {name: values.tobytes() for name, values in metrics.columns().items()} == {
        name: values.tobytes() for name, values in expected.items()
    }


@pytest.mark.parametrize(
    ("error", "message"), [(ModelError("noise: bad"), "noise: bad"), (ZeroDivisionError("oh"), "ZeroDivisionError: oh")]
)
def test_a_run_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch, error: Exception, message: str) -> None:
    def sometimes(*args: Any, run: int, **options: Any) -> Any:
        if run == 1:
            raise error
        return run_scenario(*args, run=run, **options)

    monkeypatch.setattr(tasks, "run_scenario", sometimes)
    task = replace(first_task(small_campaign()), runs=(0, 1, 2))
    first, failed, third = perform(task)
    assert isinstance(first, CompletedRun)
    assert isinstance(third, CompletedRun)
    assert failed == FailedRun("idm", 1, message)


def test_a_worker_of_other_versions_refuses() -> None:
    task = first_task(small_campaign())
    other = replace(task, versions={**task.versions, "numpy": "1.0"})
    with pytest.raises(VedetteError, match=r"a worker has other versions than the campaign: numpy .* \(not 1\.0\)"):
        perform(other)

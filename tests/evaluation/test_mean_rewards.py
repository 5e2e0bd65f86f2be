from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluation.synthetic import ACTIONS, DEGREES, make_record
from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.evaluation.rewards import mean_rewards
from vedette.platforms import Actions
from vedette.simulation.records import RunRecord


def records_of(planner: str, num_runs: int = 5) -> list[RunRecord]:
    return [make_record(planner, run) for run in range(num_runs)]


def with_plan(record: RunRecord, **changes: object) -> RunRecord:
    """The record with its first plan changed."""
    first = record.decisions[0]
    plan = replace(first.plan, **changes)  # type: ignore[arg-type]
    return replace(record, decisions=(replace(first, plan=plan), *record.decisions[1:]))


def test_independent_rewards_are_averaged_entry_by_entry() -> None:
    records = records_of("idm")
    found = mean_rewards(records, 1)
    for sensor in (0, 1):
        values = np.array([record.decisions[1].plan.tables[sensor].mean for record in records])
        np.testing.assert_allclose(found.tables[sensor].mean, values.mean(axis=0))
        np.testing.assert_allclose(found.tables[sensor].standard_error, values.std(axis=0, ddof=1) / np.sqrt(5))
        chosen = [record.decisions[1].plan.chosen[sensor] for record in records]
        np.testing.assert_allclose(found.shares[sensor], np.bincount(chosen, minlength=len(ACTIONS)) / 5)
    assert (found.num_runs, found.time) == (5, records[0].decisions[1].time)
    assert found.actions[0].columns == ("heading_deg",)


def test_joint_rewards_keep_their_axes_and_count_pairs_of_actions() -> None:
    records = records_of("jdm")
    found = mean_rewards(records, 0)
    np.testing.assert_allclose(
        found.tables[0].mean, np.mean([record.decisions[0].plan.tables[0].mean for record in records], axis=0)
    )
    assert found.shares[0].shape == (13, 13)
    assert found.shares[0].sum() == pytest.approx(1.0)
    assert found.shares[0][records[0].decisions[0].plan.chosen] > 0.0


def test_entries_that_some_runs_left_out_are_averaged_over_the_others() -> None:
    first, second = records_of("idm", 2)
    table = first.decisions[0].plan.tables[0]
    gaps = np.arange(13) < 4
    gapped = RewardTable((0,), np.where(gaps, np.nan, table.mean), np.where(gaps, np.nan, table.standard_error))
    both = with_plan(first, tables=(gapped, first.decisions[0].plan.tables[1]))
    found = mean_rewards([both, second], 0)
    np.testing.assert_allclose(found.tables[0].mean[:4], second.decisions[0].plan.tables[0].mean[:4])
    np.testing.assert_array_equal(found.tables[0].standard_error[:4], 0.0)
    assert np.isnan(mean_rewards([both], 0).tables[0].mean[:4]).all()


def test_runs_with_other_headings_but_the_same_turns_are_averaged_over_turns() -> None:
    first, second = records_of("idm", 2)
    turned = replace(
        second.decisions[0],
        poses=second.decisions[0].poses + np.array([0.0, 0.0, 0.5]),
        plan=replace(
            second.decisions[0].plan, actions=(Actions(("heading_deg",), ACTIONS.values + np.degrees(0.5)),) * 2
        ),
    )
    found = mean_rewards([first, replace(second, decisions=(turned,))], 0)
    assert found.actions[0].columns == ("turn_deg",)
    np.testing.assert_allclose(np.cos(np.deg2rad(found.actions[0].values[:, 0])), np.cos(np.deg2rad(DEGREES)))


def test_runs_with_nothing_in_common_are_refused() -> None:
    first, second = records_of("idm", 2)
    other = with_plan(second, actions=(Actions(("heading_deg",), ACTIONS.values + 0.1),) * 2)
    with pytest.raises(InputError, match="expected the same actions in every run"):
        mean_rewards([first, other], 0)
    with pytest.raises(InputError, match="expected runs with rewards at decision 0"):
        mean_rewards(records_of("random"), 0)
    with pytest.raises(InputError, match="expected runs with rewards at decision 7"):
        mean_rewards([first], 7)
    with pytest.raises(InputError, match="expected tables of one shape"):
        mean_rewards([first, make_record("jdm", 1)], 0)

"""Calls in processes of their own. This file imports little, as every process imports it."""

import os

from campaigns.bounded import Failed, results


def behaved(task):
    if task == "forever":
        while True:
            pass
    if task == "breaks":
        os._exit(3)
    return task.upper()


def test_a_call_that_never_ends_or_breaks_costs_no_other():
    tasks = ["one", "forever", "breaks", "two"]
    assert dict(results(behaved, tasks, seconds=0.5, workers=1)) == {
        "one": "ONE", "forever": Failed.TOO_SLOW, "breaks": Failed.CRASHED, "two": "TWO",
    }  # fmt: skip

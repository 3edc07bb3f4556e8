"""Work on a cluster of Dask: the same results, also where a worker dies in the middle."""

import os
import signal
import time
from functools import partial

import numpy as np
import pytest

from validation.errors import GtvalError
from validation.pieces.cluster import cluster_in_use, on_cluster
from validation.pieces.processes import as_they_end, in_processes

pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own, of ports and clean-up


def root(number, folder=None):
    """A number that any rounding would change, and a note of who made it."""
    if folder is not None:
        with (folder / f"{number}").open("a") as note:
            note.write(f"{os.getpid()}\n")
        time.sleep(0.05)
    return float(np.sqrt(number + 0.1)), os.getpid()


def prepared():
    os.environ["GTVAL_TEST_PREPARED"] = str(os.getpid())


def told(_job):
    return os.environ.get("GTVAL_TEST_PREPARED") == str(os.getpid())


@pytest.mark.full
def test_results_are_those_of_this_process_in_order(cluster):
    jobs = range(40)
    shares = []
    with on_cluster(cluster.scheduler_address):
        assert cluster_in_use()
        found = list(in_processes(root, jobs, 1, shares.append))
    assert not cluster_in_use()
    assert [value for value, _ in found] == [root(job)[0] for job in jobs]
    assert len({who for _, who in found} - {os.getpid()}) == 2
    assert shares == [number / 40 for number in range(1, 41)]


@pytest.mark.full
def test_each_worker_is_prepared(cluster):
    with on_cluster(cluster.scheduler_address):
        assert all(ready for _, ready in as_they_end(told, range(20), 1, prepare=prepared))


@pytest.mark.full
def test_a_worker_that_is_killed_takes_only_its_pieces_along(cluster, tmp_path):
    found = {}
    with on_cluster(cluster.scheduler_address):
        for number, (value, who) in as_they_end(partial(root, folder=tmp_path), range(60), 1):
            found[number] = value
            if len(found) == 15:
                os.kill(who, signal.SIGKILL)
    assert found == {number: root(number)[0] for number in range(60)}
    # What it had been handed out: three jobs for each of the two threads at the most.
    again = sum(len(path.read_text().splitlines()) - 1 for path in tmp_path.iterdir())
    assert again <= 6


@pytest.mark.full
def test_what_fails_on_a_worker_fails_here(cluster):
    with on_cluster(cluster.scheduler_address), pytest.raises(ValueError, match="invalid literal"):
        list(as_they_end(int, ["1", "x", "3"], 1))


def test_a_scheduler_that_is_not_there_is_told(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("validation.pieces.cluster.PATIENCE", 1)
    said = r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"
    with pytest.raises(GtvalError, match=said), on_cluster("tcp://127.0.0.1:9"):
        pass


def test_without_a_scheduler_nothing_changes():
    with on_cluster(None):
        assert not cluster_in_use()

"""Processes beside a server: what dies, fails or hangs in them takes nothing along."""

import math
import os
import time
from pathlib import Path

import pytest

from validation.errors import GtvalError
from validation.pieces.processes import Beside


@pytest.fixture
def beside():
    made = Beside(1, idle=0.2)
    yield made
    made.close()


def test_what_fails_is_told_in_words_and_the_next_is_answered(beside):
    assert beside.call(30, math.sqrt, 16) == 4
    with pytest.raises(GtvalError, match="unexpected: ValueError"):
        beside.call(30, math.sqrt, -1)
    with pytest.raises(GtvalError, match="has died"):
        beside.call(30, os._exit, 1)
    assert beside.call(30, math.sqrt, 9) == 3


@pytest.mark.full
def test_what_hangs_is_ended_and_what_idles_ends_by_itself(beside):
    own = beside.call(30, os.getpid)
    with pytest.raises(GtvalError, match="it was not done"):
        beside.call(0.5, time.sleep, 60)
    other = beside.call(30, os.getpid)
    assert other != own
    time.sleep(1)
    for number in (own, other):
        stat = Path(f"/proc/{number}/stat")
        assert not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z"
    assert beside.call(30, os.getpid) not in (own, other)

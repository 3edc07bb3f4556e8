"""Undo takes back one action of one person after the other, and nothing of anybody else."""

from dataclasses import dataclass, replace

import pytest

from validation.page.undoing import TAKEN_BACK, undoing


@dataclass(frozen=True)
class Made:
    """A decision about something."""

    about: str
    kind: str
    by: str = "ann"
    note: str = ""


def taken_back(history, by="ann"):
    def restored(before, back):
        return replace(before or replace(back, kind="open"), by=by, note=TAKEN_BACK)

    back = undoing(history, by, lambda one: one.about, restored)
    return [*history, *((f"u{len(history)}", one) for one in back)] if back else None


def counting(history):
    found = {}
    for _, one in history:
        found[one.about] = one.kind
    return {about: kind for about, kind in found.items() if kind != "open"}


def test_one_action_after_the_other_is_taken_back():
    history = [
        ("1", Made("p", "guess")),
        ("2", Made("p", "accept")),
        ("2", Made("q", "accept")),
        ("3", Made("q", "reject")),
    ]
    expected = [{"p": "accept", "q": "accept"}, {"p": "guess"}, {}]
    for counts in expected:
        history = taken_back(history)
        assert counting(history) == counts
    assert taken_back(history) is None
    history = [*history, ("9", Made("p", "reject"))]
    assert counting(taken_back(history)) == {}


@pytest.mark.parametrize("returned", [False, True])
def test_what_another_person_decided_since_stays(returned):
    history = [("1", Made("p", "accept")), ("2", Made("q", "accept"))]
    history.append(("3", Made("q", "reject", "bob")))
    if returned:  # and is mine again once they take it back
        history = taken_back(history, "bob")
        assert counting(history) == {"p": "accept", "q": "accept"}
        assert counting(taken_back(history)) == {"p": "accept"}
        return
    history = taken_back(history)
    assert counting(history) == {"q": "reject"}
    assert taken_back(history) is None
    assert taken_back(history, "eve") is None

"""Values come back from JSON as they were, to the last bit, and nothing else comes in."""

import json
from collections import Counter
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.sparse import csr_array
from scipy.spatial.transform import RigidTransform, Rotation

from rtk_gt.receivers.fixes import Frozen
from rtk_gt.settings import RtkSettings
from validation.pieces.values import UnknownKindError, as_json, digest_of_value, from_json
from validation.results import Finding, Size


def through_json(value):
    return from_json(json.loads(json.dumps(as_json(value))))


numbers = st.floats() | st.integers() | st.booleans() | st.none() | st.text()
collections = st.recursive(
    numbers | st.binary() | st.dates(),
    lambda inner: (
        st.lists(inner)
        | st.lists(inner).map(tuple)
        | st.dictionaries(st.integers() | st.text(), inner)
    ),
)


@given(collections)
def test_what_collections_hold_comes_back_of_the_same_kinds(value):
    assert repr(through_json(value)) == repr(value)


kinds = st.sampled_from(["f8", "f4", ">f8", "i8", "u2", "?", "c16", "U3", "M8[s]"])


@given(
    kinds.flatmap(lambda kind: arrays(kind, array_shapes(min_dims=0, min_side=0))), st.booleans()
)
def test_an_array_comes_back_to_the_last_bit(array, turned):
    array = array.T if turned else array
    found = through_json(array)
    assert (found.dtype, found.shape) == (array.dtype, array.shape)
    assert found.flags.f_contiguous == array.flags.f_contiguous
    assert found.tobytes("A") == array.tobytes("A")
    assert found.flags.writeable
    assert digest_of_value(found) == digest_of_value(array)


def test_a_part_of_an_array_comes_back_in_rows():
    whole = np.arange(24.0).reshape(4, 6)
    found = through_json(whole[::2, 1::3])
    assert found.flags.c_contiguous
    assert (found == whole[::2, 1::3]).all()


@pytest.mark.parametrize(
    "value",
    [
        Finding("note", "So it is.", "7", "code", (Size("length", 1.5, "m"),)),
        Frozen(1.0, 2.0, 3, 4.0, 5),
        RtkSettings(eta=2.5),
        Path("a/b"),
        date(2026, 2, 3),
        MappingProxyType({"a": 1, 2: (3,)}),
        frozenset({3, -1}),
        {"a"},
        np.float32(0.1),
        np.int64(3),
        float("inf"),
        -0.0,
    ],
)
def test_results_and_single_things_come_back(value):
    found = through_json(value)
    assert type(found) is type(value)
    assert repr(found) == repr(value)


def test_places_and_sparse_matrices_of_scipy_come_back():
    turns = Rotation.from_rotvec([[0.1, 0.2, 0.3], [1.0, 0.0, -2.0]])
    assert (through_json(turns).as_quat() == turns.as_quat()).all()
    places = RigidTransform.from_components([[1, 2, 3.1], [0, 0, 7]], turns)
    assert (through_json(places).as_matrix() == places.as_matrix()).all()
    assert through_json(places[0]).single
    sparse = csr_array(([1.0, 0.1], [2, 0], [0, 1, 2]), shape=(2, 3))
    found = through_json(sparse)
    assert found.shape == sparse.shape
    assert (found.toarray() == sparse.toarray()).all()


def test_what_was_one_object_is_one_again_and_is_told_once():
    array = np.arange(1000.0)
    inside = (array, "x")
    first, (again, beside) = through_json([inside, (array, inside)])
    assert first[0] is again
    assert beside is first
    assert len(json.dumps(as_json([array] * 50))) < 2 * len(json.dumps(as_json(array)))


def test_a_digest_tells_values_apart_and_not_which_of_them_are_one_object():
    array = np.arange(5.0)
    assert digest_of_value((array, array)) == digest_of_value((array, array.copy()))
    different = [
        [array],
        (array,),
        array,
        array + 1,
        array.astype("f4"),
        array.reshape(1, 5),
        array.tolist(),
        1,
        1.0,
        True,
        "1",
        np.float64(1.0),
        {"a": 1},
        {"a": 2},
        Size("a", 1.0),
        Size("a", 2.0),
        b"1",
        Path("1"),
    ]
    assert len({digest_of_value(one) for one in different}) == len(different)


@dataclass
class Foreign:
    x: int


@pytest.mark.parametrize(
    "value",
    [
        lambda: 1,
        np.random.default_rng(1),
        np.array([object()]),
        Foreign(1),
        Counter("ab"),
        [1, (2, open)],
        np.ma.array([1.0]),
        (one for one in ()),
    ],
)
def test_what_cannot_be_told_is_refused(value):
    with pytest.raises(UnknownKindError):
        as_json(value)
    with pytest.raises(UnknownKindError):
        digest_of_value(value)


@pytest.mark.parametrize(
    "told",
    [
        {"class": "os:system", "of": ["true"]},
        {"class": "subprocess:Popen", "of": {"args": "true"}},
        {"class": "validation.pieces.values:json.JSONDecoder", "of": {}},
        {"class": "validation.results:listed_ids", "of": [["a"]]},
        {"class": "validation.results:Size", "of": {"of": "x"}},
        {"class": "validation.results:no_such", "of": {}},
        {"class": "validation.no_such:Size", "of": {}},
        {"enum": "validation.results:Size", "is": "x"},
        {"array": "|O", "shape": [1], "order": "C", "single": False, "is": "AAAAAAAAAAA="},
        {"array": "<f8", "shape": [9], "order": "C", "single": False, "is": "AAAAAAAAAAA="},
        {"collection": "deque", "of": []},
        {"again": 7},
        {"other": 1},
        {},
        [1],
    ],
)
def test_a_file_that_somebody_wrote_makes_nothing_else(told):
    with pytest.raises(
        (ValueError, LookupError, TypeError, AttributeError, ImportError, StopIteration)
    ):
        from_json(told)

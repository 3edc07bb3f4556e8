"""Published tables become systems."""

import numpy as np
import pytest

from validation.campaign.folder import Published, load_campaign
from validation.errors import InputError
from validation.published.systems import published_table, published_tables

TOML = """name = "x"
[[published]]
system = "a"
file = "a.csv"
source = "a book"
[[published]]
system = "{second}"
file = "b.csv"
sigmas = [0.1, 0.2, 0.3]
"""


def campaign(folder, second="b", a="pose,x,y,theta\n1,0,0,0\n", b="pose,x,y,theta\n1,0,0,0\n"):
    (folder / "campaign.toml").write_text(TOML.format(second=second))
    (folder / "a.csv").write_text(a)
    (folder / "b.csv").write_text(b)
    return load_campaign(folder, frozenset())


def test_every_entry_is_a_table_with_its_origin(tmp_path):
    first, second = published_tables(campaign(tmp_path))
    assert (first.system, second.system) == ("a", "b")
    assert first.provenance["published"] == "a book"
    assert not first.has_covariance.any()
    assert second.covariances[0] == pytest.approx(np.diag([0.01, 0.04, 0.09]))


def test_a_camera_column_tells_the_source(tmp_path):
    (tmp_path / "a.csv").write_text(
        "pose,camera,x,y,theta,source\n1,4+1,0,0,0,\n2,,0,0,0,\n3,2,0,0,0,by hand\n"
    )
    table = published_table(tmp_path, Published(system="a", file="a.csv"))
    assert table.sources == ("camera 4+1", "", "by hand, camera 2")


def test_a_system_published_twice_is_an_error(tmp_path):
    with pytest.raises(InputError, match="'a' — this system is published twice"):
        published_tables(campaign(tmp_path, second="a"))


def test_bad_places_of_all_files_are_told_at_once(tmp_path):
    bad = campaign(tmp_path, a="pose,x,y,theta\n1,?,0,0\n", b="pose,x,y\n")
    with pytest.raises(InputError) as caught:
        published_tables(bad)
    assert "a.csv, line 2, field 'x': '?'" in str(caught.value)
    assert "b.csv, line 1, field 'theta': the column is missing" in str(caught.value)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: there is no such file"):
        published_table(tmp_path, Published(system="a", file="none.csv"))

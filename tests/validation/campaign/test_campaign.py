"""campaign.toml: what is understood, and that every fault is told with its place."""

import contextlib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.campaign.folder import Settings, load_campaign
from validation.errors import GtvalError, InputError

NO_TABLES = frozenset[str]()


def load(folder, text: str | bytes, known=NO_TABLES):
    (folder / "campaign.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_campaign(folder, known)


def message(folder, text: str | bytes) -> str:
    with pytest.raises(InputError) as caught:
        load(folder, text)
    return str(caught.value)


def test_a_name_is_enough(campaign_folder):
    campaign = load_campaign(campaign_folder, NO_TABLES)
    assert campaign.settings.name == "three stops"
    assert campaign.settings.vframe.points["XY"] == (2.5, 2.5)
    assert campaign.results == campaign_folder / "results"
    assert campaign.report == campaign_folder / "report"


def test_the_file_may_be_named_in_place_of_its_folder(campaign_folder):
    assert load_campaign(campaign_folder / "campaign.toml", NO_TABLES).folder == campaign_folder


def test_a_byte_order_mark_is_no_fault(tmp_path):
    assert load(tmp_path, '\ufeffname = "x"').settings.name == "x"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "field 'name': the key is missing; add it"),
        ('name = "x"\nfoo = 1\n', "line 2, field 'foo': unknown table or key"),
        ('name = "x"\n[instrumnt]\n', "did you mean 'instrument'?"),
        ('name = "x"\n[vframe]\nsigma = 0\n', "line 3, field 'vframe.sigma': '0'"),
        ('name = "x"\n[vframe]\nsigma = nan\n', "line 3, field 'vframe.sigma': 'nan'"),
        ('name = "x"\n[vframe]\nsigna = 1\n', "line 3, field 'vframe.signa'"),
        ('name = "x"\n[vframe.points]\nO = [0, 0]\n', "at least two Vframe points"),
        ('name = "x"\n[comparison]\nconfidence = 95\n', "'comparison.confidence': '95'"),
        ('name = "x"\n[comparison]\nacceptable_bias_length = -1\n', "'-1'"),
        ('name = "x"\n[[published]]\nsystem = "Vision!"\nfile = "a"\n', "'Vision!'"),
        (
            'name = "x"\n[[published]]\nsystem = "a"\nfile = "a"\n[[published]]\nsystem = "B!"\n',
            "line 6, field 'published.1.system': 'B!'",
        ),
        ("name = ", "not valid TOML"),
        (b'name = "\xff"', "not UTF-8"),
        (b'a = 1\nname = "\xff"', "line 2"),
        ("a = " + "[" * 50_000, "nested too deeply"),
        ("a = " + "9" * 10_000, "cannot be read"),
        ("#" * 1_100_000, "cannot be a campaign.toml"),
    ],
)
def test_faults_are_told_with_their_place(tmp_path, text, expected):
    said = message(tmp_path, text)
    assert expected in said
    assert str(tmp_path / "campaign.toml") in said


def test_all_faults_are_told_at_once(tmp_path):
    said = message(tmp_path, 'name = "x"\n[vframe]\nsigma = 0\n[instrument]\nscale = -1\n')
    assert "vframe.sigma" in said
    assert "instrument.scale" in said


def test_a_folder_without_campaign_toml_is_told(tmp_path):
    with pytest.raises(InputError, match="there is no such file; a campaign folder needs one"):
        load_campaign(tmp_path, NO_TABLES)


def test_a_folder_in_the_place_of_the_file_is_told(tmp_path):
    (tmp_path / "campaign.toml").mkdir()
    with pytest.raises(GtvalError, match="no file, but a folder"):
        load_campaign(tmp_path, NO_TABLES)


class RigSettings(Settings):
    sigma: float = 0.5


def test_a_system_reads_its_own_table(tmp_path):
    campaign = load(tmp_path, 'name = "x"\n[rig]\nsigma = 0.25\n', frozenset({"rig"}))
    assert campaign.section("rig", RigSettings).sigma == 0.25
    assert campaign.section("other", RigSettings).sigma == 0.5


@pytest.mark.parametrize("table", ["[rig]\nsigma = 'a'", "rig = 3", "[rig]\nunknown = 1"])
def test_faults_in_a_systems_table_are_told_too(tmp_path, table):
    campaign = load(tmp_path, f'name = "x"\n{table}\n', frozenset({"rig"}))
    with pytest.raises(InputError, match=r"campaign\.toml.*rig"):
        campaign.section("rig", RigSettings)


TOML = st.one_of(
    st.binary(max_size=200),
    st.text(alphabet='name="x[].,\n0-9vframe\\u', max_size=60).map(
        lambda text: ('name = "x"\n' + text).encode()
    ),
)


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=TOML)
def test_whatever_the_bytes_only_plain_errors_come_out(tmp_path, text):
    with contextlib.suppress(GtvalError):
        load(tmp_path, text)

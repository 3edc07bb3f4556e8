"""Plug-ins found by their entry points."""

from importlib.metadata import EntryPoint

import pytest
from small_campaigns import FixedSystem

from validation import systems
from validation.systems import installed_systems


def entry(name: str, value: str = "small_campaigns:SYSTEM") -> EntryPoint:
    return EntryPoint(name, value, "gtval.systems")


def test_the_survey_comes_first_and_the_others_by_name(monkeypatch):
    made = {name: FixedSystem(name) for name in ("vision", "laser", "survey")}
    monkeypatch.setattr(EntryPoint, "load", lambda self: made[self.name])
    monkeypatch.setattr(systems, "entry_points", lambda **_: [entry(name) for name in made])
    assert [system.name for system in installed_systems()] == ["survey", "laser", "vision"]


def test_a_plug_in_that_cannot_be_loaded_is_named(monkeypatch):
    # Leaving it out silently would leave its poses out of the comparison.
    monkeypatch.setattr(systems, "entry_points", lambda **_: [entry("rig", "no_such_module:X")])
    (system,) = installed_systems()
    assert system.name == "rig"
    for asked in (system.has_data, lambda campaign: system.solve(campaign, systems.no_progress)):
        with pytest.raises(
            ImportError, match=r"plug-in 'rig' \(no_such_module:X\) cannot be loaded"
        ):
            asked(None)


@pytest.mark.parametrize(
    "value", ["small_campaigns:AD23", "small_campaigns:FixedSystem", "sys:exit"]
)
def test_a_plug_in_that_gives_no_system_of_its_name_cannot_be_loaded(monkeypatch, value):
    monkeypatch.setattr(systems, "entry_points", lambda **_: [entry("rig", value)])
    (system,) = installed_systems()
    with pytest.raises(ImportError, match=f"{value}.* cannot be loaded"):
        system.has_data(None)


def test_of_two_plug_ins_of_one_name_the_second_is_refused_by_its_own(monkeypatch):
    monkeypatch.setattr(EntryPoint, "load", lambda self: FixedSystem(self.name))
    both = [entry("rig", "a:SYSTEM"), entry("rig", "b:SYSTEM")]
    monkeypatch.setattr(systems, "entry_points", lambda **_: both)
    first, second = installed_systems()
    assert (first.name, second.name) == ("rig", "rig (b:SYSTEM)")
    with pytest.raises(ImportError, match="another installed package has a system of that name"):
        second.has_data(None)


def test_no_progress_takes_what_progress_takes():
    assert systems.no_progress("anything", 0.5) is None


def test_a_system_with_another_name_than_its_entry_point_says_which_two_differ(monkeypatch):
    monkeypatch.setattr(EntryPoint, "load", lambda _: FixedSystem("mocap"))
    monkeypatch.setattr(systems, "entry_points", lambda **_: [entry("rig")])
    (system,) = installed_systems()
    with pytest.raises(ImportError, match=r"plug-in 'rig' .* calls its system 'mocap'; in its"):
        system.has_data(None)

"""Every key of campaign.toml is read by the code: none is accepted and then does nothing."""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from pydantic import BaseModel

import validation
from validation.campaign.folder import CampaignSettings, Settings

ROOT = Path(validation.__file__).parents[1]
PACKAGES = ("validation", "survey", "vision_gt", "laser_gt", "rtk_gt", "gtval", "data_samples")


def settings_classes() -> list[type[BaseModel]]:
    """Every class whose fields are keys of campaign.toml, wherever a package defines one."""
    for path in sorted(ROOT.glob("*/**/settings.py")):
        if path.relative_to(ROOT).parts[0] in PACKAGES:
            import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    found: list[type[BaseModel]] = [CampaignSettings]
    waiting: list[type[BaseModel]] = [Settings]
    while waiting:
        below = waiting.pop().__subclasses__()
        found += [one for one in below if one.__module__.split(".")[0] in PACKAGES]
        waiting += below
    return found


def only_checks(node: ast.AST) -> bool:
    """A check of the keys themselves, which makes nothing of them: reading there is no use."""
    decorators = getattr(node, "decorator_list", [])
    checks = any("validator" in ast.unparse(one) for one in decorators)
    return checks and "__setattr__" not in ast.unparse(node)


def reads(node: ast.AST) -> Iterator[str]:
    """Names of the attributes that a piece of code reads, mere checks apart."""
    if only_checks(node):
        return
    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
        yield node.attr
    for child in ast.iter_child_nodes(node):
        yield from reads(child)


@pytest.fixture(scope="module")
def read() -> set[str]:
    """Attributes that any module of the packages reads."""
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    return {name for path in files for name in reads(ast.parse(path.read_text("utf-8")))}


def test_every_key_is_read_somewhere(read):
    keys = {(model.__name__, key) for model in settings_classes() for key in model.model_fields}
    unused = sorted(f"{model}.{key}" for model, key in keys if key not in read)
    assert unused == []


def test_the_test_sees_all_tables():
    names = {model.__name__ for model in settings_classes()}
    tables = {"Instrument", "ExplainSettings", "SurveySettings", "VisionSettings", "LaserSettings"}
    assert {*tables, "RtkSettings"} <= names


CODE = """
class A(Settings):
    @field_validator("x")
    def check(self): return self.x
    @model_validator
    def make(self): object.__setattr__(self, "made", self.z)
    def use(self): return self.y
"""


def test_what_only_a_check_reads_does_not_count():
    assert {"y", "z"} <= set(reads(ast.parse(CODE)))
    assert "x" not in set(reads(ast.parse(CODE)))

import re

import pytest

from falsifier.campaigns.analysis import read_published
from falsifier.problem.loading import load_problem, load_problems
from tests.systems.driving import ROOT

# Requirements and coordinates of the default parameterization, then of instance 2 if any; one more for AFC27.
SYSTEMS = {
    "AFC": ("AFC27 AFC29 AFC33", 11, 11),
    "AT": ("AT1 AT2 AT51 AT52 AT53 AT54 AT6a AT6b AT6c AT6abc", 10, 10),
    "CC": ("CC1 CC2 CC3 CC4 CC5 CCx", 20, 40),
    "NN": ("NN NNb NNx", 8, 3),
    "F16": ("F16", 3, None),
    "SC": ("SC", 18, 20),
    "PM": ("PM", 10, 5),
    "PulseMeter": ("PulseMeter", 24, None),
    "ChargerHandshake": ("ChargerHandshake", 16, None),
    "HeaterLimpHome": ("HeaterLimpHome", 20, None),
}
# Systems of several FMUs.
COUPLED = {
    "ATsplit": (
        "ATsplit1 ATsplit2 ATsplit51 ATsplit52 ATsplit53 ATsplit54 ATsplit6a ATsplit6b ATsplit6c ATsplit6abc",
        10,
        None,
    ),
    "F16split": ("F16split", 3, None),
    "SharedFeeder": ("SharedFeeder", 14, None),
    "CCcars": ("CCcars1 CCcars2 CCcars3 CCcars4 CCcars5 CCcarsx", 20, None),
}
BUNDLED = sorted(path.stem for path in (ROOT / "specs").glob("*.toml") if path.stem != "published")
PUBLISHED = ("AT", "CC", "NN", "F16", "SC")


@pytest.mark.parametrize("system", BUNDLED)
def test_spec_loads_and_is_in_the_list(system: str) -> None:
    assert f"\n| {system} | " in (ROOT / "docs" / "fmus.md").read_text(encoding="utf-8")
    assert system in SYSTEMS | COUPLED, "state its requirements and coordinates above"
    names, coordinates, coordinates_of_instance_2 = (SYSTEMS | COUPLED)[system]
    problems = load_problems(system)
    assert [p.name for p in problems] == names.split()
    for problem in problems:
        assert len(problem.space.dimensions) == coordinates + (problem.name == "AFC27")
        assert problem.requirement.description.endswith(".")
    if coordinates_of_instance_2 is not None:
        for problem in load_problems(system, profile="instance2"):
            assert len(problem.space.dimensions) == coordinates_of_instance_2 + (problem.name == "AFC27")
            assert all(r.interpolation == "constant" and r.free is None for r in problem.space.inputs)


@pytest.mark.parametrize(("parts", "whole"), [("ATsplit", "AT"), ("CCcars", "CC"), ("F16split", "F16")])
def test_a_split_system_has_the_requirements_and_ranges_of_the_single_fmu(parts: str, whole: str) -> None:
    def plain(formula: object) -> str:
        text = re.sub(r"\bcar(\d)\.y\b", r"y\1", str(formula))
        return re.sub(r"\b(car|shift|aircraft)\.", "", text)

    for split, one in zip(load_problems(parts), load_problems(whole), strict=True):
        assert split.name == one.name.replace(whole, parts, 1)
        assert plain(split.requirement.formula) == str(one.requirement.formula)
        assert split.space.bounds.tolist() == one.space.bounds.tolist()
        assert [d.time for d in split.space.dimensions] == [d.time for d in one.space.dimensions]
        assert [r.hold for r in split.space.inputs] == [r.hold for r in one.space.inputs]
        assert split.experiment.samples == one.experiment.samples


def test_instance_2_of_nnx_is_over_after_three_seconds() -> None:
    assert load_problem("NNx").space.stop_time == 40
    problem = load_problem("NNx", profile="instance2")
    assert problem.space.stop_time == 3
    assert [d.time for d in problem.space.dimensions] == [0, 1, 2]
    assert problem.space.bounds.tolist() == [[1.95, 2.05]] * 3


def test_each_piece_of_the_pedal_lasts_five_seconds() -> None:
    for name, last in (("AFC27", 50), ("AFC29", 45), ("AFC33", 45)):
        for profile in (None, "instance2"):
            space = load_problem(name, profile=profile).space
            assert [d.time for d in space.dimensions if d.name == "pedal"] == list(range(0, last + 5, 5))
    assert load_problem("AFC33").space.bounds[0].tolist() == [61.2, 81.2]


def test_published_tables_cover_the_specs() -> None:
    names = {name for system in PUBLISHED for name in SYSTEMS[system][0].split()}
    tables = read_published()
    columns = [*tables.columns.values(), *tables.ablation.values(), *tables.llms.values()]
    assert [column.keys() for column in columns] == [names] * len(columns)

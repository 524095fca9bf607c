"""Suites: published lists of requirements."""

import tomllib

from falsifier.core.files import bundled
from falsifier.errors import SpecError, did_you_mean
from falsifier.problem.loading import find_spec
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.problem.spec import read_spec

SUITES = ("arch-comp",)
# The competition's protocol: simulations per run, and the parameterization that published results have.
PROTOCOL_SIMULATIONS = 1500
PROTOCOL_PARAMETERIZATION: Parameterization = "fixed"


def suite(name: str, *, profile: str | None = None) -> tuple[ProblemSource, ...]:
    """Requirements of a suite.

    Args:
        name: ``arch-comp``: the requirements in ``published.toml``, in that order.
        profile: omit requirements whose spec does not offer this profile.

    Raises:
        SpecError: for an unknown name.
    """
    if name not in SUITES:
        raise SpecError(f"unknown suite {name!r}; {did_you_mean(name, SUITES)}")
    published = tomllib.loads((bundled("specs") / "published.toml").read_text(encoding="utf-8"))
    targets = [bundled_target(key) for key in published["best"] if key != "source"]
    return tuple(ProblemSource(target=t) for t in targets if profile is None or _offers(t, profile))


def bundled_target(requirement: str) -> str:
    """Target of a bundled requirement including its spec, such as ``NN:NN``: ``NN`` alone is the whole spec.

    Raises:
        SpecError: if there is none of that name.
    """
    return f"{find_spec(requirement)[0].stem}:{requirement}"


def _offers(target: str, profile: str) -> bool:
    return profile in read_spec(find_spec(target)[0]).profiles

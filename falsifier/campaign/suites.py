"""Suites: well-known lists of requirements."""

import tomllib

from falsifier.errors import SpecError, did_you_mean
from falsifier.problem import bundled, find_spec
from falsifier.request import ProblemRequest
from falsifier.spec import read_spec

SUITES = ("arch-comp",)


def suite(name: str, *, profile: str | None = None) -> tuple[ProblemRequest, ...]:
    """Requirements of a suite.

    Args:
        name: ``arch-comp``: the requirements that ``published.toml`` has numbers of, in its order.
        profile: leave out the requirements whose spec does not offer this profile.

    Raises:
        SpecError: for an unknown name.
    """
    if name not in SUITES:
        raise SpecError(f"unknown suite {name!r}; {did_you_mean(name, SUITES)}")
    published = tomllib.loads((bundled("specs") / "published.toml").read_text(encoding="utf-8"))
    names = [key for key in published["best"] if key != "source"]
    return tuple(ProblemRequest(target=n) for n in names if profile is None or _offers(n, profile))


def _offers(target: str, profile: str) -> bool:
    return profile in read_spec(find_spec(target)[0]).profiles

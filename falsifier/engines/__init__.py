"""Search engines, one file each (``surrogate`` is a folder); all are made by ``make_proposer``."""

from falsifier.engines.registry import DEFAULT_ENGINE, ENGINES, check_engine, make_proposer

__all__ = ["DEFAULT_ENGINE", "ENGINES", "check_engine", "make_proposer"]

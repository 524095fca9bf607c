"""Search engines, one file each (``surrogate`` is a folder); ``make_engine`` creates them by name."""

from falsifier.engines.registry import DEFAULT_ENGINE, ENGINES, check_engine, make_engine

__all__ = ["DEFAULT_ENGINE", "ENGINES", "check_engine", "make_engine"]

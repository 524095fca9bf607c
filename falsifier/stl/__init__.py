"""Signal Temporal Logic: formulas, robustness, critical time and diagnosis.

>>> formula = parse("G[0,20] (speed <= 120)")
>>> formula.signals, formula.horizon()
(('speed',), 20.0)
"""

from falsifier.stl.breach import Breach
from falsifier.stl.diagnosis import Diagnosis
from falsifier.stl.formula import Formula
from falsifier.stl.monitor import Monitor, Verdict
from falsifier.stl.parser import parse
from falsifier.stl.words import in_words

__all__ = ["Breach", "Diagnosis", "Formula", "Monitor", "Verdict", "in_words", "parse"]

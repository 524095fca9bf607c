"""Signal Temporal Logic: formulas, robustness, critical time and diagnosis.

>>> formula = parse("G[0,20] (speed <= 120)")
>>> formula.signals, formula.horizon()
(('speed',), 20.0)
"""

from falsifier.stl.breach import Breach as Breach
from falsifier.stl.diagnosis import Diagnosis as Diagnosis
from falsifier.stl.formula import Formula as Formula
from falsifier.stl.monitor import Monitor as Monitor, Verdict as Verdict
from falsifier.stl.parser import parse as parse
from falsifier.stl.words import in_words as in_words

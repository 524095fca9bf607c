"""What simulations that were drawn at random say about the probability of a violation."""

from falsifier.search.assurance.assess import Assurance, Searched, assess
from falsifier.search.assurance.splitting import Splitting

__all__ = ["Assurance", "Searched", "Splitting", "assess"]

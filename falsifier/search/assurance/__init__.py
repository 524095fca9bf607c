"""What simulations that were drawn at random say about the probability of a violation."""

from falsifier.search.assurance.assess import Assurance, assess
from falsifier.search.assurance.splitting import Splitting
from falsifier.search.assurance.tail import Tail

__all__ = ["Assurance", "Splitting", "Tail", "assess"]

"""The settings of the surrogate engine that measurements vary, with the reasons; the same for every model."""

from dataclasses import dataclass

from falsifier.engines.layout import CELLS


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine opens, learns, plans and chooses who proposes."""

    cells: int = CELLS  # number of grid cells over the formula's horizon
    # Constant extremes before the first random program, for formulas that a single extreme can violate.
    constants: int = 1
    bangs: int = 2  # number of switching inputs among the first simulations of a formula with nested windows
    pauses: int = 2  # number of constant extremes between these
    # Number of stepping inputs, instead of constant extremes, if a violation requires several conditions at
    # once: no single extreme causes it, and dynamics are worth more than steady states.
    probes: int = 2
    pool: int = 500  # number of first candidates of a plan; each generation adds half as many
    generations: int = 4  # number of generations of a plan, after the first candidates
    bound_steps: int = 4  # number of gradient steps towards bounds after the generations
    reserved: float = 0.04  # share of the turns that no rating takes away from each of the simple arms
    # Number of simulations after the first ones with nothing reserved: good dynamics are not held up.
    trial: int = 8
    # Number of further proposals if one will probably fail; the least risky one is simulated.
    retries: int = 12
    risk_weight: float = 5.0  # scaled robustness that a certain failure costs in planning

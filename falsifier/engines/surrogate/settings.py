"""The settings of the surrogate engine that measurements vary, with the reasons; the same for every model."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine opens, learns, plans and chooses who proposes.

    Attributes:
        cells: number of grid cells over the formula's horizon, on which outputs are predicted and free inputs
            are held; enough for pieces of 1 % of the horizon, few enough for a roll-out in milliseconds.
        constants: number of constant extremes among the first simulations of a formula that a single extreme
            can violate; each reaches one steady state.
        bangs: number of switching inputs among the first simulations of a formula with nested windows.
        pauses: number of constant extremes between these.
        probes: number of stepping inputs, instead of constant extremes, if a violation requires several
            conditions at once: no single extreme causes it, and dynamics are worth more than steady states.
        pool: number of first candidates of a plan.
        children: number of new candidates per generation.
        generations: number of generations of a plan, after the first candidates.
        bound_steps: number of gradient steps towards bounds after the generations.
        reserved: share of the turns that no rating takes away from each of the simple arms.
        trial: number of simulations after the first ones in which nothing is reserved, so that dynamics that
            predict well are not held up.
        retries: number of further proposals if one will probably fail; the least risky one is simulated.
        risk_weight: scaled robustness that a certain failure costs in planning.
    """

    cells: int = 100
    constants: int = 2
    bangs: int = 2
    pauses: int = 2
    probes: int = 2
    pool: int = 500
    children: int = 250
    generations: int = 4
    bound_steps: int = 4
    reserved: float = 0.04
    trial: int = 8
    retries: int = 12
    risk_weight: float = 5.0

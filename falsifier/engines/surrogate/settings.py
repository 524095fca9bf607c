"""All settings of the surrogate engine, with the reasons for them; they are the same for every model."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine opens, learns, plans and chooses who proposes.

    Attributes:
        cells: number of grid cells over the formula's horizon, on which outputs are predicted and free inputs
            are held; enough for pieces of 1 % of the horizon, few enough for a roll-out in milliseconds.
        constants: number of constant extremes among the first simulations of a formula that a single extreme
            can violate; each reaches one steady state.
        corners: the same for parameters alone, where a few more are worth it before anything is learnt.
        bangs: number of switching inputs among the first simulations of a formula with nested windows.
        pauses: number of constant extremes between these.
        probes: number of stepping inputs, instead of constant extremes, if a violation requires several
            conditions at once: no single extreme causes it, and dynamics are worth more than steady states.
        lags: number of cells that the dynamics look back; hidden states need several.
        ridge: relative regularisation of the dynamics, small because deviations are small.
        most_traces: maximum number of simulations from which dynamics are learnt, the best and the latest.
        base_rank: mean rank, from 0, of the simulation from which deviations are learnt.
        most_signals: number of inputs and outputs up to which a plan has all of its candidates; with more,
            fewer, so that its time does not grow.
        pool: number of first candidates of a plan.
        children: number of new candidates per generation.
        parents: number of survivors per generation.
        generations: number of generations of a plan, after the first candidates.
        bound_steps: number of gradient steps towards bounds after the generations.
        elites: number of best simulated inputs from which the first candidates are bred.
        at_bounds: probability that a level of a new input, or of a constant end, is a bound.
        memory: factor by which what an arm brought counts less with each of its later proposals.
        sharpness: power of the ratings to which the shares of turns are proportional.
        reserved: share of the turns that no rating takes away from each of the simple arms.
        trial: number of simulations after the first ones in which nothing is reserved, so that dynamics that
            predict well are not held up.
        retries: number of further proposals if one will probably fail; the least risky one is simulated.
        risk_weight: scaled robustness that a certain failure costs in planning.
    """

    cells: int = 100
    constants: int = 2
    corners: int = 8
    bangs: int = 2
    pauses: int = 2
    probes: int = 2
    lags: int = 6
    ridge: float = 1e-7
    most_traces: int = 60
    base_rank: float = 1.0
    most_signals: int = 8
    pool: int = 500
    children: int = 250
    parents: int = 30
    generations: int = 4
    bound_steps: int = 4
    elites: int = 8
    at_bounds: float = 0.8
    memory: float = 0.9
    sharpness: float = 3.0
    reserved: float = 0.04
    trial: int = 8
    retries: int = 12
    risk_weight: float = 5.0

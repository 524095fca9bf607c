"""All settings of the surrogate engine, with the reasons for them; they are the same for every model."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine learns, plans and chooses.

    Attributes:
        cells: number of grid cells over the formula's horizon, on which traces are predicted and free inputs
            are held; enough for pieces of 1 % of the horizon, few enough for a rollout in milliseconds.
        constants: number of constant extremes among the first simulations of a formula that a single extreme
            can violate; each reaches one steady state.
        near_extreme: share of each range within which another engine's constant input stands for the extreme.
        pauses: number of constant extremes between the first switching signals.
        bangs: number of switching signals among the first simulations of a formula with nested windows.
        most_bangs: maximum number of switching signals in total; if that many random ones did not violate,
            more will not.
        probes: number of stepping signals, instead of constant extremes, if a violation requires several
            conditions at once: no single extreme causes it, and dynamics are worth more than steady states.
        probe_pieces: number of levels of a stepping signal.
        features: number of random Fourier features of the nonlinear dynamics; more did not help.
        ridge: relative regularisation of the nonlinear dynamics.
        lags: number of cells that the linear dynamics look back; hidden states need several.
        linear_ridge: relative regularisation of the linear dynamics, small because deviations are small.
        best_weight: additional weight of the best trajectories in a fit, which must be accurate near them.
        best_count: number of trajectories that count as the best.
        most_rows: maximum number of rows of a regression; limits the time per proposal.
        exploration: probability of choosing the dynamics at random instead of by their recent errors.
        recent_errors: number of recent prediction errors by which dynamics are compared.
        offset_window: number of recent errors whose median corrects each predicate's margin.
        offset_limit: maximum correction in standard deviations of the margin; without it, large early errors
            mislead the search.
        pool: number of first candidates of a plan.
        children: number of new candidates per generation.
        parents: number of survivors per generation.
        generations: number of generations of a plan.
        vertex_steps: number of gradient steps towards bounds after the generations.
        directions: number of blocks of coordinates by which a gradient is taken; more take longer.
        elites: number of best simulated inputs from which the first candidates are bred.
        snap: difference in predicted scaled robustness up to which a simple input (constant or at its bounds)
            is preferred to the best one: extremes generalise better than fitted details.
        snap_decay: factor of snap after each simple input, so that the preference fades.
        stretches: factors of inner windows in the relaxations of a formula over discrete signals, whose
            robustness alone has no slope; so close to each other that a cell more or less makes a difference.
        bandit_window: number of recent proposals by which an arm is rated.
        bandit_power: power to which the share of costs that a proposal improves on is raised: an arm is rated
            by its best proposals.
        trial: number of proposals during which the dynamics are preferred, so that they can learn.
        trial_share: probability of the dynamics during their trial.
        trusted_error: recent prediction error, in scaled units, below which the dynamics are trusted.
        exact_error: recent prediction error of an automaton below which it is always the one that is planned
            on, without a liking for extremes.
        surprise: prediction error of an automaton from which on it is learnt again.
        exact_share: share of the usual candidates of a plan on an automaton, whose roll-outs take longer.
        trusted_share: probability of the dynamics if they are trusted and no other arm is rated higher.
        least_share: approximate minimum probability of each arm.
        direct_patience: number of simulations without improvement after which the direct search starts again
            from other points.
        direct_start: number of simulations of a round before their changes are tried.
        direct_fresh: share of random points in the direct search.
        direct_parents: number of best points of a round that are changed.
        direct_pieces: maximum number of pieces of its random points, which all inputs share; more are found
            by changes.
        direct_at_bounds: probability that a level of these, or of a constant end, is a bound.
        direct_held: share of its changes that keep all inputs constant from some time on: an excited system
            that is left alone may do by itself what constant disturbance hides.
        flat: share of simulations with the same cost from which on coverage leads the search.
        flat_start: minimum number of simulations for that.
        coverage_share: probability of coverage where it leads.
        coverage_led_share: the same once a cost is lower than the most common one.
        aim_share: share of simulations that aim at levels which context files give, as long as these bring
            something new as often as the others do.
        most_aimed: maximum share of these.
        aim_trial: number of these after which they are given up if none brought anything new.
        retries: number of further proposals if one will probably fail; the least risky one is simulated.
        risk_weight: scaled robustness that a certain failure costs in planning.
    """

    cells: int = 100
    constants: int = 2
    near_extreme: float = 0.1
    pauses: int = 2
    bangs: int = 2
    most_bangs: int = 8
    probes: int = 2
    probe_pieces: int = 12
    features: int = 128
    ridge: float = 1e-4
    lags: int = 6
    linear_ridge: float = 1e-7
    best_weight: float = 4.0
    best_count: int = 3
    most_rows: int = 6000
    exploration: float = 0.2
    recent_errors: int = 4
    offset_window: int = 3
    offset_limit: float = 0.25
    pool: int = 600
    children: int = 300
    parents: int = 30
    generations: int = 5
    vertex_steps: int = 4
    directions: int = 60
    elites: int = 8
    snap: float = 0.5
    snap_decay: float = 0.5
    stretches: tuple[float, ...] = tuple(7.0 ** (i / 15) for i in range(16))
    bandit_window: int = 8
    bandit_power: float = 4.0
    trial: int = 8
    trial_share: float = 0.9
    trusted_error: float = 0.5
    exact_error: float = 0.1
    surprise: float = 0.02
    exact_share: float = 0.4
    trusted_share: float = 0.8
    least_share: float = 0.1
    direct_patience: int = 30
    direct_start: int = 8
    direct_fresh: float = 0.05
    direct_parents: int = 20
    direct_pieces: int = 6
    direct_at_bounds: float = 0.8
    direct_held: float = 0.2
    flat: float = 0.6
    flat_start: int = 4
    coverage_share: float = 0.8
    coverage_led_share: float = 0.2
    aim_share: float = 0.3
    most_aimed: float = 0.7
    aim_trial: int = 16
    retries: int = 12
    risk_weight: float = 5.0

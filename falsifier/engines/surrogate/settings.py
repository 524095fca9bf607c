"""All settings of the surrogate engine, with their reasons. They are the same for every system."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Settings:
    """How the engine learns, plans and chooses.

    Attributes:
        cells: grid cells over the formula's horizon, on which traces are predicted and free inputs are
            held; enough for pieces of a hundredth of the horizon, few enough for a rollout in milliseconds.
        constants: constant extremes among the first simulations; each excites every steady state once.
        bangs: switching signals among the first simulations of a formula with nested windows.
        most_bangs: switching signals in all; when so many drawn at random did not violate, more will not.
        probes: stepping signals instead, where a violation needs several things at once: no extreme alone
            can bring it about, and knowing the dynamics is worth more than two steady states.
        probe_pieces: levels that a stepping signal goes through.
        features: random Fourier features of the nonlinear dynamics; more changed nothing.
        ridge: relative regularisation of the nonlinear dynamics.
        lags: of the linear dynamics; hidden states need a few.
        linear_ridge: relative regularisation of the linear dynamics, small because deviations are small.
        best_weight: extra weight of the best trajectories in the fits: accuracy is needed near them.
        best_count: how many trajectories count as the best.
        most_rows: rows of a regression at most; bounds the time of a proposal.
        exploration: probability of taking the dynamics with the larger recent error.
        recent_errors: prediction errors that dynamics are judged by.
        offset_window: last errors whose median corrects each predicate's margin.
        offset_limit: largest correction in standard deviations of the margin; without a limit early,
            wild errors lead the search away.
        pool: first candidates of a plan.
        children: further candidates of each generation.
        parents: survivors of each generation.
        generations: of a plan.
        vertex_steps: gradient steps towards bounds after the generations.
        elites: best simulated inputs that the pool is bred from.
        snap: scaled robustness that a simple input (constant, or at its bounds) may be predicted worse
            than the best one and still be taken: extremes generalise better than fitted details.
        stretches: factors of inner windows that a formula over discrete signals is relaxed with, because
            its robustness alone has no slope.
        bandit_window: proposals by which an arm is judged.
        trial: proposals of the dynamics during which they are preferred, so that they can learn.
        trial_share: probability of the dynamics during their trial.
        trusted_error: recent prediction error in scaled units below which the dynamics are trusted.
        trusted_share: probability of trusted dynamics that no other arm outranks.
        least_share: probability below which no arm falls.
        region_pieces: held pieces of a free input, region by region: most starts are coarse, for those end
            soon, and what needs more switches has its turn too.
        region_start: points before the trust region fits its first process.
        region_points: points that its process keeps at most (cubic cost).
        region_candidates: points among which it chooses.
        region_bound_start: probability that a coordinate of a first point lies at a bound.
        region_bound: probability that a changed coordinate of a candidate is moved to its nearer bound.
        region_jump: probability that it is redrawn from its whole range.
    """

    cells: int = 100
    constants: int = 2
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
    elites: int = 8
    snap: float = 0.5
    snap_decay: float = 0.5
    stretches: tuple[float, ...] = (1.0, 1.4, 2.0, 3.0, 4.5, 7.0)
    bandit_window: int = 8
    trial: int = 8
    trial_share: float = 0.9
    trusted_error: float = 0.5
    trusted_share: float = 0.8
    least_share: float = 0.1
    region_pieces: tuple[int, ...] = (5, 5, 5, 8)
    region_start: int = 16
    region_points: int = 150
    region_candidates: int = 1500
    region_bound_start: float = 0.7
    region_bound: float = 0.2
    region_jump: float = 0.06

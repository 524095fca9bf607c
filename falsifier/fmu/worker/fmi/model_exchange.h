/* A model-exchange FMU as a differential equation, and the memory of its solver. */

#ifndef MODEL_EXCHANGE_H
#define MODEL_EXCHANGE_H

#include "worker.h"

#define STAGES 7

typedef unsigned (*set_time)(void *, double);
typedef unsigned (*set_vector)(void *, const double *, size_t);
typedef unsigned (*get_vector)(void *, double *, size_t);

/* What is called in every step; completed_step and update have other arguments in each version of FMI. */
struct continuous_functions {
    set_time set_time;
    set_vector set_states;
    get_vector get_states, get_derivatives, get_indicators;
    void *completed_step, *update;
    without_arguments enter_event_mode, enter_continuous_time_mode;
};

struct solver {
    struct fmu *fmu;
    struct plan *plan;
    struct continuous_functions f;
    size_t n, indicators;
    double *weights; /* absolute tolerance of each state */

    double time, next_step, next_event;
    int implicit, stiff_hits, other_hits, events, jacobian_known;

    double *x, *new_x;          /* states, and those at the end of a trial step */
    double *stages[STAGES];     /* derivatives at the stages of a step */
    double *work[4];
    double *jacobian; /* n by n, row by row, then its factors; none before the first implicit step */
    size_t *pivots;
    double *z, *new_z, *z_low, *z_high, *z_trial; /* event indicators */
};

struct trial {
    unsigned status;
    double error;     /* in units of the tolerance; inf if the step could not be completed */
    double stiffness; /* h times an estimate of the dominant eigenvalue */
};

/* continuous.c */
void find_functions(struct solver *s);
void get_sizes(struct fmu *fmu);
unsigned weigh_states(struct solver *s);
unsigned get_states(const struct solver *s);
unsigned derive(const struct solver *s, double time, const double *x, double *derivatives);
unsigned get_indicators(const struct solver *s, double *z);
unsigned complete_step(const struct solver *s, int *wants_event, int *ends);
struct outcome settle_events(struct solver *s);
struct outcome refresh(struct solver *s);
struct outcome handle_event(struct solver *s);
double next_break(const struct solver *s);
int enter_pieces(struct solver *s); /* returns whether an input jumps */

/* integrators.c */
struct trial explicit_step(struct solver *s, double h);
struct trial implicit_step(struct solver *s, double h);
void interpolate(const struct solver *s, double h, double theta, int end_stage, double *x);

#endif

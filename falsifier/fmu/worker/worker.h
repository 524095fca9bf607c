/* What the parts of the worker share: the FMU, the plan of its simulations, and the outcome of each request.
 *
 * The worker is the process that an FMU runs in; see main.c. What it simulates is always a system (system.h), of one
 * component if it is a single FMU. Whatever belongs to one FMU is in its struct fmu. */

#ifndef WORKER_H
#define WORKER_H

#include <setjmp.h>
#include <stddef.h>
#include <stdint.h>

/* Where a simulation stopped, as Where in connection.py. */
enum where {
    DONE, SETTING, STEPPING, GETTING, EVENT, TERMINATED, STUCK, TOO_SMALL,
    /* of systems; the texts have positions of connected outputs, and their changes */
    NOT_CONVERGED = 9, RESTORING, NOT_A_NUMBER, UNSETTLED, MISSING_AT_FIRST, MISSING_AFTER_START,
    CALLING = 20,   /* a function at the start of the simulation; the text names it */
    WRITING,        /* the first values; the text says which */
    TEXT,           /* a string parameter; the text is its position */
    TIMEOUT,        /* the time limit */
    IMPOSSIBLE,     /* the FMU cannot be used; the text says why */
    CANNOT_RENEW,   /* no new instance can be made; the text says why */
    CRASHED         /* the last words of a process; the status is Windows' exception code */
};

/* FMI's status is unsigned: a negative one, which FMI does not define, is larger than all others. */
struct outcome {
    unsigned status;
    enum where where;
};

static const struct outcome done = {0, DONE};

/* Whether a simulation stops here for a status, which is the case if it is worse than a warning. */
static inline struct outcome checked(unsigned status, enum where where)
{
    return (struct outcome){status, status > 1 ? where : DONE};
}

typedef unsigned (*without_arguments)(void *);
typedef unsigned (*update_discrete_states_3)(
    void *, uint8_t *, uint8_t *, uint8_t *, uint8_t *, uint8_t *, double *);

/* What co-simulation calls in every step; the last three only of FMI 3 with event mode. */
struct step_functions {
    void *do_step;
    without_arguments enter_event_mode, enter_step_mode;
    update_discrete_states_3 update;
};

typedef unsigned (*get_state)(void *, void **);
typedef unsigned (*set_state)(void *, void *);

/* What saves, restores and frees states (FMI 2 and 3). */
struct saving {
    get_state get, release;
    set_state set;
};

/* One FMU: what the request says of it, its library, and its instance with what surrounds it. */
struct fmu {
    int major, is_model_exchange, logging, event_mode, saves_state;
    int is_repeated; /* steps are done again from a saved state */
    size_t states, indicators;
    char *library, *identifier, *name, *token, *resources;
    void *module, *instance, *state;
    struct step_functions step;
    struct saving saving;
    struct solver *solver; /* model exchange: see model_exchange.h */
};

/* One get or set call. */
struct call {
    void *function;
    uint32_t *references;
    size_t count;
    void *values;
    size_t size;
};

/* Where the value of one variable is: storage type (the position in encoding.STORAGE), address, and sign. */
struct place {
    int storage, is_boolean;
    double sign;
    char *address;
};

struct ports {
    struct call *calls;
    size_t call_count;
    struct place *places;
    size_t count;
};

/* One piece of an input: c[0] + c[1] dt + c[2] dt^2 + c[3] dt^3 from its start; unused pieces start at inf. */
struct piece {
    double start, c[4];
};

/* Variables that are set during the simulation. Setting an element of an array sets the whole array: the fixed
 * elements keep the values of these parameters. */
struct inputs {
    struct ports ports;
    struct place *fixed;
    size_t *fixed_rows, fixed_count;
    const struct piece **rows;
    size_t pieces;
    size_t *current; /* the piece that each one is in */
};

struct string {
    uint32_t reference;
    char *text;
};

struct plan {
    double stop_time, max_step, tolerance, solver_tolerance;
    int has_tolerance;
    size_t strings_count;
    struct string *strings;
    struct ports parameters, outputs;
    struct inputs inputs, held; /* held: may change only at events */
    const double *parameter_values;
};

/* Numbers at the start of the shared memory: which component of a system runs, the time that is simulated, and the
 * stop time once all outputs are recorded. */
enum header { RUNNING, SIMULATED, COMPLETE, HEADER = 8 };

#define STEPS_PER_CLOCK_CHECK 100

/* How far a simulation is, and when it is ended: after limit s, or limit s after the last share of simulated time. */
struct progress {
    double *header, limit, deadline, share, next;
    unsigned steps;
};

/* fmiEventInfo */
struct event_info_1 {
    char converged, references_changed, states_changed, terminate, has_next_time;
    double next_time;
};

/* library.c */
const char *fmu_load(struct fmu *fmu); /* returns what went wrong, or NULL */
const char *fmu_instantiate(struct fmu *fmu);
void fmu_free(struct fmu *fmu);
void fmu_unload(struct fmu *fmu);
void *fmu_function(const struct fmu *fmu, const char *name); /* NULL if it is not exported */
void *fmu_required(const struct fmu *fmu, const char *name); /* ends the request if it is not exported */

/* ports.c */
unsigned exchange_values(const struct fmu *fmu, const struct ports *ports);
unsigned read_values(const struct fmu *fmu, const struct ports *ports, double *numbers, size_t stride);
unsigned write_row(const struct fmu *fmu, const struct ports *ports, const double *numbers);
void put(const struct place *place, double number);
double rounding(double time);
double piece_at(const struct piece *piece, double time);

/* lifecycle.c */
struct outcome enter_initialisation(struct fmu *fmu, struct plan *plan);
struct outcome leave_initialisation(struct fmu *fmu, struct plan *plan, struct event_info_1 *first_events);
void terminate(struct fmu *fmu);
int reset(struct fmu *fmu);
int find_saving(struct fmu *fmu); /* returns whether the library has all functions for states */
int take_state(struct fmu *fmu);
int restore_state(struct fmu *fmu);
void forget_state(struct fmu *fmu);

/* co_simulation.c */
void find_step_functions(struct fmu *fmu);
struct outcome begin_steps(struct fmu *fmu); /* after the initialisation or an event */
struct outcome change_at_event(struct fmu *fmu, const struct ports *ports);
struct outcome do_step(struct fmu *fmu, double start, double end, int *ends);

/* solver.c */
void prepare_solver(struct fmu *fmu, struct plan *plan);
struct outcome begin_solving(struct fmu *fmu, const struct event_info_1 *first_events);
struct outcome solve_step(
    struct fmu *fmu, double start, double end, int has_event, struct progress *progress, int *ends);
void *keep_solver(const struct fmu *fmu, void *kept); /* what changes in a step; new memory if kept is NULL */
void bring_back_solver(struct fmu *fmu, void *kept);

/* request.c */
struct request {
    char *at, *end;
};
size_t read_size(struct request *request);
void read_fmu(struct request *request, struct fmu *fmu);
char *read_text(struct request *request);
double read_number(struct request *request);
void read_strings(struct request *request, struct plan *plan);
void read_ports(struct request *request, const struct fmu *fmu, const char *verb, struct ports *ports);
void read_inputs(struct request *request, const struct fmu *fmu, size_t pieces, struct inputs *inputs);

/* main.c */
void give_up(const char *format, ...) __attribute__((noreturn, format(printf, 1, 2)));
void say(unsigned status, const char *text); /* passes a message of the FMU on */
int is_late(struct progress *progress, double time); /* to be called after each step */
void *need(size_t count, size_t size);       /* zeroed memory */

extern jmp_buf end_of_request; /* where give_up goes */
extern const char *failing; /* the text of the next outcome */

#endif

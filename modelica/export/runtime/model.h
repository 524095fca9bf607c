/* The simulated model: its memory, the functions of the generated model.c, and those of the runtime.
 *
 * Copying the struct copies the complete state of a simulation, except the points of its delay lines (lines.c).
 */
#ifndef MODEL_H
#define MODEL_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sizes.h" /* generated: MODEL_STATES, MODEL_REALS, ... */

#define MODEL_CROSSINGS (MODEL_RELATIONS + 2 * MODEL_FLOORS)
#define TIME_TOLERANCE 1e-9 /* s; times that differ by less than this are considered equal */

typedef struct {
    double key, value;
} Point;

typedef struct {
    Point point[LINE_POINTS]; /* a ring buffer */
} Line;

typedef struct { /* inputs of the delay lines at one time, and how far back each is read */
    double key[MODEL_LINES + 1], value[MODEL_LINES + 1], span[MODEL_LINES + 1];
} Entries;

typedef struct {
    double time;
    double r[MODEL_REALS + 1]; /* states, derivatives, all other Reals */
    int i[MODEL_INTS + 1];     /* Integers and Booleans */
    double pr[MODEL_PRE_REALS + 1]; /* values before the event */
    int pi[MODEL_INTS + 1];
    unsigned char w[MODEL_CONDITIONS + 1], pw[MODEL_CONDITIONS + 1]; /* when-conditions, and before the event */
    unsigned char rel[MODEL_RELATIONS + 1];       /* relations, frozen between events */
    unsigned char trel[MODEL_TIME_RELATIONS + 1]; /* `time >= threshold`, frozen between events */
    double fl[MODEL_FLOORS + 1];                  /* floor values, frozen between events */
    unsigned char tick[MODEL_TICKS + 1];          /* sample(...) is true now */
    long long tick_count[MODEL_TICKS + 1];        /* index of the next tick; its time is computed from it, without accumulating rounding errors */
    double reinit_value[MODEL_STATES + 1];
    unsigned char reinit_set[MODEL_STATES + 1];
    double step;      /* s; next step proposed by the adaptive integrator */
    double tolerance; /* relative, adaptive integrator */
    int current;      /* derivatives are up to date with states, inputs and time */
    int rest_current; /* all other variables are, too */
    int after_event;  /* no step since the last event */
    int idle_events;  /* events since time last advanced */
    Line *lines;      /* delay lines, shared by copies of this struct */
    long long line_begin[MODEL_LINES + 1], line_end[MODEL_LINES + 1], line_hint[MODEL_LINES + 1];
    double line_time; /* s; time of the last record */
    double longest;   /* s; limit of the step size, because steps must be shorter than the delays */
    int ahead;        /* a delay line was read beyond its last point */
    char error[256];  /* empty: no error */
} Model;

/* Whether and when a variable may be set through the FMI. */
enum { KIND_LOCAL = 0, KIND_START = 1, KIND_FIXED = 2, KIND_TUNABLE = 3, KIND_INPUT = 4 };
/* How a crossing function compares with zero. */
enum { OP_LT = 0, OP_LE = 1, OP_GT = 2, OP_GE = 3 };

/* ---- generated ---- */
extern const char model_guid[];
extern const unsigned char model_real_kind[], model_int_kind[];
extern const int model_pre_reals[]; /* index in r of the Reals with a value before the event; discrete ones first */
extern const int model_output_ints[], model_output_reals[]; /* discrete outputs */
extern const unsigned char model_crossing_op[];
extern const double model_nominal[];
extern const int model_group[];             /* implicit method: no slope depends on two states of one group */
extern const unsigned char model_depends[]; /* implicit method: whether a slope (row) depends on a state (column) */
extern const char *const model_line_names[]; /* file and line of each delay */
void model_defaults(Model *m);           /* literal values of parameters and starts */
void model_parameters(Model *m);         /* parameters that depend on others */
void model_starts(Model *m);             /* start values that depend on parameters */
void model_initial(Model *m);            /* the initial system */
void model_event(Model *m);              /* everything, relations evaluated, when clauses active */
void model_derivatives(Model *m);        /* derivatives and what they need, relations frozen */
void model_rest(Model *m);               /* everything else that can change between events */
void model_operands(Model *m);           /* what the crossing functions need beyond the derivatives */
void model_crossings(Model *m, double *z);
void model_floors(Model *m, double *values);
void model_thresholds(Model *m, double *at);
void model_tick_times(Model *m, int k, double *start, double *interval);

void model_line_seeds(Model *m);         /* initial content of the delay lines */
void model_lines(Model *m, Entries *now);

/* ---- runtime ---- */
void model_fail(Model *m, const char *message);
void model_fail_subscript(Model *m, int index, int size, int line);

/* events.c */
void events_initialize(Model *m);           /* solve the initial system at the current time */
void events_handle(Model *m);               /* ticks and time events that are due, then event iteration */
int events_crossed(Model *m, double *z);    /* whether a relation differs from its frozen value; fills z */
double events_next_time(Model *m);          /* HUGE_VAL if there is none */
void events_evaluate(Model *m);             /* bring the derivatives up to date */
void events_evaluate_all(Model *m);         /* bring all variables up to date */

/* lines.c */
void line_seed(Model *m, int k, double key, double value);
void lines_start(Model *m);
void lines_record(Model *m);
void lines_last(const Model *m, Entries *last);
void lines_insert(Model *m, const Entries *entries);
int lines_are_straight(const Model *m, const Entries *from, const Entries *middle, const Entries *to);
double line_read(Model *m, int k, double position);

/* integrate.c */
int integrate(Model *m, double stop); /* to `stop`, or to the first state event; then returns 1 */

/* cosimulation.c */
typedef struct {
    Model now;
    Model before; /* as it was before the ticks at the end of the last communication step */
    int repeatable, changed_reals, changed_others;
} Simulation;

void simulation_start(Simulation *s);
int simulation_step(Simulation *s, double start, double size);

/* ---- small functions for generated code ---- */
static inline int subscript(Model *m, int index, int size, int line) {
    if (index >= 1 && index <= size) return index - 1;
    model_fail_subscript(m, index, size, line);
    return 0;
}
static inline void same_size(Model *m, int a, int b) {
    if (a != b) model_fail(m, "the arrays in an assignment have different sizes");
}
static inline int time_reached(const Model *m, double at) { return m->time >= at - TIME_TOLERANCE; }
static inline double square(double x) { return x * x; }
static inline int sign_of(double x) { return (x > 0) - (x < 0); }
static inline double min_real(double a, double b) { return a < b ? a : b; }
static inline double max_real(double a, double b) { return a > b ? a : b; }
static inline int min_int(int a, int b) { return a < b ? a : b; }
static inline int max_int(int a, int b) { return a > b ? a : b; }
static inline double div_real(double a, double b) { return trunc(a / b); }
static inline double mod_real(double a, double b) { return a - floor(a / b) * b; }
static inline double rem_real(double a, double b) { return a - trunc(a / b) * b; }
static inline int div_int(int a, int b) { return b ? a / b : 0; }
static inline int rem_int(int a, int b) { return b ? a % b : 0; }
static inline int mod_int(int a, int b) {
    int r = rem_int(a, b);
    return r && (r < 0) != (b < 0) ? r + b : r;
}
static inline double sum_of(const double *v, int n) {
    double s = 0;
    for (int k = 0; k < n; k++) s += v[k];
    return s;
}
static inline double product_of(const double *v, int n) {
    double s = 1;
    for (int k = 0; k < n; k++) s *= v[k];
    return s;
}
static inline double min_of(const double *v, int n) {
    double s = v[0];
    for (int k = 1; k < n; k++) s = min_real(s, v[k]);
    return s;
}
static inline double max_of(const double *v, int n) {
    double s = v[0];
    for (int k = 1; k < n; k++) s = max_real(s, v[k]);
    return s;
}

#endif

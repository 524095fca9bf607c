/* A system: connected FMUs that are simulated together, or a single FMU. */

#ifndef SYSTEM_H
#define SYSTEM_H

#include "worker.h"

/* The last two values of a connected output, and the value of the round before; a negative time: none yet. */
struct signal {
    double value, time, old_value, old_time, tried;
};

/* Where the value of one input comes from: factor * source + offset, or the start value while there is none. */
struct feed {
    const struct signal *signal; /* NULL: pieces */
    const struct piece *pieces;
    size_t piece; /* the current one */
    double factor, offset, start, written;
    int is_linear; /* follows the line through the last two values of its signal */
    struct piece *line, kept_line; /* model exchange: the pieces that the solver follows */
};

/* What the master asks of a component. */
enum task {
    LOAD_LIBRARY, TAKE_PLAN, ENTER, SET_FIRST, LEAVE, STEP, KEEP, BRING_BACK, READ_SIGNALS, READ_OTHERS, END,
    RESET_INSTANCE, TAKE_STATE, RESTORE_STATE, FORGET_STATES, NEW_INSTANCE, UNLOAD
};

/* A question to a component and its answer; a component with a process of its own shares it with the master. */
struct exchange {
    enum task task;
    double start, end; /* of a step */
    int jumps;         /* inputs that may change only at events have changed, or one jumps in model exchange */
    int ends;          /* the FMU ends the simulation */
    struct outcome outcome;
    size_t memory; /* that another process has used, in KiB */
    char text[1024]; /* of the outcome */
};

struct component {
    struct system *system;
    struct fmu fmu;
    struct plan plan; /* its own: inputs, parameters, and outputs that are recorded but not connected */
    struct ports connected; /* outputs */
    struct signal *signals; /* of these outputs */
    struct feed *feeds, *kept_feeds; /* of its inputs, then of those that may change only at events */
    size_t *parameter_rows, *output_rows;
    size_t every;    /* communication steps per step of its own */
    size_t loop_end; /* of the first of a loop that is iterated: the position after its last one */
    int is_iterated;

    struct exchange *exchange;
    double *in, *out; /* values that it is given, or that are read from it */
    void *kept_state, *kept_solver;
    struct process *process; /* its own; NULL if it runs in this one */
    long id; /* of that process */
};

/* A connected output that is recorded. */
struct copy {
    const struct signal *signal;
    size_t row;
};

struct system {
    size_t count; /* components, in the order in which they step */
    struct component *components;
    size_t signal_count, copy_count;
    struct signal *signals;
    struct copy *copies;
    int saves_state; /* all components declare it */
    int is_separate; /* each component has a process of its own */
    int is_jacobi;
    size_t max_rounds;
    double tolerance; /* change, relative above 1, below which a value has converged */
    double stop_time;
    size_t samples, every; /* points of the output grid, and communication steps between two */
    size_t pieces;         /* per input that is not connected */
    size_t recorded_count;
    double *header; /* of the room */
    const double *parameters;
    double *recorded; /* one row per output, one column per sample */
    struct progress *progress; /* of the simulation under way; NULL in the process of a component */
};

/* system.c */
struct outcome ask_each(struct system *s, enum task task); /* until one fails */
int all_accept(struct system *s, enum task task);          /* asks all, whatever they answer */
struct outcome simulate_system(struct system *s, struct progress *progress);

/* feeds.c */
void forget_signals(struct system *s);
void start_feeds(struct component *c);
void begin_lines(struct component *c);
void gather(struct component *c, double start, double middle);
void prepare_step(struct component *c, double start, double middle);
void keep_feeds(struct component *c);
void bring_back_feeds(struct component *c);
int store_signals(struct component *c, double time); /* returns whether one is NaN */
int moves(const struct signal *signal, double tolerance);

/* component.c */
struct outcome ask(struct component *c, enum task task);
struct outcome carry_out(struct component *c);

/* remote.c */
void start_process(struct component *c);
struct outcome ask_process(struct component *c);
void end_process_of(struct component *c);
void send_plan(struct component *c, const struct request *r);
double *shared_numbers(struct component *c, size_t count); /* that it is given, or that are read from it */

/* request.c */
void read_components(struct request *r, struct system *s);
void read_system_plan(struct request *r, struct system *s, double *room);

#endif

/* When to reset, restore or replace what is simulated repeatedly, and when to replace the whole process.
 *
 * After the first simulation it is repeated in each way to start again, the cheapest first, until one gives the same
 * outputs: FMUs declare resets and saved states that do not work. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "platform/platform.h"
#include "session.h"
#include "system/system.h"

/* Simulations longer than this are not repeated to find out whether a reset reproduces the results. */
#define MOST_TEST_SECONDS 1.0
/* Some tools' runtimes run out of thread keys after about 1000 instances in one process. */
#define MOST_INSTANCES 400
/* Growth in memory after which a process that leaks is replaced. */
#define MOST_GROWTH_KIB (256u << 10)

static const char *const WAYS[] = {"reset", "state", "instance", "library", "process"};

static struct system fmus;
static struct request plan; /* as it was received: read again after the library was loaded again */
static enum { NEW, BROKEN, FINISHED } condition;
static enum reuse reuse;
static unsigned untrusted; /* ways not to try, as bits */
static int is_taken, instances, is_known;
static size_t first_size;
static double *trial; /* outputs of a test */

/* Processes for the components are started before any library is loaded. */
static const char *load(void)
{
    for (size_t k = 0; k < fmus.count && fmus.is_separate; k++)
        start_process(&fmus.components[k]);
    return ask_each(&fmus, LOAD_LIBRARY).where == DONE ? NULL : failing;
}

static void unload(void)
{
    ask_each(&fmus, UNLOAD);
    for (size_t k = 0; k < fmus.count; k++)
        if (fmus.components[k].process)
            end_process_of(&fmus.components[k]);
}

void start_session(struct request *request)
{
    enum reuse how = (enum reuse)read_size(request);
    is_known = how != UNKNOWN;
    reuse = is_known ? how : BY_INSTANCE;
    untrusted = (unsigned)read_size(request);
    /* Which component is loaded is told there, if it can be mapped before the plan is known. */
    fmus.header = map_room("");
    read_components(request, &fmus);
    const char *wrong = load();
    if (wrong)
        give_up("%s", wrong);
}

/* The memory of simulations begins with a header; then it is laid out: parameters, inputs, outputs. */
static void prepare(void)
{
    struct request request = plan;
    const char *place = read_text(&request);
    fmus.header = map_room(place);
    if (!fmus.header)
        give_up("the memory of a simulation cannot be mapped%s%s", *place ? ": " : "", place);
    for (size_t k = 0; k < fmus.count; k++)
        if (fmus.components[k].process)
            send_plan(&fmus.components[k], &request);
    read_system_plan(&request, &fmus, fmus.header + HEADER);
    ask_each(&fmus, TAKE_PLAN);
    if (trial)
        fmus.recorded = trial;
}

void prepare_session(struct request request)
{
    plan = request;
    prepare();
}

static void forget_saved(void)
{
    ask_each(&fmus, FORGET_STATES);
    is_taken = 0;
}

/* Replace the instance, and the library too if its static data must not survive. */
static const char *renew(void)
{
    const char *wrong;
    forget_saved();
    condition = BROKEN;
    if (reuse == BY_LIBRARY) {
        unload();
        wrong = load();
        if (!wrong)
            prepare();
    } else {
        wrong = ask_each(&fmus, NEW_INSTANCE).where == DONE ? NULL : failing;
    }
    if (!wrong)
        condition = NEW;
    return wrong;
}

/* Reset the instance after a finished simulation or restore its state; returns whether that worked. */
static int is_brought_back(void)
{
    if (condition != FINISHED)
        return 0;
    if (reuse == BY_RESET && all_accept(&fmus, RESET_INSTANCE))
        return 1;
    if (reuse == BY_STATE && is_taken && all_accept(&fmus, RESTORE_STATE))
        return 1;
    if (reuse == BY_RESET || (reuse == BY_STATE && is_taken))
        reuse = BY_INSTANCE;
    return 0;
}

static struct outcome run(double limit, unsigned shares, double *reached)
{
    struct progress progress = {fmus.header, limit, now() + limit, INFINITY, INFINITY, 0};
    fmus.header[SIMULATED] = 0.0;
    if (shares)
        progress.next = progress.share = fmus.stop_time / shares;
    *reached = 0.0;
    if (condition != NEW && !is_brought_back()) {
        failing = renew();
        if (failing)
            return (struct outcome){0, CANNOT_RENEW};
        progress.header = fmus.header; /* it may have been mapped again */
    }
    if (condition == NEW && reuse == BY_STATE && !is_taken) {
        is_taken = all_accept(&fmus, TAKE_STATE);
        if (!is_taken) {
            forget_saved();
            reuse = BY_INSTANCE;
        }
    }
    /* Stays so if anything below fails: such an instance cannot be reset reliably. */
    condition = BROKEN;
    failing = "";
    struct outcome o = simulate_system(&fmus, &progress);
    *reached = progress.header[SIMULATED];
    if (o.where == DONE)
        condition = FINISHED;
    return o;
}

/* Simulate once, within a limit in s for the whole simulation or, unless shares is 0, for each share of it. */
struct outcome simulate_again(double limit, unsigned shares, double *reached)
{
    double started = now();
    instances += reuse == BY_INSTANCE || reuse == BY_LIBRARY || !instances;
    struct outcome o = run(limit, shares, reached);
    if (o.where == DONE && !is_known && now() - started > MOST_TEST_SECONDS) {
        reuse = untrusted & 1u << BY_INSTANCE ? BY_PROCESS : BY_INSTANCE;
        is_known = 1;
    }
    return o;
}

int awaits_test(void)
{
    return !is_known;
}

static int succeeds(void)
{
    double reached;
    return run(INFINITY, 0, &reached).where == DONE;
}

/* Whether a simulation that starts in this way gives the same outputs again. */
static int gives_again(enum reuse way, const double *expected)
{
    size_t count = fmus.recorded_count;
    reuse = way;
    /* The first of these saves the state from which the next ones start; the last shows that it can be restored
     * repeatedly. */
    if (way == BY_STATE && !(succeeds() && succeeds()))
        return 0;
    memset(trial, 0, count * sizeof *trial);
    if (!succeeds())
        return 0;
    /* If the instance rejected its reset or its state, it was replaced; then this way was not tested. */
    if (reuse != way)
        return 0;
    for (size_t i = 0; i < count; i++)
        if (trial[i] != expected[i] && !(trial[i] != trial[i] && expected[i] != expected[i]))
            return 0;
    return 1;
}

/* Find the cheapest way to start again that reproduces the outputs of the first simulation.
 *
 * The parent reads these meanwhile, so the tests write elsewhere. Each is announced before, since it may crash. */
void find_reuse(void (*announce)(const char *way))
{
    double *outputs = fmus.recorded;
    size_t count = fmus.recorded_count;
    double *expected = need(count, sizeof *expected);
    enum reuse found = BY_PROCESS;
    is_known = 1;
    trial = need(count, sizeof *trial);
    memcpy(expected, outputs, count * sizeof *expected);
    fmus.recorded = trial;
    for (int way = BY_RESET; way < BY_PROCESS && found == BY_PROCESS; way++) {
        if (untrusted & 1u << way || (way == BY_STATE && !fmus.saves_state))
            continue;
        announce(WAYS[way]);
        if (gives_again(way, expected))
            found = way;
    }
    free(trial);
    free(expected);
    trial = NULL;
    fmus.recorded = outputs;
    reuse = found;
}

const char *way_to_start(void)
{
    return WAYS[reuse];
}

/* Too many instances, too much memory, or nothing but a new process gives the same again. */
int is_spent(void)
{
    if (instances >= MOST_INSTANCES || reuse == BY_PROCESS)
        return 1;
    size_t size = most_memory_used();
    for (size_t k = 0; k < fmus.count; k++)
        size += fmus.components[k].exchange->memory;
    if (!first_size)
        first_size = size;
    return first_size && size > first_size + MOST_GROWTH_KIB;
}

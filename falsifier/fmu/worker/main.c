/* Runs one FMU: the process that may crash, hang or leak memory in place of the one that requests simulations.
 *
 * Requests arrive on standard input: their kind and length (4 bytes each), then what request.c reads. Replies
 * go to a pipe of their own: where the request stopped, FMI's status, the simulated time, and a text after its
 * length. Messages of the FMU come before the reply. Standard output and standard error belong to the FMU.
 * Parameters, inputs and outputs of simulations are in memory that both sides map.
 *
 * The end of the requests ends the process. */

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "platform.h"
#include "worker.h"

enum kind { CONNECT, LOAD, PREPARE, SIMULATE, RESET, TAKE, RESTORE, FORGET, RENEW };

#define MESSAGE_BYTES 4096

static struct fmu fmu;
static struct plan plan;
static jmp_buf end_of_request;
static double reached;

const char *failing = "";

static void reply(enum where where, unsigned status, double time, const char *text)
{
    static const char *const parts_of_statuses[] = {
        "ok: ", "warning: ", "discard: ", "error: ", "fatal: ", "pending: "};
    char prefix[32] = "";
    if (where == MESSAGE && status < 6)
        snprintf(prefix, sizeof prefix, "%s", parts_of_statuses[status]);
    else if (where == MESSAGE)
        snprintf(prefix, sizeof prefix, "status %d: ", (int)status);
    char message[24 + sizeof prefix + MESSAGE_BYTES];
    uint32_t head[] = {(uint32_t)where, status};
    size_t before = strlen(prefix), length = strlen(text);
    length = length > MESSAGE_BYTES ? MESSAGE_BYTES : length;
    uint32_t size = (uint32_t)(before + length);
    memcpy(message, head, 8);
    memcpy(message + 8, &time, 8);
    memcpy(message + 16, &size, 4);
    memcpy(message + 20, prefix, before);
    memcpy(message + 20 + before, text, length);
    if (!send_bytes(message, 20 + size))
        end_process(0);
}

void say(unsigned status, const char *text)
{
    reply(MESSAGE, status, 0.0, text);
}

/* End the request: the FMU cannot be used. */
void give_up(const char *format, ...)
{
    char text[MESSAGE_BYTES];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    reply(IMPOSSIBLE, 0, -1.0, text);
    longjmp(end_of_request, 1);
}

void *need(size_t count, size_t size)
{
    void *memory = calloc(count ? count : 1, size);
    if (!memory)
        give_up("not enough memory for the FMU and what surrounds it");
    return memory;
}

static void report_crash(unsigned code)
{
    reply(CRASHED, code, -1.0, "");
}

static void load(struct request *r)
{
    read_fmu(r, &fmu);
    const char *wrong = fmu_load(&fmu);
    if (wrong)
        give_up("the library cannot be loaded: %s", wrong);
    wrong = fmu_instantiate(&fmu);
    if (wrong)
        give_up("%s", wrong);
}

static void prepare(struct request *r)
{
    read_plan(r, &fmu, &plan);
    if (fmu.is_model_exchange)
        prepare_solver(&fmu, &plan);
}

static struct outcome simulate(double time_limit)
{
    struct event_info_1 first_events = {0};
    double deadline = now() + time_limit;
    struct inputs *both[] = {&plan.inputs, &plan.held};
    for (int k = 0; k < 2; k++)
        for (size_t j = 0; j < both[k]->ports.count; j++) {
            both[k]->current[j] = 0;
            both[k]->values[j] = 0.0;
        }
    reached = 0.0;
    struct outcome o = initialise(&fmu, &plan, &first_events);
    if (o.where != DONE)
        return o;
    failing = "";
    o = fmu.is_model_exchange ? solve(&fmu, &first_events, deadline, &reached)
                              : co_simulate(&fmu, &plan, deadline, &reached);
    if (o.where == DONE)
        terminate(&fmu);
    return o;
}

static void renew(void)
{
    fmu_free(&fmu);
    const char *wrong = fmu_instantiate(&fmu);
    if (wrong)
        give_up("%s", wrong);
}

static struct outcome answer(enum kind kind, struct request *r)
{
    const struct outcome done = {0, DONE}, refused = {0, REFUSED};
    switch (kind) {
    case CONNECT:
        if (!connect_replies(read_text(r)))
            end_process(2);
        return done;
    case LOAD: load(r); return done;
    case PREPARE: prepare(r); return done;
    case SIMULATE: return simulate(read_number(r));
    case RESET: return reset(&fmu) ? done : refused;
    case TAKE: return take_state(&fmu) ? done : refused;
    case RESTORE: return restore_state(&fmu) ? done : refused;
    case FORGET: forget_state(&fmu); return done;
    case RENEW: renew(); return done;
    }
    give_up("request %d is unknown", (int)kind);
}

int main(void)
{
    uint32_t head[2];
    start_platform(report_crash);
    while (receive_bytes(head, sizeof head)) {
        char *start = calloc(head[1] + 1, 1);
        struct request r = {start, start + head[1]};
        if (!start || !receive_bytes(r.at, head[1]))
            break;
        if (setjmp(end_of_request))
            continue;
        failing = "";
        reached = -1.0;
        struct outcome o = answer((enum kind)head[0], &r);
        reply(o.where, o.status, reached, failing);
        /* The other requests' contents are used later. */
        if (head[0] != LOAD && head[0] != PREPARE)
            free(start);
    }
    forget_state(&fmu);
    fmu_free(&fmu);
    return 0;
}

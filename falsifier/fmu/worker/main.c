/* Runs FMUs: the process that may crash, hang or leak memory in place of the one that requests simulations.
 *
 * Requests are their kind and length (4 bytes each), then what request.c reads. Replies are a mark, where the request
 * stopped, FMI's status, flags, the length of a text, the bytes printed so far (4 bytes each), the simulated time, and
 * that text. Standard output and standard error belong to the FMU, whose messages go there too. Parameters, inputs and
 * outputs of simulations are in memory that both sides map.
 *
 * The end of the requests ends the process. */

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "platform/platform.h"
#include "session.h"

enum kind { CONNECT, LOAD, PREPARE, SIMULATE };

#define MESSAGE_BYTES 4096
#define CUT_OFF 74 /* exit code: nobody can be replied to */
#define MARK 0x756d66f0u
#define MORE 1u    /* another reply follows without a request */
#define LEAVING 2u /* the process ends after this reply */
/* Waking up a process takes about 40 microseconds, which is a lot compared with a simulation shorter than this. */
#define QUICK_SECONDS 500e-6

jmp_buf end_of_request;
const char *failing = "";

static void reply(struct outcome outcome, unsigned flags, double time, const char *text)
{
    size_t length = strlen(text);
    length = length > MESSAGE_BYTES ? MESSAGE_BYTES : length;
    char message[32 + MESSAGE_BYTES];
    uint32_t head[] = {MARK, (uint32_t)outcome.where, outcome.status, flags, (uint32_t)length, printed()};
    memcpy(message, head, sizeof head);
    memcpy(message + sizeof head, &time, sizeof time);
    memcpy(message + 32, text, length);
    if (!send_bytes(message, 32 + length))
        end_process(CUT_OFF);
}

/* A message of the FMU, where it also prints. */
void say(unsigned status, const char *text)
{
    static const char *const names[] = {"ok", "warning", "discard", "error", "fatal", "pending"};
    char line[MESSAGE_BYTES + 64], number[32];
    snprintf(number, sizeof number, "status %d", (int)status);
    size_t length = strlen(text);
    while (length && strchr(" \t\r\n", text[length - 1]))
        length--;
    int size = snprintf(line, sizeof line, "%s: %.*s\n", status < 6 ? names[status] : number,
                        (int)(length > MESSAGE_BYTES ? MESSAGE_BYTES : length), text);
    print(line, (size_t)size);
}

/* End the request: the FMU cannot be used. */
void give_up(const char *format, ...)
{
    static char text[MESSAGE_BYTES];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    failing = text;
    longjmp(end_of_request, 1);
}

void *need(size_t count, size_t size)
{
    void *memory = calloc(count ? count : 1, size);
    if (!memory)
        give_up("not enough memory for the FMU and what surrounds it");
    return memory;
}

int is_late(struct progress *p, double time)
{
    p->header[SIMULATED] = time;
    if (++p->steps % STEPS_PER_CLOCK_CHECK)
        return 0;
    double at = now();
    if (time >= p->next) {
        p->deadline = at + p->limit;
        p->next = time + p->share;
    }
    return at > p->deadline;
}

static void report_crash(unsigned code)
{
    reply((struct outcome){code, CRASHED}, 0, -1.0, "");
}

static void announce(const char *way)
{
    reply(done, MORE, -1.0, way);
}

/* Returns whether the process goes on. */
static int simulate(struct request *r)
{
    double started = now(), limit = read_number(r), reached;
    struct outcome o = simulate_again(limit, (unsigned)read_size(r), &reached);
    int is_quick = now() - started < QUICK_SECONDS;
    int is_done = o.where == DONE, is_tested = is_done && awaits_test();
    int ends = is_done && !is_tested && is_spent();
    reply(o, (is_tested ? MORE : 0) | (ends ? LEAVING : 0), reached, failing);
    if (is_tested) {
        find_reuse(announce);
        ends = is_spent();
        reply(done, ends ? LEAVING : 0, -1.0, way_to_start());
    }
    if (is_quick && !ends)
        watch_requests(QUICK_SECONDS);
    return !ends;
}

static int answer(enum kind kind, struct request *r)
{
    failing = "";
    switch (kind) {
    case CONNECT:
        if (!settle(read_text(r)))
            end_process(CUT_OFF);
        break;
    case LOAD: start_session(r); break;
    case PREPARE: prepare_session(*r); break;
    case SIMULATE: return simulate(r);
    default: give_up("request %d is unknown", (int)kind);
    }
    reply(done, 0, -1.0, "");
    return 1;
}

int main(void)
{
    uint32_t head[2];
    start_platform(report_crash);
    for (int goes_on = 1; goes_on && receive_bytes(head, sizeof head);) {
        char *start = calloc((size_t)head[1] + 1, 1);
        struct request r = {start, start + head[1]};
        if (!start || !receive_bytes(r.at, head[1]))
            break;
        /* Of a request that ends early nothing is freed, and of others what they contain is used later. */
        if (setjmp(end_of_request)) {
            reply((struct outcome){0, IMPOSSIBLE}, 0, -1.0, failing);
            continue;
        }
        goes_on = answer((enum kind)head[0], &r);
        if (head[0] == SIMULATE)
            free(start);
    }
    /* Nothing is tidied up, because FMUs may crash when they are unloaded. */
    end_process(0);
}

/* The process that watches the one in which an FMU runs.
 *
 * It starts that process, confines it, and stays outside. When the process ends, it kills all that descends from
 * it, whatever group it is in, and ends in the same way. When the line to its own parent closes, it kills
 * everything at once. It tells on the line what was refused: see enum told.
 *
 * The line is descriptor 5. The policy arrives there: 4 bytes with its length, then texts that end with a NUL, each
 * after a letter. */

#define _GNU_SOURCE
#define _DARWIN_C_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "platform/sandbox.h"

enum { LINE = 5, MOST_BYTES = 1 << 20, MOST_TOLD = 32, MOST_FILES = 4096, TICK_MS = 100, CANNOT_START = 71 };

static volatile sig_atomic_t is_told_to_end;
static int wakes[2];

static void wake_up(int number)
{
    const int before = errno;
    if (number == SIGTERM)
        is_told_to_end = 1;
    if (write(wakes[1], "", 1) < 0) {
        /* enough of them are waiting */
    }
    errno = before;
}

/* Each thing is told once, and what ended the process also after much that was refused. */
void tell(enum told what, const char *path)
{
    static char *told[MOST_TOLD + 2];
    static size_t count;
    const size_t most = what == REPLACE || what == MEMORY ? MOST_TOLD + 2 : MOST_TOLD;
    char *text = count < most ? malloc(strlen(path) + 2) : NULL;
    if (!text)
        return;
    text[0] = (char)what;
    strcpy(text + 1, path);
    for (size_t k = 0; k < count; k++)
        if (!strcmp(told[k], text)) {
            free(text);
            return;
        }
    told[count++] = text;
    send(LINE, text, strlen(text) + 1, MSG_DONTWAIT);
}

int read_exactly(int from, void *target, size_t count)
{
    for (char *at = target; count;) {
        ssize_t some = read(from, at, count);
        if (some < 0 && errno == EINTR)
            continue;
        if (some <= 0)
            return 0;
        at += some;
        count -= (size_t)some;
    }
    return 1;
}

/* The texts that begin with a letter, without it. */
static const char **texts(const char *from, const char *end, char letter)
{
    size_t count = 0;
    for (const char *at = from; at < end; at += strlen(at) + 1)
        count += *at == letter;
    const char **found = calloc(count + 1, sizeof *found);
    if (!found)
        _exit(CANNOT_START);
    count = 0;
    for (const char *at = from; at < end; at += strlen(at) + 1)
        if (*at == letter)
            found[count++] = at + 1;
    return found;
}

static struct policy receive_policy(void)
{
    uint32_t length;
    if (!read_exactly(LINE, &length, sizeof length) || length > MOST_BYTES)
        _exit(CANNOT_START);
    char *text = calloc(length + 1, 1);
    if (!text || !read_exactly(LINE, text, length))
        _exit(CANNOT_START);
    const char *end = text + length, **memory = texts(text, end, 'M');
    struct policy policy = {
        .writable = texts(text, end, 'W'),
        .hidden = texts(text, end, 'H'),
        .readable = texts(text, end, 'R'),
        .command = texts(text, end, 'C'),
        .programs = *texts(text, end, 'P') != NULL,
        .network = *texts(text, end, 'N') != NULL,
        .is_wine = *texts(text, end, 'I') != NULL,
        .memory = *memory ? strtoull(*memory, NULL, 10) : 0,
    };
    if (!*policy.writable)
        _exit(CANNOT_START);
    return policy;
}

static void limit(int resource, rlim_t most)
{
    struct rlimit now;
    if (getrlimit(resource, &now))
        return;
    if (now.rlim_max == RLIM_INFINITY || now.rlim_max > most)
        now.rlim_max = most;
    if (now.rlim_cur == RLIM_INFINITY || now.rlim_cur > now.rlim_max)
        now.rlim_cur = now.rlim_max;
    setrlimit(resource, &now);
}

/* RLIMIT_DATA counts what is allocated, not the address space that runtimes merely reserve, as RLIMIT_AS would. It
 * does not count shared memory, which the guard looks at. A file may need no more than the memory: it may be in it. */
static void limit_resources(const struct policy *policy)
{
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_NOFILE, MOST_FILES); /* sockets hold memory that belongs to no process */
    if (!policy->memory)
        return;
    limit(RLIMIT_FSIZE, (rlim_t)policy->memory);
    signal(SIGXFSZ, SIG_IGN); /* writing fails instead */
#ifdef __linux__
    limit(RLIMIT_DATA, (rlim_t)policy->memory);
#endif
}

/* One message with what is enforced, and the descriptor if there is one. */
struct handover {
    struct msghdr message;
    struct iovec part;
    unsigned enforced;
    union {
        struct cmsghdr header;
        char space[CMSG_SPACE(sizeof(int))];
    } control;
};

static void make_handover(struct handover *h)
{
    memset(h, 0, sizeof *h);
    h->part.iov_base = &h->enforced;
    h->part.iov_len = sizeof h->enforced;
    h->message.msg_iov = &h->part;
    h->message.msg_iovlen = 1;
    h->message.msg_control = h->control.space;
    h->message.msg_controllen = sizeof h->control.space;
}

static void hand_over(int sock, unsigned enforced, int listener)
{
    struct handover h;
    make_handover(&h);
    h.enforced = enforced;
    if (listener < 0) {
        h.message.msg_controllen = 0;
    } else {
        struct cmsghdr *c = CMSG_FIRSTHDR(&h.message);
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(sizeof listener);
        memcpy(CMSG_DATA(c), &listener, sizeof listener);
    }
    sendmsg(sock, &h.message, 0);
}

static unsigned take_over(int sock, int *listener)
{
    struct handover h;
    make_handover(&h);
    *listener = -1;
    if (recvmsg(sock, &h.message, 0) != (ssize_t)sizeof h.enforced)
        return 0; /* the process has ended, which is noticed next */
    struct cmsghdr *c = CMSG_FIRSTHDR(&h.message);
    if (c && c->cmsg_type == SCM_RIGHTS)
        memcpy(listener, CMSG_DATA(c), sizeof *listener);
    return h.enforced;
}

static void set_up_worker(const struct policy *policy, pid_t guard, int sock)
{
    int listener;
    close(LINE);
    setsid();
    end_with_parent(guard);
    if (chdir(policy->writable[0]))
        _exit(CANNOT_START);
    limit_resources(policy);
    unsigned enforced = confine(policy, &listener);
    hand_over(sock, enforced, listener);
    close(sock);
    if (listener >= 0)
        close(listener);
    if (*policy->command) {
        execv(policy->command[0], (char **)policy->command);
        _exit(CANNOT_START);
    }
}

/* Processes cannot start others meanwhile where the system asks the guard for permission, because it does not answer:
 * so this ends. Elsewhere it ends after a time. */
static void end_descendants(pid_t worker, int *status)
{
    const struct timespec moment = {0, 200000};
    for (int tries = 0; tries < 10000; tries++) {
        int code;
        pid_t pid = waitpid(-1, &code, WNOHANG);
        if (pid < 0 && errno == ECHILD)
            return;
        if (pid == worker)
            *status = code;
        if (pid > 0)
            continue;
        kill_children(worker);
        nanosleep(&moment, NULL);
    }
}

void end_like(int status)
{
    if (WIFSIGNALED(status)) {
        limit(RLIMIT_CORE, 0);
        signal(WTERMSIG(status), SIG_DFL);
        kill(getpid(), WTERMSIG(status));
    }
    _exit(WEXITSTATUS(status));
}

/* Whether the worker has ended; its status. Children that it has left end without further notice. */
static int has_ended(pid_t worker, int *status)
{
    int code;
    for (pid_t pid; (pid = waitpid(-1, &code, WNOHANG)) > 0;)
        if (pid == worker) {
            *status = code;
            return 1;
        }
    return 0;
}

static int watch(const struct policy *policy, pid_t worker, int listener, unsigned enforced)
{
    struct timespec last = {0}, at;
    char seen[64];
    for (;;) {
        int status = 0;
        if (has_ended(worker, &status))
            return status;
        struct pollfd waiting[] = {{LINE, 0, 0}, {wakes[0], POLLIN, 0}, {listener, POLLIN, 0}};
        int found = poll(waiting, 3, TICK_MS);
        if (is_told_to_end || (found > 0 && waiting[0].revents)) {
            kill(worker, SIGKILL);
            return SIGKILL;
        }
        if (found > 0 && waiting[1].revents && read(wakes[0], seen, sizeof seen) < 0)
            continue;
        if (found > 0 && waiting[2].revents & POLLIN)
            answer_call(listener, policy, enforced, worker);
        else if (found > 0 && waiting[2].revents)
            listener = -1; /* all that it was for have ended */
        clock_gettime(CLOCK_MONOTONIC, &at);
        if ((at.tv_sec - last.tv_sec) * 1000 + (at.tv_nsec - last.tv_nsec) / 1000000 < TICK_MS)
            continue;
        last = at;
        if (policy->memory && memory_used(worker, enforced) > policy->memory) {
            tell(MEMORY, "");
            kill(worker, SIGKILL);
        }
    }
}

static void catch_signals(void)
{
    struct sigaction action = {.sa_handler = wake_up};
    if (pipe(wakes))
        _exit(CANNOT_START);
    for (int k = 0; k < 2; k++)
        fcntl(wakes[k], F_SETFL, O_NONBLOCK);
    sigaction(SIGCHLD, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

void start_guarded(void)
{
    int socks[2], listener;
    if (fcntl(LINE, F_GETFD) < 0)
        return;
    struct policy policy = receive_policy();
    adopt_orphans();
    signal(SIGINT, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, socks))
        _exit(CANNOT_START);
    pid_t guard = getpid(), worker = fork();
    if (worker < 0)
        _exit(CANNOT_START);
    if (!worker) {
        close(socks[0]);
        set_up_worker(&policy, guard, socks[1]);
        return;
    }
    close(socks[1]);
    unsigned enforced = take_over(socks[0], &listener);
    close(socks[0]);
    for (int k = 0; k < LINE; k++)
        if (k != listener)
            close(k);
    catch_signals();
    tell(ENFORCED, (const char[]){(char)('0' + enforced), 0});
    int status = watch(&policy, worker, listener, enforced);
    end_descendants(worker, &status);
    end_like(status);
}

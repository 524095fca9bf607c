/* Linux and macOS. Descriptor 0 has the requests, 3 is for the replies, 4 is the memory of simulations. */

#define _DEFAULT_SOURCE
#define _DARWIN_C_SOURCE

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/syscall.h>
#endif

#include "platform/platform.h"
#include "platform/sandbox.h"

enum { REPLIES = 3, ROOM = 4, LINE = 5, LAST = LINE };

/* A copy of descriptor 0, so that the FMU does not read requests from its standard input. */
static int requests;
static struct stat replies;
static char working_folder[4096];

/* Descriptors of the parent that it did not mean to pass on. */
static void close_others(void)
{
#if defined(__linux__) && defined(SYS_close_range)
    if (!syscall(SYS_close_range, LAST + 1, ~0u, 0))
        return;
#endif
    long most = sysconf(_SC_OPEN_MAX);
    for (int descriptor = LAST + 1; descriptor < (most > 65536 ? 65536 : most); descriptor++)
        close(descriptor);
}

/* Its exit status tells what ended a process; no report is needed. Returns in the process that runs the FMU. */
void start_platform(void (*report)(unsigned code))
{
    (void)report;
    close_others();
    start_guarded();
    requests = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, LAST + 1);
    int nothing = open("/dev/null", O_RDONLY);
    if (nothing > 0 && nothing != STDIN_FILENO) {
        dup2(nothing, STDIN_FILENO);
        close(nothing);
    }
    fstat(REPLIES, &replies);
    /* Programs that the FMU starts do not get the others. */
    for (int descriptor = REPLIES; descriptor <= LAST; descriptor++)
        fcntl(descriptor, F_SETFD, FD_CLOEXEC);
    signal(SIGPIPE, SIG_IGN);
    /* What the FMU printed before a crash must not be lost. */
    setvbuf(stdout, NULL, _IOLBF, 0);
}

void end_process(int code)
{
    _exit(code);
}

double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

int settle(const char *replies)
{
    (void)replies;
    return getcwd(working_folder, sizeof working_folder) != NULL;
}

void return_to_folder(void)
{
    if (chdir(working_folder)) {
        /* it has been removed */
    }
}

size_t most_memory_used(void)
{
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
#ifdef __APPLE__
    return (size_t)used.ru_maxrss >> 10;
#else
    return (size_t)used.ru_maxrss;
#endif
}

int receive_bytes(void *target, size_t count)
{
    return read_exactly(requests, target, count);
}

void watch_requests(double seconds)
{
    struct pollfd waiting = {requests, POLLIN, 0};
    for (double end = now() + seconds; now() < end && !poll(&waiting, 1, 0);)
        sched_yield();
}

static int write_all(int target, const char *at, size_t count)
{
    while (count) {
        ssize_t some = write(target, at, count);
        if (some < 0 && errno == EINTR)
            continue;
        if (some <= 0)
            return 0;
        at += some;
        count -= (size_t)some;
    }
    return 1;
}

int send_bytes(const void *source, size_t count)
{
    struct stat now;
    /* The FMU may have put something else in its place. */
    if (fstat(REPLIES, &now) || now.st_ino != replies.st_ino || now.st_dev != replies.st_dev)
        return 0;
    return write_all(REPLIES, source, count);
}

void print(const char *text, size_t count)
{
    write_all(STDOUT_FILENO, text, count);
}

unsigned printed(void)
{
    fflush(stdout);
    off_t position = lseek(STDOUT_FILENO, 0, SEEK_CUR);
    return position > 0 ? (unsigned)position : 0;
}

static struct {
    void *memory;
    size_t bytes;
} room;

double *map_room(const char *place)
{
    struct stat about;
    (void)place;
    if (room.memory)
        munmap(room.memory, room.bytes);
    room.memory = NULL;
    if (fstat(ROOM, &about) || about.st_size <= 0)
        return NULL;
    room.bytes = (size_t)about.st_size;
    void *mapped = mmap(NULL, room.bytes, PROT_READ | PROT_WRITE, MAP_SHARED, ROOM, 0);
    room.memory = mapped == MAP_FAILED ? NULL : mapped;
    return room.memory;
}

void *guarded_memory(size_t bytes)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE), usable = (bytes + page - 1) / page * page;
    char *memory = mmap(NULL, usable + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED)
        return NULL;
    mprotect(memory + usable, page, PROT_NONE);
    return memory + usable - bytes;
}

/* The new process has the FMU's output, but neither the requests nor the replies and the memory for others. */
long split_process(void)
{
    pid_t id = fork();
    if (id)
        return id;
    close(requests);
    close(REPLIES);
    close(ROOM);
    if (room.memory)
        munmap(room.memory, room.bytes);
    return 0;
}

void *load_library(const char *path, const char **wrong)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        *wrong = dlerror();
    return library;
}

void unload_library(void *library)
{
    dlclose(library);
}

void *find_symbol(void *library, const char *name)
{
    return dlsym(library, name);
}

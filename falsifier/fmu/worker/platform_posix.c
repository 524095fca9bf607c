/* Linux and macOS. Descriptor 0 has the requests, 3 is for the replies, 4 is the memory of simulations. */

#define _DEFAULT_SOURCE
#define _DARWIN_C_SOURCE

#include <dlfcn.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "platform.h"

enum { REQUESTS = 0, REPLIES = 3, ROOM = 4 };

/* Its exit status tells what ended a process; no report is needed. */
void start_platform(void (*report)(unsigned code))
{
    (void)report;
    signal(SIGPIPE, SIG_IGN);
    /* What the FMU printed before a crash must not be lost. */
    setvbuf(stdout, NULL, _IONBF, 0);
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

int connect_replies(const char *place)
{
    (void)place;
    return 1;
}

int receive_bytes(void *target, size_t count)
{
    for (char *at = target; count;) {
        ssize_t some = read(REQUESTS, at, count);
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
    for (const char *at = source; count;) {
        ssize_t some = write(REPLIES, at, count);
        if (some < 0 && errno == EINTR)
            continue;
        if (some <= 0)
            return 0;
        at += some;
        count -= (size_t)some;
    }
    return 1;
}

double *map_room(const char *place)
{
    static void *last;
    static size_t size;
    struct stat room;
    (void)place;
    if (last)
        munmap(last, size);
    last = NULL;
    if (fstat(ROOM, &room) || room.st_size <= 0)
        return NULL;
    size = (size_t)room.st_size;
    void *mapped = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, ROOM, 0);
    last = mapped == MAP_FAILED ? NULL : mapped;
    return last;
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

void *load_library(const char *path, const char **wrong)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        *wrong = dlerror();
    return library;
}

void *find_symbol(void *library, const char *name)
{
    return dlsym(library, name);
}

/* What the operating systems do differently: posix.c and windows.c. */

#ifndef PLATFORM_H
#define PLATFORM_H

#include <stddef.h>

/* Prepare the process; report is called, where the system cannot tell it, with the number of what crashed it. */
void start_platform(void (*report)(unsigned code));
void end_process(int code) __attribute__((noreturn));
double now(void); /* in s, from some start */

/* Get ready for the FMU: where replies go, if not to a descriptor that the process got. Returns 0 if that fails. */
int settle(const char *replies);
void return_to_folder(void);   /* the working folder */
size_t most_memory_used(void); /* in KiB */

/* The connection: requests, replies, and the output that the FMU shares. */
int receive_bytes(void *target, size_t count); /* returns 0 at the end of the requests */
void watch_requests(double seconds); /* polls for the next one for so long */
void print(const char *text, size_t count);
unsigned printed(void); /* position in the output */
int send_bytes(const void *source, size_t count); /* returns 0 if nobody reads them */

/* Map the memory of simulations in place of what was mapped before; NULL if that fails. */
double *map_room(const char *place);

/* Zeroed memory that ends where accessible memory ends; NULL if there is not enough. */
void *guarded_memory(size_t bytes);

long split_process(void); /* without the connection; returns 0 in the new process, -1 if there is none */

/* Load a library with those beside it; says what is wrong if that fails. */
void *load_library(const char *path, const char **wrong);
void unload_library(void *library);
void *find_symbol(void *library, const char *name);

#endif

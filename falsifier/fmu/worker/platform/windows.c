/* Windows, also as Wine offers it. Requests come from standard input, replies go to a named pipe or file. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>
#include <psapi.h>

#include "platform/platform.h"
#include "system/system.h"

#define LONGEST_PATH 4096

static HANDLE requests, replies;
static wchar_t working_folder[LONGEST_PATH];
static void (*report_crash)(unsigned code);

static LONG WINAPI on_crash(EXCEPTION_POINTERS *crash)
{
    unsigned code = crash->ExceptionRecord->ExceptionCode;
    report_crash(code);
    TerminateProcess(GetCurrentProcess(), code);
    return EXCEPTION_EXECUTE_HANDLER;
}

void start_platform(void (*report)(unsigned code))
{
    requests = GetStdHandle(STD_INPUT_HANDLE);
    report_crash = report;
    SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX | SEM_NOOPENFILEERRORBOX);
    SetUnhandledExceptionFilter(on_crash);
    /* What the FMU printed before a crash must not be lost. */
    setvbuf(stdout, NULL, _IONBF, 0);
}

void end_process(int code)
{
    ExitProcess((UINT)code);
}

double now(void)
{
    static LARGE_INTEGER frequency;
    LARGE_INTEGER ticks;
    if (!frequency.QuadPart)
        QueryPerformanceFrequency(&frequency);
    QueryPerformanceCounter(&ticks);
    return (double)ticks.QuadPart / (double)frequency.QuadPart;
}

static int widen(const char *path, wchar_t wide[LONGEST_PATH])
{
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, LONGEST_PATH);
}

int settle(const char *place)
{
    wchar_t path[LONGEST_PATH];
    if (!GetCurrentDirectoryW(LONGEST_PATH, working_folder))
        return 0;
    if (!widen(place, path))
        return 0;
    replies = CreateFileW(path, GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_WRITE, NULL, OPEN_EXISTING, 0, NULL);
    return replies != INVALID_HANDLE_VALUE;
}

void return_to_folder(void)
{
    SetCurrentDirectoryW(working_folder);
}

size_t most_memory_used(void)
{
    PROCESS_MEMORY_COUNTERS used = {.cb = sizeof used};
    GetProcessMemoryInfo(GetCurrentProcess(), &used, sizeof used);
    return used.PeakWorkingSetSize >> 10;
}

int receive_bytes(void *target, size_t count)
{
    for (char *at = target; count;) {
        DWORD some = 0;
        if (!ReadFile(requests, at, (DWORD)count, &some, NULL) || !some)
            return 0;
        at += some;
        count -= some;
    }
    return 1;
}

/* Nothing tells whether a pipe has bytes without a switch between processes, so there is nothing to save. */
void watch_requests(double seconds)
{
    (void)seconds;
}

void print(const char *text, size_t count)
{
    DWORD written;
    WriteFile(GetStdHandle(STD_OUTPUT_HANDLE), text, (DWORD)count, &written, NULL);
}

unsigned printed(void)
{
    DWORD position = SetFilePointer(GetStdHandle(STD_OUTPUT_HANDLE), 0, NULL, FILE_CURRENT);
    return position == INVALID_SET_FILE_POINTER ? 0 : position;
}

int send_bytes(const void *source, size_t count)
{
    DWORD written;
    return WriteFile(replies, source, (DWORD)count, &written, NULL) != 0;
}

double *map_room(const char *place)
{
    static void *last;
    wchar_t path[LONGEST_PATH];
    if (last)
        UnmapViewOfFile(last);
    last = NULL;
    if (!*place || !widen(place, path))
        return NULL;
    HANDLE file = CreateFileW(path, GENERIC_READ | GENERIC_WRITE, FILE_SHARE_READ | FILE_SHARE_WRITE, NULL,
                              OPEN_EXISTING, 0, NULL);
    HANDLE mapping = CreateFileMappingW(file, NULL, PAGE_READWRITE, 0, 0, NULL);
    last = mapping ? MapViewOfFile(mapping, FILE_MAP_WRITE, 0, 0, 0) : NULL;
    if (mapping)
        CloseHandle(mapping);
    if (file != INVALID_HANDLE_VALUE)
        CloseHandle(file);
    return last;
}

void *guarded_memory(size_t bytes)
{
    SYSTEM_INFO system;
    GetSystemInfo(&system);
    size_t page = system.dwPageSize, usable = (bytes + page - 1) / page * page;
    char *memory = VirtualAlloc(NULL, usable + page, MEM_COMMIT | MEM_RESERVE, PAGE_READWRITE);
    DWORD before;
    if (!memory)
        return NULL;
    VirtualProtect(memory + usable, page, PAGE_NOACCESS, &before);
    return memory + usable - bytes;
}

/* Components of a system do not run here: there are no processes for them. */
void start_process(struct component *c)
{
    (void)c;
    give_up("components cannot have processes of their own here");
}

struct outcome ask_process(struct component *c)
{
    (void)c;
    return done;
}

void end_process_of(struct component *c)
{
    (void)c;
}

void send_plan(struct component *c, const struct request *r)
{
    (void)c, (void)r;
}

double *shared_numbers(struct component *c, size_t count)
{
    (void)c, (void)count;
    return NULL;
}

void *load_library(const char *path, const char **wrong)
{
    static char text[64];
    wchar_t wide[LONGEST_PATH];
    if (!widen(path, wide)) {
        *wrong = "its path is too long";
        return NULL;
    }
    /* The folder of the library is searched for the libraries that it needs. */
    void *library = LoadLibraryExW(wide, NULL, LOAD_WITH_ALTERED_SEARCH_PATH);
    DWORD code = GetLastError();
    snprintf(text, sizeof text, "Windows error %lu", code);
    if (!library && code == ERROR_MOD_NOT_FOUND)
        *wrong = "it needs a library that is neither beside it nor part of Wine";
    else if (!library && code == ERROR_BAD_EXE_FORMAT)
        *wrong = "it is not a 64-bit library, or it is damaged";
    else if (!library)
        *wrong = text;
    return library;
}

void unload_library(void *library)
{
    FreeLibrary(library);
}

void *find_symbol(void *library, const char *name)
{
    return (void *)(uintptr_t)GetProcAddress(library, name);
}

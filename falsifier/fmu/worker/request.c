/* What requests contain: numbers of 8 bytes and, padded to a multiple of 8, bytes after their number.
 *
 * Texts end with a NUL. Values point into the request, which is therefore never freed; plans are few. */

#include <stdio.h>
#include <string.h>

#include "platform/platform.h"
#include "worker.h"

static void *read_bytes(struct request *r, size_t count)
{
    char *at = r->at;
    size_t padded = (count + 7) / 8 * 8;
    if ((size_t)(r->end - at) < padded)
        give_up("a request of this tool is incomplete");
    r->at += padded;
    return at;
}

size_t read_size(struct request *r)
{
    return (size_t) * (uint64_t *)read_bytes(r, 8);
}

double read_number(struct request *r)
{
    return *(double *)read_bytes(r, 8);
}

static void *read_block(struct request *r, size_t *size)
{
    *size = read_size(r);
    return read_bytes(r, *size);
}

char *read_text(struct request *r)
{
    size_t size;
    return read_block(r, &size);
}

void read_fmu(struct request *r, struct fmu *fmu)
{
    memset(fmu, 0, sizeof *fmu);
    fmu->major = (int)read_size(r);
    fmu->is_model_exchange = (int)read_size(r);
    fmu->logging = (int)read_size(r);
    fmu->event_mode = (int)read_size(r);
    fmu->saves_state = (int)read_size(r);
    fmu->states = read_size(r);
    fmu->indicators = read_size(r);
    fmu->library = read_text(r);
    fmu->identifier = read_text(r);
    fmu->name = read_text(r);
    fmu->token = read_text(r);
    fmu->resources = read_text(r);
}

static void read_place(struct request *r, const struct ports *ports, struct place *place)
{
    place->storage = (int)read_size(r);
    const struct call *c = &ports->calls[read_size(r)];
    place->address = (char *)c->values + read_size(r);
    place->sign = read_number(r);
    place->is_boolean = (int)read_size(r);
}

/* The functions of an FMU that another process has loaded are NULL here. */
void read_ports(struct request *r, const struct fmu *fmu, const char *verb, struct ports *ports)
{
    ports->call_count = read_size(r);
    ports->calls = need(ports->call_count, sizeof *ports->calls);
    for (size_t g = 0; g < ports->call_count; g++) {
        struct call *c = &ports->calls[g];
        char name[32];
        const char *code = read_text(r);
        size_t bytes;
        snprintf(name, sizeof name, "%s%s", verb, code);
        c->function = fmu->module ? fmu_function(fmu, name) : NULL;
        if (fmu->module && !c->function)
            give_up("the library does not export the function for values of type %s", code);
        c->references = read_block(r, &bytes);
        c->count = bytes / sizeof *c->references;
        c->size = read_size(r);
        c->values = read_block(r, &bytes);
    }
    ports->count = read_size(r);
    ports->places = need(ports->count, sizeof *ports->places);
    for (size_t j = 0; j < ports->count; j++)
        read_place(r, ports, &ports->places[j]);
}

void read_inputs(struct request *r, const struct fmu *fmu, size_t pieces, struct inputs *inputs)
{
    read_ports(r, fmu, "Set", &inputs->ports);
    inputs->pieces = pieces;
    inputs->rows = need(inputs->ports.count, sizeof *inputs->rows);
    inputs->current = need(inputs->ports.count, sizeof *inputs->current);
    inputs->fixed_count = read_size(r);
    inputs->fixed = need(inputs->fixed_count, sizeof *inputs->fixed);
    inputs->fixed_rows = need(inputs->fixed_count, sizeof *inputs->fixed_rows);
    for (size_t k = 0; k < inputs->fixed_count; k++) {
        read_place(r, &inputs->ports, &inputs->fixed[k]);
        inputs->fixed_rows[k] = read_size(r);
    }
}

void read_strings(struct request *r, struct plan *plan)
{
    plan->strings_count = read_size(r);
    plan->strings = need(plan->strings_count, sizeof *plan->strings);
    for (size_t k = 0; k < plan->strings_count; k++) {
        plan->strings[k].reference = (uint32_t)read_size(r);
        plan->strings[k].text = read_text(r);
    }
}

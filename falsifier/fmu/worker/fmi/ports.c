/* Many variables of an FMU at once, whatever their types, and inputs as functions of time. */

#include <math.h>

#include "worker.h"

typedef unsigned (*values_2)(void *, const uint32_t *, size_t, void *);
typedef unsigned (*values_3)(void *, const uint32_t *, size_t, void *, size_t);

/* The number at a variable's location. */
static double fetch(const struct place *place)
{
    double value;
    switch (place->storage) {
    case 0: return *(double *)place->address * place->sign;
    case 1: value = *(float *)place->address; break;
    case 2: value = *(int8_t *)place->address; break;
    case 3: value = *(uint8_t *)place->address; break;
    case 4: value = *(int16_t *)place->address; break;
    case 5: value = *(uint16_t *)place->address; break;
    case 6: value = *(int32_t *)place->address; break;
    case 7: value = *(uint32_t *)place->address; break;
    case 8: value = (double)*(int64_t *)place->address; break;
    default: value = (double)*(uint64_t *)place->address; break;
    }
    /* Any non-zero value is true; the negated alias of a Boolean is its complement. */
    if (place->is_boolean)
        return (value != 0.0) == (place->sign > 0.0);
    return value * place->sign;
}

/* By storage; of 64 bits, the numbers next to those that do not fit. */
static const double least[] = {0, 0, INT8_MIN, 0, INT16_MIN, 0, INT32_MIN, 0, -0x1p63, 0};
static const double most[] = {0,          0,         INT8_MAX,   UINT8_MAX,        INT16_MAX,
                              UINT16_MAX, INT32_MAX, UINT32_MAX, 0x1.fffffffffffffp62, 0x1.fffffffffffffp63};

/* Write a number to a variable's location; integers and Booleans are rounded, to a number that the location can hold. */
void put(const struct place *place, double number)
{
    double value = number * place->sign;
    if (place->storage == 0) {
        *(double *)place->address = value;
        return;
    }
    if (place->is_boolean)
        value = (number >= 0.5) == (place->sign > 0.0);
    if (place->storage == 1) {
        *(float *)place->address = (float)value;
        return;
    }
    value = fmin(fmax(rint(value), least[place->storage]), most[place->storage]);
    switch (place->storage) {
    case 2: *(int8_t *)place->address = (int8_t)value; break;
    case 3: *(uint8_t *)place->address = (uint8_t)value; break;
    case 4: *(int16_t *)place->address = (int16_t)value; break;
    case 5: *(uint16_t *)place->address = (uint16_t)value; break;
    case 6: *(int32_t *)place->address = (int32_t)value; break;
    case 7: *(uint32_t *)place->address = (uint32_t)value; break;
    case 8: *(int64_t *)place->address = (int64_t)value; break;
    default: *(uint64_t *)place->address = (uint64_t)value; break;
    }
}

/* Make the calls; stop at the first status worse than a warning. */
unsigned exchange_values(const struct fmu *fmu, const struct ports *ports)
{
    unsigned worst = 0;
    for (size_t g = 0; g < ports->call_count; g++) {
        const struct call *c = &ports->calls[g];
        unsigned status =
            fmu->major == 3
                ? ((values_3)c->function)(fmu->instance, c->references, c->count, c->values, c->size)
                : ((values_2)c->function)(fmu->instance, c->references, c->count, c->values);
        worst = status > worst ? status : worst;
        if (status > 1)
            break;
    }
    return worst;
}

/* Get all variables; the distance between two numbers is stride. */
unsigned read_values(const struct fmu *fmu, const struct ports *ports, double *numbers, size_t stride)
{
    unsigned status = exchange_values(fmu, ports);
    if (status <= 1)
        for (size_t j = 0; j < ports->count; j++)
            numbers[j * stride] = fetch(&ports->places[j]);
    return status;
}

unsigned write_row(const struct fmu *fmu, const struct ports *ports, const double *numbers)
{
    for (size_t j = 0; j < ports->count; j++)
        put(&ports->places[j], numbers[j]);
    return exchange_values(fmu, ports);
}

/* The difference in s below which two times are considered equal. */
double rounding(double time)
{
    return 1e-11 * fmax(1.0, fabs(time));
}

/* The value of a piece at a time within it or at its end. */
double piece_at(const struct piece *p, double time)
{
    double dt = time - p->start;
    return ((p->c[3] * dt + p->c[2]) * dt + p->c[1]) * dt + p->c[0];
}

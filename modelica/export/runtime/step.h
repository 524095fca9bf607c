/* One step of an integration method. explicit.h and implicit.h define the functions; integrate.c includes one of them,
 * because the compiler can then inline them. */
#ifndef STEP_H
#define STEP_H

#include "model.h"

#define N MODEL_STATES

typedef struct {
    double t, h;
    double y0[N + 1], y1[N + 1];
    double k[7][N + 1];      /* slopes; the first belongs to y0, the last to y1 */
    double bend[N + 1], twist[N + 1], dense[N + 1]; /* coefficients of the continuous extension */
    int extended;                                   /* whether these coefficients are computed */
} Step;

static void step_stages(Model *m, Step *s);          /* from y0 to y1; fills k except for the last slope */
static double step_error(const Step *s, int state);  /* estimated error of y1; needs all slopes */
static void step_extend(Step *s);                    /* computes the coefficients of the continuous extension */
static void step_evaluate(Model *m, double t, const double *y, double *slopes);

#endif

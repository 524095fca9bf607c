/* The Dormand-Prince pair 5(4). Coefficients: Dormand, Prince (1980) and Hairer, Norsett, Wanner, Solving Ordinary
 * Differential Equations I, sections II.5 and II.6.
 */
#include "step.h"

#define STEP_ORDER 5 /* the estimated error grows with this power of the step size */

static void step_stages(Model *m, Step *s) {
    static const double a[6][5] = {
        {0},
        {1.0 / 5},
        {3.0 / 40, 9.0 / 40},
        {44.0 / 45, -56.0 / 15, 32.0 / 9},
        {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
        {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656}};
    static const double c[6] = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1};
    double y[N + 1];
    events_evaluate(m);
    memcpy(s->k[0], m->r + N, N * sizeof(double));
    for (int stage = 1; stage < 6; stage++) {
        for (int j = 0; j < N; j++) {
            double sum = 0;
            for (int l = 0; l < stage; l++) sum += a[stage][l] * s->k[l][j];
            y[j] = s->y0[j] + s->h * sum;
        }
        step_evaluate(m, s->t + c[stage] * s->h, y, s->k[stage]);
    }
    for (int j = 0; j < N; j++)
        s->y1[j] = s->y0[j] + s->h * (35.0 / 384 * s->k[0][j] + 500.0 / 1113 * s->k[2][j] + 125.0 / 192 * s->k[3][j] -
                                      2187.0 / 6784 * s->k[4][j] + 11.0 / 84 * s->k[5][j]);
}

static double step_error(const Step *s, int j) {
    return s->h * (71.0 / 57600 * s->k[0][j] - 71.0 / 16695 * s->k[2][j] + 71.0 / 1920 * s->k[3][j] -
                   17253.0 / 339200 * s->k[4][j] + 22.0 / 525 * s->k[5][j] - 1.0 / 40 * s->k[6][j]);
}

static void step_extend(Step *s) {
    for (int j = 0; j < N; j++) {
        double rise = s->y1[j] - s->y0[j];
        s->bend[j] = s->h * s->k[0][j] - rise;
        s->twist[j] = rise - s->h * s->k[6][j] - s->bend[j];
        s->dense[j] = s->h * (-12715105075.0 / 11282082432.0 * s->k[0][j] + 87487479700.0 / 32700410799.0 * s->k[2][j] -
                              10690763975.0 / 1880347072.0 * s->k[3][j] + 701980252875.0 / 199316789632.0 * s->k[4][j] -
                              1453857185.0 / 822651844.0 * s->k[5][j] + 69997945.0 / 29380423.0 * s->k[6][j]);
    }
}

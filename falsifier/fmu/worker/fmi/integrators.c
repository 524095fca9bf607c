/* Single Runge-Kutta steps of a model-exchange FMU, explicit and implicit.
 *
 * Explicit: Dormand and Prince 5(4), J. Comp. Appl. Math. 6 (1980) 19-26, with the dense output and the
 * stiffness test of Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.6, and II, IV.2.
 * Implicit: ARK4(3)6L[2]SA-ESDIRK of Kennedy and Carpenter, Appl. Numer. Math. 44 (2003) 139-181. */

#include <math.h>
#include <string.h>

#include "fmi/model_exchange.h"

static const double C[7] = {0, 1.0 / 5, 3.0 / 10, 4.0 / 5, 8.0 / 9, 1, 1};
static const double A[7][6] = {
    {0},
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},
};
/* Weights of the error estimate: fifth-order minus fourth-order solution. */
static const double E[7] = {
    71.0 / 57600, 0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
static const double DENSE[7] = {
    -12715105075.0 / 11282082432.0, 0,
    87487479700.0 / 32700410799.0,  -10690763975.0 / 1880347072.0,
    701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0,
    69997945.0 / 29380423.0};

#define GAMMA 0.25
static const double IC[6] = {0, 1.0 / 2, 83.0 / 250, 31.0 / 50, 17.0 / 20, 1};
static const double IA[6][5] = {
    {0},
    {1.0 / 4},
    {8611.0 / 62500, -1743.0 / 31250},
    {5012029.0 / 34652500, -654441.0 / 2922500, 174375.0 / 388108},
    {15267082809.0 / 155376265600.0, -71443401.0 / 120774400, 730878875.0 / 902184768, 2285395.0 / 8070912},
    {82889.0 / 524892, 0, 15625.0 / 83664, 69875.0 / 102672, -2260.0 / 8211},
};
static const double IE[6] = {
    82889.0 / 524892 - 4586570599.0 / 29645900160.0,
    0,
    15625.0 / 83664 - 178811875.0 / 945068544,
    69875.0 / 102672 - 814220225.0 / 1159782912,
    -2260.0 / 8211 - -3700637.0 / 11593932,
    1.0 / 4 - 61727.0 / 225920,
};

#define MOST_ITERATIONS 8
/* Newton's method stops once its correction is well below the error allowed for the step. */
#define NEWTON_SHARE 0.01

static struct trial failed(unsigned status)
{
    return (struct trial){status, INFINITY, 0.0};
}

/* The root mean square of an error, in units of the tolerance. */
static double norm(const struct solver *s, const double *error)
{
    double total = 0.0;
    for (size_t i = 0; i < s->n; i++) {
        double size = fmax(fabs(s->x[i]), fabs(s->new_x[i]));
        double share = error[i] / (s->weights[i] + s->plan->solver_tolerance * size);
        total += share * share;
    }
    return sqrt(total / (double)(s->n ? s->n : 1));
}

/* Try a step of h from x with derivatives stages[0]; the result is in new_x. */
struct trial explicit_step(struct solver *s, double h)
{
    double **k = s->stages, *stage = s->work[0], *before = s->work[1], *error = s->work[2];
    for (int i = 1; i < 7; i++) {
        for (size_t e = 0; e < s->n; e++) {
            double total = 0.0;
            for (int j = 0; j < i; j++)
                total += A[i][j] * k[j][e];
            if (i == 6) {
                before[e] = stage[e];
                s->new_x[e] = s->x[e] + h * total;
            } else {
                stage[e] = s->x[e] + h * total;
            }
        }
        unsigned status = derive(s, s->time + C[i] * h, i == 6 ? s->new_x : stage, k[i]);
        if (status > 1)
            return failed(status);
    }
    double numerator = 0.0, denominator = 0.0;
    for (size_t e = 0; e < s->n; e++) {
        double total = 0.0;
        for (int j = 0; j < 7; j++)
            total += E[j] * k[j][e];
        error[e] = h * total;
        double slope = k[6][e] - k[5][e], distance = s->new_x[e] - before[e];
        numerator += slope * slope;
        denominator += distance * distance;
    }
    double stiffness = denominator > 0.0 ? fabs(h) * sqrt(numerator / denominator) : 0.0;
    return (struct trial){0, norm(s, error), stiffness};
}

/* Approximate the Jacobian at the start of the step by forward differences. */
static unsigned find_jacobian(struct solver *s)
{
    double *base = s->work[1], *moved = s->work[2], *at = s->work[3];
    memcpy(at, s->x, s->n * sizeof *at);
    unsigned status = derive(s, s->time, at, base);
    for (size_t j = 0; j < s->n && status <= 1; j++) {
        /* 1.5e-8 is the square root of the machine precision, relative to the state or, near 0, to its
         * nominal value, which the weight contains. The second line makes delta exactly representable. */
        double delta = 1.5e-8 * fmax(fabs(s->x[j]), 100.0 * s->weights[j] / s->plan->solver_tolerance);
        at[j] = s->x[j] + delta;
        delta = at[j] - s->x[j];
        status = derive(s, s->time, at, moved);
        if (status > 1)
            return status;
        at[j] = s->x[j];
        for (size_t i = 0; i < s->n; i++)
            s->jacobian[i * s->n + j] = (moved[i] - base[i]) / delta;
    }
    if (status > 1)
        return status;
    s->jacobian_known = 1;
    return 0;
}

/* Factorise 1 - hg J into triangular matrices, with row exchanges. */
static void factorise(struct solver *s, double hg)
{
    size_t n = s->n;
    double *a = s->jacobian + n * n;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            a[i * n + j] = (i == j ? 1.0 : 0.0) - hg * s->jacobian[i * n + j];
    for (size_t c = 0; c < n; c++) {
        size_t p = c;
        for (size_t i = c + 1; i < n; i++)
            if (fabs(a[i * n + c]) > fabs(a[p * n + c]))
                p = i;
        s->pivots[c] = p;
        for (size_t j = 0; p != c && j < n; j++) {
            double kept = a[c * n + j];
            a[c * n + j] = a[p * n + j];
            a[p * n + j] = kept;
        }
        /* Newton's method then diverges, and the step is retried with a new Jacobian or a shorter step. */
        if (a[c * n + c] == 0.0)
            a[c * n + c] = 1e-300;
        for (size_t i = c + 1; i < n; i++) {
            a[i * n + c] /= a[c * n + c];
            for (size_t j = c + 1; j < n; j++)
                a[i * n + j] -= a[i * n + c] * a[c * n + j];
        }
    }
}

/* Solve the linear system with the factors, in place of the right-hand side. */
static void substitute(const struct solver *s, double *b)
{
    size_t n = s->n;
    const double *a = s->jacobian + n * n;
    for (size_t c = 0; c < n; c++) {
        double kept = b[c];
        b[c] = b[s->pivots[c]];
        b[s->pivots[c]] = kept;
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < i; j++)
            b[i] -= a[i * n + j] * b[j];
    for (size_t i = n; i-- > 0;) {
        for (size_t j = i + 1; j < n; j++)
            b[i] -= a[i * n + j] * b[j];
        b[i] /= a[i * n + i];
    }
}

/* Solve one stage for new_x by Newton's method. */
static unsigned solve_stage(struct solver *s, double time, double hg, double *derivatives, int *converged)
{
    double *base = s->work[0], *residual = s->work[1], last = INFINITY;
    *converged = 0;
    for (int iteration = 0; iteration < MOST_ITERATIONS; iteration++) {
        unsigned status = derive(s, time, s->new_x, derivatives);
        if (status > 1)
            return status;
        for (size_t e = 0; e < s->n; e++)
            residual[e] = base[e] + hg * derivatives[e] - s->new_x[e];
        substitute(s, residual);
        double size = norm(s, residual);
        if (!isfinite(size) || size > 2.0 * last)
            return 0;
        for (size_t e = 0; e < s->n; e++)
            s->new_x[e] += residual[e];
        if (size < NEWTON_SHARE) {
            for (size_t e = 0; e < s->n; e++)
                derivatives[e] = (s->new_x[e] - base[e]) / hg;
            *converged = 1;
            return 0;
        }
        last = size;
    }
    return 0;
}

static unsigned solve_stages(struct solver *s, double h, int *converged)
{
    double **k = s->stages, *base = s->work[0];
    for (int i = 1; i < 6; i++) {
        for (size_t e = 0; e < s->n; e++) {
            double total = 0.0;
            for (int j = 0; j < i; j++)
                total += IA[i][j] * k[j][e];
            base[e] = s->x[e] + h * total;
            s->new_x[e] = base[e] + h * GAMMA * k[i - 1][e];
        }
        unsigned status = solve_stage(s, s->time + IC[i] * h, h * GAMMA, k[i], converged);
        if (status > 1 || !*converged)
            return status;
    }
    return 0;
}

/* Try an implicit step of h; stages[5] is then the derivative at the end. */
struct trial implicit_step(struct solver *s, double h)
{
    for (;;) {
        int is_new = !s->jacobian_known, converged = 0;
        unsigned status = is_new ? find_jacobian(s) : 0;
        if (status > 1)
            return failed(status);
        factorise(s, h * GAMMA);
        status = solve_stages(s, h, &converged);
        if (status > 1)
            return failed(status);
        if (converged)
            break;
        s->jacobian_known = 0;
        if (is_new)
            return failed(0);
    }
    double *error = s->work[2];
    for (size_t e = 0; e < s->n; e++) {
        double total = 0.0;
        for (int j = 0; j < 6; j++)
            total += IE[j] * s->stages[j][e];
        error[e] = h * total;
    }
    /* This difference overestimates the error of stiff components; the step's matrix damps them (Shampine). */
    substitute(s, error);
    return (struct trial){0, norm(s, error), 0.0};
}

/* Interpolate the state at theta in [0, 1] of the last trial step; cubic after an implicit step. */
void interpolate(const struct solver *s, double h, double theta, int end_stage, double *x)
{
    double *const *k = s->stages;
    for (size_t e = 0; e < s->n; e++) {
        double change = s->new_x[e] - s->x[e];
        double bend = h * k[0][e] - change;
        double twist = change - h * k[end_stage][e] - bend;
        double correction = 0.0;
        if (end_stage == 6)
            for (int j = 0; j < 7; j++)
                correction += DENSE[j] * k[j][e];
        double rest = 1.0 - theta;
        x[e] = s->x[e] + theta * (change + rest * (bend + theta * (twist + rest * h * correction)));
    }
}

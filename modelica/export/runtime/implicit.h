/* RODAS, a stiffly accurate Rosenbrock method of order 4(3) for stiff systems. Coefficients: Hairer, Wanner, Solving
 * Ordinary Differential Equations II, section IV.7. The continuous extension is that of their program.
 *
 * The Jacobian is computed by finite differences. No slope depends on two states of one group (of MODEL_GROUPS), so
 * that all states of a group are perturbed together.
 */
#include "step.h"

#define GAMMA 0.25
#define PERTURBATION 1.5e-8 /* relative; square root of the machine precision */

#define STEP_ORDER 4 /* the estimated error grows with this power of the step size */

static void find_jacobian(Model *m, const Step *s, double jacobian[N + 1][N + 1], double *by_time) {
    double y[N + 1], moved[N + 1], delta[N + 1];
    for (int j = 0; j < N; j++) {
        delta[j] = PERTURBATION * max_real(fabs(s->y0[j]), model_nominal[j]);
        delta[j] = (s->y0[j] + delta[j]) - s->y0[j];
    }
    for (int g = 0; g < MODEL_GROUPS; g++) {
        for (int j = 0; j < N; j++) y[j] = s->y0[j] + (model_group[j] == g ? delta[j] : 0);
        step_evaluate(m, s->t, y, moved);
        for (int j = 0; j < N; j++)
            if (model_group[j] == g)
                for (int i = 0; i < N; i++)
                    jacobian[i][j] = model_depends[i * N + j] ? (moved[i] - s->k[0][i]) / delta[j] : 0;
    }
    memset(by_time, 0, N * sizeof *by_time);
    if (MODEL_SLOPES_OF_TIME) {
        double dt = PERTURBATION * max_real(1, fabs(s->t));
        dt = (s->t + dt) - s->t;
        step_evaluate(m, s->t + dt, s->y0, moved);
        for (int i = 0; i < N; i++) by_time[i] = (moved[i] - s->k[0][i]) / dt;
    }
}

/* LU factors of I / (GAMMA h) - jacobian, with row pivoting; the diagonal is stored inverted. */
static void factorize(double a[N + 1][N + 1], int *pivot, double h) {
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) a[i][j] = (i == j ? 1 / (GAMMA * h) : 0) - a[i][j];
    for (int c = 0; c < N; c++) {
        int p = c;
        for (int i = c + 1; i < N; i++)
            if (fabs(a[i][c]) > fabs(a[p][c])) p = i;
        pivot[c] = p;
        for (int j = 0; p != c && j < N; j++) {
            double swapped = a[c][j];
            a[c][j] = a[p][j];
            a[p][j] = swapped;
        }
        a[c][c] = 1 / a[c][c];
        for (int i = c + 1; i < N; i++) {
            if (a[i][c] == 0) continue;
            a[i][c] *= a[c][c];
            for (int j = c + 1; j < N; j++) a[i][j] -= a[i][c] * a[c][j];
        }
    }
}

static void substitute(double a[N + 1][N + 1], const int *pivot, double *b) {
    for (int c = 0; c < N; c++) {
        double swapped = b[c];
        b[c] = b[pivot[c]];
        b[pivot[c]] = swapped;
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < i; j++) b[i] -= a[i][j] * b[j];
    for (int i = N - 1; i >= 0; i--) {
        for (int j = i + 1; j < N; j++) b[i] -= a[i][j] * b[j];
        b[i] *= a[i][i];
    }
}

static void step_stages(Model *m, Step *s) {
    static const double a[6][5] = {
        {0},
        {1.544000000000000},
        {0.9466785280815826, 0.2557011698983284},
        {3.314825187068521, 2.896124015972201, 0.9986419139977817},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1}};
    static const double c[6][5] = {
        {0},
        {-5.6688},
        {-2.430093356833875, -0.2063599157091915},
        {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
        {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
        {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}};
    static const double bend[5] = {10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662};
    static const double twist[5] = {-0.6762803392301253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872};
    static const double at[6] = {0, 0.386, 0.21, 0.63, 1, 1};
    static const double d[6] = {0.25, -0.1043, 0.1035, -0.0362, 0, 0};
    double matrix[N + 1][N + 1], by_time[N + 1], y[N + 1], slope[N + 1], u[6][N + 1];
    const double by_h = 1 / s->h;
    int pivot[N + 1];
    events_evaluate(m);
    memcpy(s->k[0], m->r + N, N * sizeof(double));
    find_jacobian(m, s, matrix, by_time);
    factorize(matrix, pivot, s->h);
    for (int stage = 0; stage < 6; stage++) {
        for (int j = 0; j < N; j++) {
            y[j] = s->y0[j];
            for (int l = 0; l < stage; l++) y[j] += a[stage][l] * u[l][j];
        }
        if (stage) step_evaluate(m, s->t + at[stage] * s->h, y, slope);
        else memcpy(slope, s->k[0], sizeof slope);
        for (int j = 0; j < N; j++) {
            u[stage][j] = slope[j] + s->h * d[stage] * by_time[j];
            for (int l = 0; l < stage; l++) u[stage][j] += c[stage][l] * by_h * u[l][j];
        }
        substitute(matrix, pivot, u[stage]);
    }
    for (int j = 0; j < N; j++) {
        s->y1[j] = y[j] + u[5][j];
        s->k[1][j] = u[5][j];
        s->bend[j] = s->twist[j] = s->dense[j] = 0;
        for (int l = 0; l < 5; l++) {
            s->bend[j] += bend[l] * u[l][j];
            s->twist[j] += twist[l] * u[l][j];
        }
    }
    s->extended = 1;
}

static double step_error(const Step *s, int j) { return s->k[1][j]; }

static void step_extend(Step *s) { (void)s; }

/* SUNDIALS CVODE on the press, all in C: BDF or Adams, with Newton's iteration (dense, difference-quotient Jacobian).  peers.py links it with the library that comes with scikit-sundae.  The few declarations needed stand
   here, so that no headers have to be installed (SUNDIALS 7, 64-bit indices). */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* Numbers of the press, in the order of press.py, then the magnitudes of the states. */
typedef struct {
    double speed, cage_speed, ball_angle, crank, rod, rod_centre, m_crank, m_rod, j_rod, m_slider, gravity, punch, share;
    double m_inner, m_outer, stiffness, damping, half_clearance, contact, rate, tangent, window[2], scale[8];
} press;

/* dx/dt by the formulas of press.py. */
void press_rate(const press *p, double gate, double t, const double *x, double *dx)
{
    static const double h = 0.70710678118654752440;
    static const double bc[8] = {1, h, 0, -h, -1, -h, 0, h}, bs[8] = {0, h, 1, h, 0, -h, -1, -h};
    const double w = p->speed, part = p->rod_centre / p->rod;
    const double px = p->crank * cos(w * t), py = p->crank * sin(w * t);
    const double vx = -w * py, ax = -w * w * px, ay = -w * w * py;
    const double span = sqrt(p->rod * p->rod - px * px), turning = -vx / span;
    const double turning_t = -(ax + px * turning * turning) / span;
    const double slider = ay - vx * turning - px * turning_t;
    const double gx = (1.0 - part) * ax, gy = (1.0 - part) * ay + part * slider;
    const double qy = gate * p->punch - p->m_slider * (slider + p->gravity);
    const double moment = px * (qy - part * p->m_rod * (p->gravity + gy)) + p->j_rod * turning_t + p->m_rod * part * span * gx;
    const double lx = p->share * (moment / span - p->m_rod * gx);
    const double ly = p->share * (qy - p->m_rod * (gy + p->gravity) - p->m_crank * p->gravity);

    const double c = cos(p->ball_angle + p->cage_speed * t), s = sin(p->ball_angle + p->cage_speed * t);
    const double rx = x[0] - x[2], ry = x[1] - x[3];
    const double ux = x[4] - x[6] + p->cage_speed * ry, uy = x[5] - x[7] - p->cage_speed * rx;
    double fx = 0.0, fy = 0.0;
    for (int j = 0; j < 8; j++) {
        const double co = bc[j] * c - bs[j] * s, si = bs[j] * c + bc[j] * s;
        const double deflection = fmax(rx * co + ry * si - p->half_clearance, 0.0), closing = ux * co + uy * si;
        const double root = sqrt(deflection);
        const double force = p->tangent != 0.0 ? p->contact * root * (deflection + 1.5 * p->rate * closing)
                                               : p->contact * root * deflection + p->rate * fmax(closing, 0.0);
        fx += force * co;
        fy += force * si;
    }
    for (int k = 0; k < 4; k++) dx[k] = x[4 + k];
    dx[4] = (lx - fx) / p->m_inner;
    dx[5] = (ly - fy) / p->m_inner;
    dx[6] = (fx - p->stiffness * x[2] - p->damping * x[6]) / p->m_outer;
    dx[7] = (fy - p->stiffness * x[3] - p->damping * x[7]) / p->m_outer;
}

typedef void *handle;
typedef int64_t sunindextype;
extern int SUNContext_Create(int communicator, handle *context);
extern int SUNContext_Free(handle *context);
extern handle N_VMake_Serial(sunindextype length, double *data, handle context);
extern double *N_VGetArrayPointer(handle vector);
extern void N_VDestroy(handle vector);
extern handle SUNDenseMatrix(sunindextype rows, sunindextype columns, handle context);
extern void SUNMatDestroy(handle matrix);
extern handle SUNLinSol_Dense(handle vector, handle matrix, handle context);
extern int SUNLinSolFree(handle solver);
extern handle CVodeCreate(int method, handle context);
extern int CVodeInit(handle memory, int (*rate)(double, handle, handle, void *), double t, handle state);
extern int CVodeReInit(handle memory, double t, handle state);
extern int CVodeSStolerances(handle memory, double relative, double absolute);
extern int CVodeSetLinearSolver(handle memory, handle solver, handle matrix);
extern int CVodeSetUserData(handle memory, void *data);
extern int CVodeSetMaxNumSteps(handle memory, long count);
extern int CVodeSetStopTime(handle memory, double t);
extern int CVode(handle memory, double until, handle state, double *reached, int task);
extern void CVodeFree(handle *memory);

typedef struct {
    const press *p;
    double gate;
} user;

static int scaled_rate(double t, handle state, handle slope, void *data)
{
    const user *u = data;
    const double *z = N_VGetArrayPointer(state);
    double *dz = N_VGetArrayPointer(slope), x[8], dx[8];
    for (int k = 0; k < 8; k++) x[k] = z[k] * u->p->scale[k];
    press_rate(u->p, u->gate, t, x, dx);
    for (int k = 0; k < 8; k++) dz[k] = dx[k] / u->p->scale[k];
    return 0;
}

/* One cycle by `method` (1 Adams, 2 BDF); segments end at `edges`, outputs up to each are counted by `counts`.  Returns 0 when done. */
int cvode_cycle(int method, double tolerance, const press *p, const double *x, int segments, const double *edges,
                const double *gates, const long *counts, const double *times, double *states)
{
    enum { NORMAL = 1 };
    handle context = NULL, memory;
    double z[8];
    int status = SUNContext_Create(0, &context);
    if (status) return status;
    for (int k = 0; k < 8; k++) z[k] = x[k] / p->scale[k];
    handle state = N_VMake_Serial(8, z, context);
    user data = {.p = p};
    memory = CVodeCreate(method, context);
    status = CVodeInit(memory, scaled_rate, edges[0], state);
    if (!status) status = CVodeSStolerances(memory, tolerance, tolerance);
    if (!status) status = CVodeSetUserData(memory, &data);
    handle matrix = SUNDenseMatrix(8, 8, context), linear = SUNLinSol_Dense(state, matrix, context);
    if (!status) status = CVodeSetLinearSolver(memory, linear, matrix);
    if (!status) status = CVodeSetMaxNumSteps(memory, 10000000);
    long row = 0;
    for (int i = 0; i < segments && !status; i++) {
        double reached = edges[i];
        data.gate = gates[i];
        if (i > 0) status = CVodeReInit(memory, edges[i], state);
        if (!status) status = CVodeSetStopTime(memory, edges[i + 1]);
        for (long k = 0; k < counts[i] && !status; k++, row++) {
            const int end = CVode(memory, times[row], state, &reached, NORMAL);
            status = end < 0 ? end : 0;
            for (int j = 0; j < 8; j++) states[8 * row + j] = z[j] * p->scale[j];
        }
        if (!status && reached < edges[i + 1]) {
            const int end = CVode(memory, edges[i + 1], state, &reached, NORMAL);
            status = end < 0 ? end : 0;
        }
    }
    CVodeFree(&memory);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(state);
    SUNContext_Free(&context);
    return status;
}

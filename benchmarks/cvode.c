/* SUNDIALS CVODE on the press, all in C: BDF or Adams, with Newton's iteration (dense, difference-quotient Jacobian) or the fixed-point
   one, which needs no Jacobian.  peers.py links it with the library that comes with scikit-sundae.  The few declarations needed stand
   here, so that no headers have to be installed (SUNDIALS 7, 64-bit indices). */
#include <stdint.h>
#include <string.h>

#include "hand_written.c"

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
extern handle SUNNonlinSol_FixedPoint(handle vector, int accelerated, handle context);
extern int SUNNonlinSolFree(handle solver);
extern handle CVodeCreate(int method, handle context);
extern int CVodeInit(handle memory, int (*rate)(double, handle, handle, void *), double t, handle state);
extern int CVodeReInit(handle memory, double t, handle state);
extern int CVodeSStolerances(handle memory, double relative, double absolute);
extern int CVodeSetLinearSolver(handle memory, handle solver, handle matrix);
extern int CVodeSetNonlinearSolver(handle memory, handle solver);
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
int cvode_cycle(int method, int fixed_point, double tolerance, const press *p, const double *x, int segments, const double *edges,
                const double *gates, const long *counts, const double *times, double *states)
{
    enum { NORMAL = 1 };
    handle context = NULL, memory, matrix = NULL, linear = NULL, iteration = NULL;
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
    if (fixed_point) {
        iteration = SUNNonlinSol_FixedPoint(state, 0, context);
        if (!status) status = CVodeSetNonlinearSolver(memory, iteration);
    } else {
        matrix = SUNDenseMatrix(8, 8, context);
        linear = SUNLinSol_Dense(state, matrix, context);
        if (!status) status = CVodeSetLinearSolver(memory, linear, matrix);
    }
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
    if (iteration) SUNNonlinSolFree(iteration);
    if (linear) SUNLinSolFree(linear);
    if (matrix) SUNMatDestroy(matrix);
    N_VDestroy(state);
    SUNContext_Free(&context);
    return status;
}

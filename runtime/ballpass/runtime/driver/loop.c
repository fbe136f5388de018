/* Call a generated function at many points in one call; a loop in Python would take a thousand times as long.

   Generated functions take arrays of pointers to their arguments and results, and work memory (casadi's interface in C).  An argument
   that varies advances by its stride from point to point, one that is fixed has the stride 0.  A result whose pointer is NULL is not
   written. */
#include <stddef.h>

#ifdef _WIN32
#define BALLPASS_EXPORT __declspec(dllexport)
#else
#define BALLPASS_EXPORT __attribute__((visibility("default")))
#endif

typedef int (*generated)(const double **arg, double **res, long long int *iw, double *w, int mem);

/* Returns the number of points done: less than `count` where the function reports failure. */
BALLPASS_EXPORT long ballpass_loop(generated function, long count, long inputs, const double *const *first_in, const long *stride_in,
                                 long outputs, double *const *first_out, const long *stride_out, const double **arg, double **res,
                                 long long int *iw, double *w)
{
    for (long i = 0; i < count; i++) {
        /* anew for every point: functions may use these arrays for themselves */
        for (long k = 0; k < inputs; k++) arg[k] = first_in[k] + i * stride_in[k];
        for (long k = 0; k < outputs; k++) res[k] = first_out[k] ? first_out[k] + i * stride_out[k] : NULL;
        if (function(arg, res, iw, w, 0)) return i;
    }
    return count;
}

/* Explicit Runge-Kutta step (Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, sections II.4 to II.6).

   A body without a guard: single.h, lanes.h and sensitivity.h include it for one run, a member in each lane and directions of derivatives.
   A state is BP_NX coordinates of BP_W numbers each, next to each other.  Defined where it is included:

   BP_NAME(f)   name of a function there
   BP_W, BP_N   numbers of a coordinate, and their type
   BP_V, BP_VS  type that sums run in, and how many make up the positions (as many the velocities)
   BP_X, BP_XS  the same of a whole state, where it can be cut into wider ones
   BP_H         type of a step size: one for all, or one for each lane
   BP_NAME(times), BP_NAME(slope)(at, i, time, y, k)
                what the slopes of a step need of its times; the slope k of stage i (from 1 on) with argument y at the time number `time`

   Step sizes are handed over by their addresses. */

#define BP_AT(type, x, i) (((type *)(x))[i])

#ifndef BP_X
#define BP_X BP_V
#define BP_XS (2 * BP_VS)
#endif

/* Vectors that a sum runs in at once: they stay in registers. */
#undef BP_TOGETHER
#define BP_TOGETHER (BP_XS % 4 == 0 ? 4 : BP_XS % 2 == 0 ? 2 : BP_XS)

/* y = x + sum of scale row[j] k[j], without x where it is NULL. */
BP_INLINE void BP_NAME(add)(const double *restrict row, const int count, const double k[][BP_NX * BP_W], const BP_H *scale,
                            const double *restrict x, double *restrict y)
{
#pragma GCC unroll 16
    for (int first = 0; first < BP_XS; first += BP_TOGETHER) {
        BP_X sum[BP_TOGETHER];
#pragma GCC unroll 16
        for (int e = 0; e < BP_TOGETHER; e++) sum[e] = x ? BP_AT(const BP_X, x, first + e) : (BP_X){0.0};
        for (int j = 0; j < count; j++) {
            if (row[j] == 0.0) continue;
            const BP_H a = *scale * row[j];
#pragma GCC unroll 16
            for (int e = 0; e < BP_TOGETHER; e++) sum[e] += a * BP_AT(const BP_X, k[j], first + e);
        }
#pragma GCC unroll 16
        for (int e = 0; e < BP_TOGETHER; e++) BP_AT(BP_X, y, first + e) = sum[e];
    }
}

/* y = x + h sum of row[j] k[j]. */
BP_INLINE void BP_NAME(combine)(const double *restrict row, const int count, const double k[][BP_NX * BP_W], const double *restrict h,
                                const double *restrict x, double *restrict y)
{
    const BP_H one = 1.0 - (BP_H){0.0};
    double sum[BP_NX * BP_W] BP_ALIGNED;
    BP_NAME(add)(row, count, k, &one, NULL, sum);
#pragma GCC unroll 16
    for (int e = 0; e < BP_XS; e++) BP_AT(BP_X, y, e) = BP_AT(const BP_X, x, e) + *(const BP_H *)h * BP_AT(BP_X, sum, e);
}

/* Root mean square of an error over its tolerance; not a number where the error is none. */
BP_INLINE void BP_NAME(norm)(const double *restrict error, const double *restrict weight, double *restrict norm)
{
    BP_N square[BP_NX];
    for (int k = 0; k < BP_NX; k++) {
        const BP_N e = BP_AT(const BP_N, error, k) * BP_AT(const BP_N, weight, k);
        square[k] = e * e;
    }
    /* in pairs: the step size waits for this sum */
#pragma GCC unroll 16
    for (int left = BP_NX; left > 1; left = (left + 1) / 2)
#pragma GCC unroll 16
        for (int k = 0; k < left / 2; k++) square[k] += square[k + (left + 1) / 2];
    BP_AT(BP_N, norm, 0) = square[0] / (double)BP_NX;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) norm[l] = sqrt(norm[l]);
}

/* Slopes k of a step of size h from x to `next`, that at its end included; the first is known.  `argument`: of the last stage. */
BP_INLINE void BP_NAME(explicit_stages)(const bp_explicit_method *restrict method, const BP_NAME(times) *at, double k[][BP_NX * BP_W],
                                        double *restrict argument, const double *restrict x, const double *restrict h,
                                        double *restrict next)
{
    const int stages = method->stages;
    /* the latest slope stays in registers and is added last: all else is ready before it is */
    double last[BP_NX * BP_W] BP_ALIGNED, y[BP_NX * BP_W] BP_ALIGNED;
    for (int c = 0; c < BP_NX; c++) BP_AT(BP_N, last, c) = BP_AT(BP_N, k[0], c);
    for (int i = 1; i <= stages; i++) {
        const double *restrict row = i < stages ? method->a[i] : method->weights;
        const BP_H latest = *(const BP_H *)h * row[i - 1];
        double base[BP_NX * BP_W] BP_ALIGNED;
        BP_NAME(combine)(row, i - 1, (const double(*)[BP_NX * BP_W])k, h, x, base);
#pragma GCC unroll 16
        for (int c = 0; c < BP_NX; c++) BP_AT(BP_N, y, c) = BP_AT(BP_N, base, c) + latest * BP_AT(BP_N, last, c);
        BP_NAME(slope)(at, i, i < stages ? i - 1 : method->times - 1, y, last);
#pragma GCC unroll 16
        for (int c = 0; c < BP_NX; c++) BP_AT(BP_N, k[i], c) = BP_AT(BP_N, last, c);
        if (i < stages - 1) continue;
        double *restrict kept = i < stages ? argument : next;
        for (int c = 0; c < BP_NX; c++) BP_AT(BP_N, kept, c) = BP_AT(BP_N, y, c);
    }
}

/* Scaled error of that step. */
BP_INLINE void BP_NAME(explicit_error)(const bp_explicit_method *restrict method, const double k[][BP_NX * BP_W],
                                       const double *restrict h, const double *restrict weight, double *restrict error)
{
    double first[BP_W] BP_ALIGNED = {0.0}, below[BP_W] BP_ALIGNED = {0.0};
    for (int m = 0; m < method->estimates; m++) {
        double estimate[BP_NX * BP_W] BP_ALIGNED, norm[BP_W] BP_ALIGNED;
        BP_NAME(add)(method->error[m], method->stages + 1, k, (const BP_H *)h, NULL, estimate);
        BP_NAME(norm)(estimate, weight, norm);
#pragma omp simd
        for (int l = 0; l < BP_W; l++) {
            if (m == 0) first[l] = norm[l];
            below[l] += method->error_share[m] * norm[l] * norm[l];
        }
    }
#pragma omp simd
    for (int l = 0; l < BP_W; l++) error[l] = below[l] > 0.0 ? first[l] * first[l] / sqrt(below[l]) : first[l];
}

/* Product of step size and dominant eigenvalue, from the last two slopes at the step's end (section IV.2 of volume II). */
BP_INLINE void BP_NAME(explicit_reach)(const int stages, const double k[][BP_NX * BP_W], const double *restrict argument,
                                       const double *restrict h, const double *restrict next, const double *restrict weight,
                                       double *restrict reach)
{
    double slopes[BP_NX * BP_W] BP_ALIGNED, states[BP_NX * BP_W] BP_ALIGNED, below[BP_W] BP_ALIGNED;
#pragma omp simd
    for (int i = 0; i < BP_NX * BP_W; i++) {
        slopes[i] = k[stages][i] - k[stages - 1][i];
        states[i] = next[i] - argument[i];
    }
    BP_NAME(norm)(states, weight, below);
    BP_NAME(norm)(slopes, weight, reach);
#pragma omp simd
    for (int l = 0; l < BP_W; l++) reach[l] = below[l] > 0.0 ? h[sizeof(BP_H) > sizeof *h ? l : 0] * reach[l] / below[l] : 0.0;
}

/* Terms F1, F2, ... of the dense output of an accepted step; may take further slopes, at the times `at`. */
BP_INLINE void BP_NAME(explicit_dense)(const bp_explicit_method *restrict method, const BP_NAME(times) *at, double k[][BP_NX * BP_W],
                                       const double *restrict x, const double *restrict step, const double *restrict next,
                                       double dense[][BP_NX * BP_W])
{
    const int end = method->stages;
    const double(*slopes)[BP_NX * BP_W] = (const double(*)[BP_NX * BP_W])k;
    const BP_H h = *(const BP_H *)step;
    for (int r = 0; r < method->dense_stages; r++) {
        double y[BP_NX * BP_W] BP_ALIGNED;
        BP_NAME(combine)(method->dense_a[r], end + 1 + r, slopes, step, x, y);
        BP_NAME(slope)(at, r + 1, r, y, k[end + 1 + r]);
    }
#pragma GCC unroll 16
    for (int e = 0; e < BP_XS; e++) {
        const BP_X delta = BP_AT(const BP_X, next, e) - BP_AT(const BP_X, x, e), first = h * BP_AT(BP_X, k[0], e);
        BP_AT(BP_X, dense[0], e) = first - delta;
        BP_AT(BP_X, dense[1], e) = 2.0 * delta - (first + h * BP_AT(BP_X, k[end], e));
    }
    for (int row = 0; row < method->dense_rows; row++)
        BP_NAME(add)(method->dense[row], end + 1 + method->dense_stages, slopes, &h, NULL, dense[2 + row]);
}

/* Part e of y = x + theta (D + (1 - theta) (F1 + theta (F2 + (1 - theta) (F3 + ...)))). */
BP_INLINE void BP_NAME(explicit_part)(const bp_explicit_method *restrict method, const double dense[][BP_NX * BP_W],
                                      const double *restrict x, const double *restrict next, double theta, int e, double *restrict y)
{
    BP_X inner = {0.0};
#pragma GCC unroll 16
    for (int row = 1 + method->dense_rows; row >= 0; row--)
        inner = (BP_AT(const BP_X, dense[row], e) + inner) * (row % 2 == 0 ? 1.0 - theta : theta);
    BP_AT(BP_X, y, e) = BP_AT(const BP_X, x, e) + theta * (BP_AT(const BP_X, next, e) - BP_AT(const BP_X, x, e) + inner);
}

BP_INLINE void BP_NAME(explicit_at)(const bp_explicit_method *restrict method, const double dense[][BP_NX * BP_W], const double *restrict x,
                                    const double *restrict next, double theta, double *restrict y)
{
#pragma GCC unroll 16
    for (int e = 0; e < BP_XS; e++) BP_NAME(explicit_part)(method, dense, x, next, theta, e, y);
}

#undef BP_X
#undef BP_XS

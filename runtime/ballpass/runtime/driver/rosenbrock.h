/* Linearly implicit step (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.7) for q'' = a(t, q, v).

   Each stage solves (1/(h gamma) I - J) k = R with J = [0 I; A B].  The upper half is kq = (Rq + kv)/s with s = 1/(h gamma), so that only
   W kv = Rv + A Rq / s with W = s I - B - A/s remains: BP_NQ equations instead of BP_NX.

   A body as explicit.h, included behind it.  Defined besides:

   BP_S         type of an entry of [W^-1 A/s | W^-1]
   BP_NAME(linear), BP_NAME(linear_slope)(at, i, y, dx), BP_NAME(time_term)(at, i, c, d)
                what the stages of a step need; dx/dt at the argument y of stage i; what d = h gamma_i adds to the acceleration of
                coordinate c there
   BP_STRETCHED where BP_NAME(position_term)(at, i, c) is added to the velocity of coordinate c there */

/* Stages u of a step of size h from x; `solve`: column j is what R[j] adds to kv. */
BP_INLINE void BP_NAME(rosenbrock_stages)(const bp_rosenbrock_method *restrict method, const BP_NAME(linear) *at,
                                          const double *restrict solve, double u[][BP_NX * BP_W], const double *restrict x,
                                          const double *restrict step)
{
    const BP_H h = *(const BP_H *)step, inverse_s = h * method->gamma, inverse_h = 1.0 / h;
    const BP_S(*columns)[BP_VS] = (const BP_S(*)[BP_VS])solve;
    BP_V last[2 * BP_VS];
    for (int i = 0; i < method->stages; i++) {
        double y[BP_NX * BP_W] BP_ALIGNED, dx[BP_NX * BP_W] BP_ALIGNED, R[BP_NX * BP_W] BP_ALIGNED;
        BP_V reached[2 * BP_VS], coupled[2 * BP_VS];
#pragma GCC unroll 16
        for (int first = 0; first < BP_VS; first++) {
            /* position and velocity of a coordinate together; the latest stage last: all else is ready before it is */
#pragma GCC unroll 2
            for (int e = first; e < 2 * BP_VS; e += BP_VS) {
                reached[e] = BP_AT(const BP_V, x, e);
                coupled[e] = (BP_V){0.0};
            }
            for (int j = 0; j < i - 1; j++) {
                const double a = method->a[i][j], coupling = method->coupling[i][j];
#pragma GCC unroll 2
                for (int e = first; e < 2 * BP_VS; e += BP_VS) {
                    reached[e] += a * BP_AT(BP_V, u[j], e);
                    coupled[e] += coupling * BP_AT(BP_V, u[j], e);
                }
            }
            if (i == 0) continue;
#pragma GCC unroll 2
            for (int e = first; e < 2 * BP_VS; e += BP_VS) {
                reached[e] += method->a[i][i - 1] * last[e];
                coupled[e] += method->coupling[i][i - 1] * last[e];
            }
        }
#pragma GCC unroll 16
        for (int e = 0; e < 2 * BP_VS; e++) BP_AT(BP_V, y, e) = reached[e];
        BP_NAME(linear_slope)(at, i, y, dx);
#pragma GCC unroll 16
        for (int e = 0; e < BP_VS; e++) {
            /* positions move with the velocities: taken from the vector, not from the copy just stored */
            BP_AT(BP_V, R, e) = coupled[e] * inverse_h + reached[BP_VS + e];
            BP_AT(BP_V, R, BP_VS + e) = coupled[BP_VS + e] * inverse_h;
#ifdef BP_STRETCHED
            BP_AT(BP_V, R, e) += BP_NAME(position_term)(at, i, e);
#endif
        }
        const BP_H d = h * method->time_weights[i];
#pragma GCC unroll 16
        for (int c = 0; c < BP_NQ; c++)
            BP_AT(BP_N, R, BP_NQ + c) = BP_AT(BP_N, R, BP_NQ + c) + BP_AT(BP_N, dx, BP_NQ + c) + BP_NAME(time_term)(at, i, c, d);
#pragma GCC unroll 16
        for (int e = 0; e < BP_VS; e++) {
            /* two sums, that of the positions ready before the forces are */
            BP_V by_q = {0.0}, by_v = {0.0};
#pragma GCC unroll 16
            for (int j = 0; j < BP_NQ; j++) by_q += columns[j][e] * BP_AT(BP_N, R, j);
#pragma GCC unroll 16
            for (int j = BP_NQ; j < BP_NX; j++) by_v += columns[j][e] * BP_AT(BP_N, R, j);
            last[BP_VS + e] = by_q + by_v;
            last[e] = (BP_AT(BP_V, R, e) + last[BP_VS + e]) * inverse_s;
            BP_AT(BP_V, u[i], e) = last[e];
            BP_AT(BP_V, u[i], BP_VS + e) = last[BP_VS + e];
        }
    }
}

/* End of that step, and its scaled error. */
BP_INLINE void BP_NAME(rosenbrock_end)(const bp_rosenbrock_method *restrict method, const double u[][BP_NX * BP_W],
                                       const double *restrict x, double *restrict next)
{
    const BP_H one = 1.0 - (BP_H){0.0};
    BP_NAME(add)(method->weights, method->stages, u, &one, x, next);
}

BP_INLINE void BP_NAME(rosenbrock_error)(const bp_rosenbrock_method *restrict method, const double u[][BP_NX * BP_W],
                                         const double *restrict weight, double *restrict error)
{
    const BP_H one = 1.0 - (BP_H){0.0};
    double estimate[BP_NX * BP_W] BP_ALIGNED;
    BP_NAME(add)(method->error_weights, method->stages, u, &one, NULL, estimate);
    BP_NAME(norm)(estimate, weight, error);
}

/* Terms H1, H2, ... of the dense output of an accepted step. */
BP_INLINE void BP_NAME(rosenbrock_dense)(const bp_rosenbrock_method *restrict method, const double u[][BP_NX * BP_W],
                                         double dense[][BP_NX * BP_W])
{
    const BP_H one = 1.0 - (BP_H){0.0};
    for (int row = 0; row < method->dense_rows; row++) BP_NAME(add)(method->dense[row], method->stages, u, &one, NULL, dense[row]);
}

/* Part e of y = x + theta (D + (1 - theta) (H1 + theta (H2 + theta H3))). */
BP_INLINE void BP_NAME(rosenbrock_part)(const bp_rosenbrock_method *restrict method, const double dense[][BP_NX * BP_W],
                                        const double *restrict x, const double *restrict next, double theta, int e, double *restrict y)
{
    const int rows = method->dense_rows;
    BP_V inner = BP_AT(const BP_V, dense[rows - 1], e);
#pragma GCC unroll 16
    for (int row = rows - 2; row >= 0; row--) inner = BP_AT(const BP_V, dense[row], e) + theta * inner;
    BP_AT(BP_V, y, e) = BP_AT(const BP_V, x, e) + theta * (BP_AT(const BP_V, next, e) - BP_AT(const BP_V, x, e) + (1.0 - theta) * inner);
}

BP_INLINE void BP_NAME(rosenbrock_at)(const bp_rosenbrock_method *restrict method, const double dense[][BP_NX * BP_W],
                                      const double *restrict x, const double *restrict next, double theta, double *restrict y)
{
#pragma GCC unroll 16
    for (int e = 0; e < 2 * BP_VS; e++) BP_NAME(rosenbrock_part)(method, dense, x, next, theta, e, y);
}

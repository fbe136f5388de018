/* The iteration matrix W = s I - B - A/s of a linearly implicit step (rosenbrock.h), inverted by Gauss-Jordan elimination: with eight
   right-hand sides a step, products with the inverse cost less than substitutions, and its rows fill SIMD lanes.

   A body as explicit.h, for one run and for a member in each lane. */

/* The rows of [W | A/s | I], and for each lane whether every row of W is dominated by its diagonal, as it is for steps that resolve the
   motion: then no pivoting is needed. */
BP_INLINE void BP_NAME(matrix_rows)(BP_N rows[BP_NQ][3 * BP_NQ], double *restrict dominance, const double *restrict A,
                                    const double *restrict B, const BP_N *restrict s)
{
    const BP_N inverse = 1.0 / *s;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) dominance[l] = 1.0;
    for (int i = 0; i < BP_NQ; i++) {
        double rest[BP_W] BP_ALIGNED = {0.0};
        for (int j = 0; j < BP_NQ; j++) {
            const double one = i == j ? 1.0 : 0.0;
            const BP_N scaled = BP_AT(const BP_N, A, i * BP_NQ + j) * inverse;
            rows[i][j] = one * *s - BP_AT(const BP_N, B, i * BP_NQ + j) - scaled;
            rows[i][BP_NQ + j] = scaled;
            rows[i][2 * BP_NQ + j] = one + (BP_N){0.0};
#pragma omp simd
            for (int l = 0; l < BP_W; l++) rest[l] += i != j ? fabs(BP_AT(double, &rows[i][j], l)) : 0.0;
        }
#pragma omp simd
        for (int l = 0; l < BP_W; l++) dominance[l] = fabs(BP_AT(double, &rows[i][i], l)) >= rest[l] ? dominance[l] : 0.0;
    }
}

/* Make column k that of the identity. */
BP_INLINE void BP_NAME(clear_column)(BP_N rows[BP_NQ][3 * BP_NQ], const int k)
{
    const BP_N pivot = 1.0 / rows[k][k];
    for (int j = 0; j < 3 * BP_NQ; j++) rows[k][j] *= pivot;
    for (int i = 0; i < BP_NQ; i++) {
        const BP_N factor = (i == k ? 0.0 : 1.0) * rows[i][k];
        for (int j = 0; j < 3 * BP_NQ; j++) rows[i][j] -= factor * rows[k][j];
    }
}

/* Small dense systems of the positions: length of a vector, and elimination with pivoting. */
#ifndef BALLPASS_ELIMINATION_H
#define BALLPASS_ELIMINATION_H

#include "model.h"

static inline double bp_length(const double *v)
{
    double sum = 0.0;
    for (int k = 0; k < BP_NQ; k++) sum += v[k] * v[k];
    return sqrt(sum);
}

/* The rows of (shift I - A) d = r, right-hand sides last. */
static inline void bp_shifted_rows(const double *A, double shift, const double *r, double rows[][BP_NQ + 1])
{
    for (int i = 0; i < BP_NQ; i++) {
        for (int j = 0; j < BP_NQ; j++) rows[i][j] = (i == j ? shift : 0.0) - A[i * BP_NQ + j];
        rows[i][BP_NQ] = r[i];
    }
}

/* Solve rows with their right-hand sides last, which are overwritten; returns 0 where a pivot is not larger than `least`, or no number. */
static inline int bp_eliminate(double rows[][BP_NQ + 1], double least, double *d)
{
    for (int k = 0; k < BP_NQ; k++) {
        int best = k;
        for (int i = k + 1; i < BP_NQ; i++)
            if (fabs(rows[i][k]) > fabs(rows[best][k])) best = i;
        if (!(fabs(rows[best][k]) > least)) return 0;
        for (int j = 0; j <= BP_NQ; j++) {
            const double swap = rows[k][j];
            rows[k][j] = rows[best][j];
            rows[best][j] = swap;
        }
        for (int i = k + 1; i < BP_NQ; i++) {
            const double factor = rows[i][k] / rows[k][k];
            for (int j = k; j <= BP_NQ; j++) rows[i][j] -= factor * rows[k][j];
        }
    }
    for (int i = BP_NQ - 1; i >= 0; i--) {
        d[i] = rows[i][BP_NQ];
        for (int j = i + 1; j < BP_NQ; j++) d[i] -= rows[i][j] * d[j];
        d[i] /= rows[i][i];
    }
    return 1;
}

#endif

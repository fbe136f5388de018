/* Step sizes by the PI controller (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.2).

   A body as explicit.h, for one run and for a member in each lane.  BP_NAME(log) and BP_NAME(exp) take BP_W numbers;
   for rejected steps BP_NAME(exp) also gets the error and the order, because the result there is the error to the power -1/order. */

/* Ratio of the next step to the one tried, which had this scaled error and was accepted or not.

   order            of the error
   rejected_last    whether the step before was rejected: then this one does not grow
   last_error       logarithm of the error of the last accepted step; that of this one where it is accepted */
BP_INLINE void BP_NAME(step_factor)(double order, const double *restrict error, const double *restrict accepted,
                                    const double *restrict rejected_last, double *restrict last_error, double *restrict factor)
{
    double bounded[BP_W] BP_ALIGNED, log_error[BP_W] BP_ALIGNED, exponent[BP_W] BP_ALIGNED;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) {
        const double least = error[l] > 1e-10 ? error[l] : 1e-10;
        bounded[l] = least <= DBL_MAX ? least : 1.0;
    }
    BP_NAME(log)(bounded, log_error);
#pragma omp simd
    for (int l = 0; l < BP_W; l++) {
        const double wanted = accepted[l] != 0.0 ? 0.4 * last_error[l] - 0.7 * log_error[l] : -log_error[l];
        exponent[l] = wanted / order;
    }
    BP_NAME(exp)(exponent, factor, accepted, bounded, order);
#pragma omp simd
    for (int l = 0; l < BP_W; l++) {
        const double most = rejected_last[l] != 0.0 ? 1.0 : 6.0;
        double up = 0.9 * factor[l];
        up = up < 0.2 ? 0.2 : up;
        up = up > most ? most : up;
        /* NaN does not show by how much to shrink */
        double down = error[l] > 1.0 && error[l] <= DBL_MAX ? 0.9 * factor[l] : 0.1;
        down = down < 0.1 ? 0.1 : down;
        down = down > 0.9 ? 0.9 : down;
        factor[l] = accepted[l] != 0.0 ? up : down;
        const double kept = log_error[l] > BP_LOG_SMALL_ERROR ? log_error[l] : BP_LOG_SMALL_ERROR;
        last_error[l] = accepted[l] != 0.0 ? kept : last_error[l];
    }
}

/* Step sizes by the PI controller (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.2).

   A body as explicit.h, for one run and for a member in each lane. */

/* Natural logarithm of positive numbers and exponential of moderate ones without branches and tables: to 1e-11, and the same bits in
   every lane as in a single run. */
BP_INLINE void BP_NAME(log)(const double *restrict x, double *restrict y)
{
    union {
        double value[BP_W];
        uint64_t bits[BP_W];
    } from BP_ALIGNED, exponent BP_ALIGNED, fraction BP_ALIGNED;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) from.value[l] = x[l] * 1.4142135623730951; /* so that the fraction is about one */
#pragma omp simd
    for (int l = 0; l < BP_W; l++) exponent.bits[l] = (from.bits[l] >> 52) | UINT64_C(0x4330000000000000);
#pragma omp simd
    for (int l = 0; l < BP_W; l++) fraction.bits[l] = (from.bits[l] & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000);
#pragma omp simd
    for (int l = 0; l < BP_W; l++) {
        const double m = fraction.value[l] * 0.7071067811865476, s = (m - 1.0) / (m + 1.0), z = s * s, zz = z * z;
        /* in pairs: the next step waits for it */
        const double low = (1.0 + z * (1.0 / 3)) + zz * (1.0 / 5 + z * (1.0 / 7));
        const double series = low + zz * zz * ((1.0 / 9 + z * (1.0 / 11)) + zz * (1.0 / 13));
        y[l] = (exponent.value[l] - (4503599627370496.0 + 1023.0)) * 0.6931471805599453 + 2.0 * s * series;
    }
}

BP_INLINE void BP_NAME(exp)(const double *restrict x, double *restrict y)
{
    union {
        double value[BP_W];
        uint64_t bits[BP_W];
    } shifted BP_ALIGNED, power BP_ALIGNED;
    double series[BP_W] BP_ALIGNED;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) {
        /* adding 1.5 * 2^52 rounds to a whole number and puts it into the low bits */
        const double bounded = x[l] > 40.0 ? 40.0 : x[l], z = bounded < -40.0 ? -40.0 : bounded;
        shifted.value[l] = z * 1.4426950408889634 + 6755399441055744.0;
        const double r = z - (shifted.value[l] - 6755399441055744.0) * 0.6931471805599453, rr = r * r;
        const double low = (1.0 + r) + rr * (1.0 / 2 + r * (1.0 / 6));
        const double high = (1.0 / 24 + r * (1.0 / 120)) + rr * ((1.0 / 720 + r * (1.0 / 5040)) + rr * (1.0 / 40320 + r * (1.0 / 362880)));
        series[l] = low + rr * rr * high;
    }
#pragma omp simd
    for (int l = 0; l < BP_W; l++) power.bits[l] = (shifted.bits[l] + UINT64_C(1023)) << 52;
#pragma omp simd
    for (int l = 0; l < BP_W; l++) y[l] = series[l] * power.value[l];
}

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
    BP_NAME(exp)(exponent, factor);
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

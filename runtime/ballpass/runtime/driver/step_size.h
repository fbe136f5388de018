/* Step sizes by the PI controller (Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.2), without a branch: for one run,
   and for a member in each lane with the same bits. */
#ifndef BALLPASS_STEP_SIZE_H
#define BALLPASS_STEP_SIZE_H

#include <float.h>
#include <stdint.h>
#include <string.h>

#define BP_SIZE static inline __attribute__((always_inline))

/* Logarithm of 1e-4: smaller errors of the step before do not tell the controller more. */
static const double BP_LOG_SMALL_ERROR = -9.210340371976182;

BP_SIZE double bp_of_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

BP_SIZE uint64_t bp_bits_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* Natural logarithm of positive numbers and exponential of moderate ones, to 1e-11. */
BP_SIZE double bp_log(double x)
{
    const uint64_t bits = bp_bits_of(x * 1.4142135623730951); /* so that the fraction is about one */
    const double exponent = bp_of_bits((bits >> 52) | UINT64_C(0x4330000000000000));
    const double fraction = bp_of_bits((bits & UINT64_C(0xFFFFFFFFFFFFF)) | UINT64_C(0x3FF0000000000000));
    const double m = fraction * 0.7071067811865476, s = (m - 1.0) / (m + 1.0), z = s * s, zz = z * z;
    /* in pairs: the next step waits for it */
    const double low = (1.0 + z * (1.0 / 3)) + zz * (1.0 / 5 + z * (1.0 / 7));
    const double series = low + zz * zz * ((1.0 / 9 + z * (1.0 / 11)) + zz * (1.0 / 13));
    return (exponent - (4503599627370496.0 + 1023.0)) * 0.6931471805599453 + 2.0 * s * series;
}

BP_SIZE double bp_exp(double x)
{
    /* adding 1.5 * 2^52 rounds to a whole number and puts it into the low bits */
    const double bounded = x > 40.0 ? 40.0 : x, z = bounded < -40.0 ? -40.0 : bounded, shifted = z * 1.4426950408889634 + 6755399441055744.0;
    const double r = z - (shifted - 6755399441055744.0) * 0.6931471805599453, rr = r * r;
    const double low = (1.0 + r) + rr * (1.0 / 2 + r * (1.0 / 6));
    const double high = (1.0 / 24 + r * (1.0 / 120)) + rr * ((1.0 / 720 + r * (1.0 / 5040)) + rr * (1.0 / 40320 + r * (1.0 / 362880)));
    return (low + rr * rr * high) * bp_of_bits((bp_bits_of(shifted) + UINT64_C(1023)) << 52);
}

/* Ratio of the next step to the one tried, which had this scaled error and was accepted or not.

   order            of the error
   rejected_last    whether the step before was rejected: then this one does not grow
   last_error       logarithm of the error of the last accepted step; that of this one where it is accepted */
BP_SIZE double bp_step_factor(double order, double error, double accepted, double rejected_last, double *last_error)
{
    const double least = error > 1e-10 ? error : 1e-10, log_error = bp_log(least <= DBL_MAX ? least : 1.0);
    const double wanted = accepted != 0.0 ? 0.4 * *last_error - 0.7 * log_error : -log_error, factor = 0.9 * bp_exp(wanted / order);
    const double most = rejected_last != 0.0 ? 1.0 : 6.0;
    double up = factor < 0.2 ? 0.2 : factor;
    up = up > most ? most : up;
    /* NaN does not show by how much to shrink */
    double down = error > 1.0 && error <= DBL_MAX ? factor : 0.1;
    down = down < 0.1 ? 0.1 : down;
    down = down > 0.9 ? 0.9 : down;
    const double kept = log_error > BP_LOG_SMALL_ERROR ? log_error : BP_LOG_SMALL_ERROR;
    *last_error = accepted != 0.0 ? kept : *last_error;
    return accepted != 0.0 ? up : down;
}

#endif

/* Roots of loads, without a branch: the compiler makes SIMD lanes of loops around them. */
#ifndef BALLPASS_POWERS_H
#define BALLPASS_POWERS_H

#include <stdint.h>
#include <string.h>

/* 1 / x^(1/n) within a tenth, for 1e-30 <= x <= 1e30: the exponent is divided by n in place. */
static inline double bp_root_guess(double x, int32_t first, int32_t n)
{
    float narrow = (float)x;
    int32_t bits;
    memcpy(&bits, &narrow, sizeof bits);
    bits = first - bits / n;
    memcpy(&narrow, &bits, sizeof narrow);
    return narrow;
}

/* x^(1/3) by two steps of fourth order for its inverse, to 1e-15; x >= 0. */
static inline double bp_cube_root(double x)
{
    const double z = x > 1e-30 ? x : 1e-30;
    double r = bp_root_guess(z, 0x54a1eaaa, 3);
    for (int i = 0; i < 2; i++) {
        const double left = 1.0 - z * (r * r * r);
        r += r * left * (1.0 / 3.0 + left * (2.0 / 9.0 + left * (14.0 / 81.0)));
    }
    return x * (r * r);
}

/* x^(9/10) by Newton's iteration for the inverse of the tenth root. */
static inline double bp_nine_tenths(double x)
{
    const double z = x > 1e-30 ? x : 1e-30;
    double r = bp_root_guess(z, 0x45d23999, 10);
    for (int i = 0; i < 5; i++) {
        const double s = r * r, q = s * s;
        r += r * (1.0 - z * (q * q * s)) * 0.1;
    }
    return x * r;
}

#endif

/* Powers with rational exponents, without a branch: the compiler makes SIMD lanes of loops around them. */
#ifndef BALLPASS_POWERS_H
#define BALLPASS_POWERS_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define BP_POWER static inline __attribute__((always_inline))

/* 1 / x^(1/n) within a tenth, for 1e-30 <= x <= 1e30: the exponent is divided by n in place. */
BP_POWER double bp_root_guess(double x, const int32_t n)
{
    const int32_t first = (int32_t)((1.0 + 1.0 / n) * 1064923135.5); /* the bits of one, less what a straight line is off a logarithm */
    float narrow = (float)x;
    int32_t bits;
    memcpy(&bits, &narrow, sizeof bits);
    bits = first - bits / n;
    memcpy(&narrow, &bits, sizeof narrow);
    return narrow;
}

/* x^n for a constant n >= 0, by squares; a loop, which stays one where it is not unrolled, only for n > 15. */
BP_POWER double bp_whole_power(double x, const int n)
{
    const double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
    double power = n & 1 ? x : 1.0;
    if (n & 2) power *= x2;
    if (n & 4) power *= x4;
    if (n & 8) power *= x8;
    for (int i = 0; i < n / 16; i++) power *= x8 * x8;
    return power;
}

/* A step of fourth order from r towards 1 / x^(1/n). */
BP_POWER double bp_closer_root(double x, const int n, double r)
{
    const double a = 1.0 / n, b = (n + 1.0) / (2.0 * n * n), c = (n + 1.0) * (2.0 * n + 1.0) / (6.0 * n * n * n);
    const double left = 1.0 - x * bp_whole_power(r, n);
    return r + r * left * (a + left * (b + left * c));
}

/* 1 / x^(1/n) for a constant n > 2 and 1e-30 <= x <= 1e30: two steps for a cube root, three for roots up to the twelfth. */
BP_POWER double bp_inverse_root(double x, const int n)
{
    const double r = bp_closer_root(x, n, bp_closer_root(x, n, bp_root_guess(x, n)));
    return n == 3 ? r : bp_closer_root(x, n, r);
}

/* x^(p/q) of constants p, q for x >= 0; where p < 0, or q > 2 and x below 1e-30, as if x were 1e-30 where it is smaller. */
BP_POWER double bp_power(double x, const int p, const int q)
{
    if (q == 1 && p >= 0) return bp_whole_power(x, p);
    const double z = x > 1e-30 ? x : 1e-30;
    if (q <= 2) {
        const int whole = p > 0 ? p / 2 : 0;
        return q == 1 ? 1.0 / bp_whole_power(z, -p) : p > 0 ? bp_whole_power(x, whole) * sqrt(x) : 1.0 / (bp_whole_power(z, -p / 2) * sqrt(z));
    }
    const int above = p > 0 ? (p + q - 1) / q : 0; /* x^(p/q) = x^above / x^(1/q)^(q above - p) */
    const double rest = bp_whole_power(bp_inverse_root(z, q), q * above - p);
    return above > 0 ? bp_whole_power(x, above - 1) * (x * rest) : rest;
}

#endif

/* Sine, cosine and angle without branches and tables, so that the compiler can put several arguments into SIMD lanes.

   Reduction by multiples of pi/2 in three parts of 33 bits (Cody & Waite, Software Manual for the Elementary Functions, 1980): exact
   products for |x| < 1e6, which the driver guarantees by taking phases anew in every segment.  Then the minimax polynomials of
   fdlibm on [-pi/4, pi/4].  Error below 1 ulp of the larger of sine and cosine. */
#ifndef BALLPASS_TRIG_H
#define BALLPASS_TRIG_H

#include <math.h>

static inline void bp_sincos(double x, double *restrict sine, double *restrict cosine)
{
    const double n = rint(x * 6.36619772367581382433e-01);
    const double r = ((x - n * 1.57079632673412561417e+00) - n * 6.07710050630396597660e-11) - n * 2.02226624879595063154e-21;
    const double z = r * r;
    const double s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04
                     + z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    const double half = 0.5 * z, rest = 1.0 - half;
    const double c = rest + (((1.0 - rest) - half) + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03
                     + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09
                     + z * -1.13596475577881948265e-11))))));
    const double quadrant = n - 4.0 * floor(0.25 * n);
    const int odd = quadrant == 1.0 || quadrant == 3.0;
    const double a = odd ? c : s, b = odd ? s : c;
    /* signs as factors: a choice that all lanes share would keep loops over directions out of lanes (gcc sinks the negation) */
    const double centred = quadrant - 1.5;
    *sine = a * (1.0 - 2.0 * floor(0.5 * quadrant));
    *cosine = b * (centred * centred - 1.25);
}

/* Largest angle of bp_turn. */
static const double BP_SMALL_ANGLE = 0.0625;

/* Cosine and sine of c0, s0 turned by a small angle: Taylor's series, their rest below 2^-54. */
static inline void bp_turn(double c0, double s0, double angle, double *restrict cosine, double *restrict sine)
{
    const double z = angle * angle;
    const double s = angle + angle * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (1.0 / 362880.0))));
    const double c = z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0)))); /* less one */
    *cosine = c0 + (c0 * c - s0 * s);
    *sine = s0 + (s0 * c + c0 * s);
}

/* Angle of (x, y), of lanes as well: S. L. Moshier's rational approximation (Cephes, atan.c) on |t| <= 0.66, one division for the reduction.
   Error below 2 ulp; 0 for the origin. */
static inline double bp_atan2(double y, double x)
{
    const double a = fabs(y), b = fabs(x);
    const int steep = a > 2.41421356237309504880 * b, middle = a > 0.66 * b;
    const double above = steep ? -b : middle ? a - b : a, below = steep ? a : middle ? a + b : b;
    const double t = above / (below > 0.0 ? below : 1.0), z = t * t;
    const double p = -6.485021904942025371773e1 + z * (-1.228866684490136173410e2 + z * (-7.500855792314704667340e1
                     + z * (-1.615753718733365076637e1 + z * -8.750608600031904122785e-1)));
    const double q = 1.945506571482613964425e2 + z * (4.853903996359136964868e2 + z * (4.328810604912902668951e2
                     + z * (1.650270098316988542046e2 + z * (2.485846490142306297962e1 + z))));
    const double base = steep ? 1.57079632679489661923 : middle ? 0.78539816339744830962 : 0.0;
    const double rest = steep ? 6.123233995736765886130e-17 : middle ? 3.061616997868382943065e-17 : 0.0;
    const double first = base + (t + (t * (z * p / q) + rest));
    const double half = x < 0.0 ? 3.14159265358979323846 - first : first;
    return y < 0.0 ? -half : half;
}

static inline double bp_sin1(double x)
{
    double sine, cosine;
    bp_sincos(x, &sine, &cosine);
    return sine;
}

static inline double bp_cos1(double x)
{
    double sine, cosine;
    bp_sincos(x, &sine, &cosine);
    return cosine;
}

#endif

/* Steps over the square root of the time from a branch point of the law.

   Behind an onset of contact Hertz's force grows like t^(3/2) and tangent damping like t^(1/2), t the time since: no polynomial in t, and so
   that a method loses its order.  Over s = sqrt(t) both are smooth.  So is the end of a contact, at the time T, over s = sqrt(T - t).
   Where dx/dt = f, dx/ds = dt/ds f, and an explicit method takes that over s as well as the other over t.

   Within a step theta goes evenly in s from 0 to 1, and time by the part theta (lead + (1 - lead) theta) of the step: from (s0 + s1)
   (s1 - s0) = h comes lead = 2 s0 / (s0 + s1).  It is 0 on an onset, 2 for a step that ends with a contact, 1 far from both. */
#ifndef BALLPASS_SQRT_TIME_H
#define BALLPASS_SQRT_TIME_H

#include <math.h>

/* Lead of a step between these distances in time from a branch point. */
static inline double bp_lead(double from, double to)
{
    const double first = sqrt(from), sum = first + sqrt(to);
    return sum > 0.0 ? 2.0 * first / sum : 1.0;
}

/* Part of a step's time that has passed at theta. */
static inline double bp_passed(double lead, double theta) { return theta * (lead + (1.0 - lead) * theta); }

/* How fast time passes there: the slope of that part. */
static inline double bp_pace(double lead, double theta) { return lead + 2.0 * (1.0 - lead) * theta; }

/* The theta at which a part of a step's time has passed. */
static inline double bp_theta(double lead, double part)
{
    if (!(part > 0.0)) return 0.0;
    const double square = lead * lead + 4.0 * (1.0 - lead) * part;
    return 2.0 * part / (lead + sqrt(square > 0.0 ? square : 0.0));
}

#endif

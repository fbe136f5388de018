/* The press by hand: what the generated stepper is measured against, as the limit.

   One model only: crank-slider on its centre line with a balanced crank, eight equal balls with clearance, an elastic outer ring,
   one-sided or tangent damping.  All that this allows is used:

   - loads in closed form, for all stage times of a step in SIMD lanes, with sine and cosine turned on from the step's start;
   - opposite balls share a lane, a square root and a slope: where one is in contact the other is not;
   - the linear system of a stage is solved by hand, down to two equations for the relative motion;
   - vectors of the compiler for the eight states, -ffast-math.

   The methods are those of the stepper: Dormand-Prince 5(4), Rodas4, Rodas5P with their dense output and a PI controller.
   Sources of the coefficients: Hairer & Wanner II (1996), code RODAS; Steinebach, BIT 63 (2023) 27; Dormand & Prince 1980. */
#include <math.h>
#include <string.h>

typedef double v8 __attribute__((vector_size(64)));
typedef double v4 __attribute__((vector_size(32)));

#define INLINE static inline __attribute__((always_inline))

typedef struct {
    double speed, cage_speed, ball_angle;            /* [rad/s], [rad] */
    double crank, rod, rod_centre;                   /* lengths [m] */
    double m_crank, m_rod, j_rod, m_slider, gravity; /* SI */
    double punch, share;                             /* [N], [1] */
    double m_inner, m_outer, stiffness, damping;     /* rings and housing, SI */
    double half_clearance, contact, rate;            /* [m], [N/m^1.5], c_b [N s/m] or beta [s] */
    double tangent;                                  /* 1: rate is beta, else c_b */
    double window[2];                                /* punch acts between these crank angles [rad] */
    double scale[8];                                 /* magnitudes of the states */
} press;

enum { RODAS4 = 1, RODAS5P = 2, DP54 = 3 };

typedef struct {
    long status, steps, rejected, evaluations;
} counts;

/* What holds at one time: ball directions, load on the inner ring; with time derivatives where linearized. */
typedef struct {
    v4 co, si;
    double load[2], load_t[2];
} place;

/* The direction of crank and cage at a step's start, and all that is fixed in a segment. */
typedef struct {
    const press *p;
    double gate;
    double cr, sr, cc, sc; /* cosine and sine: crank, cage */
    double inv_mi, inv_mo;
} segment;

/* ---------------------------------------------------------------------------------------------- loads and directions */

/* cos and sin of a small angle: all stage times of a step at once. */
INLINE void turn(v8 a, v8 *c, v8 *s)
{
    const v8 q = a * a;
    *c = 1.0 - q / 2 * (1.0 - q / 12 * (1.0 - q / 30 * (1.0 - q / 56 * (1.0 - q / 90 * (1.0 - q / 132)))));
    *s = a * (1.0 - q / 6 * (1.0 - q / 20 * (1.0 - q / 42 * (1.0 - q / 72 * (1.0 - q / 110)))));
}

INLINE v8 roots(v8 a)
{
    v8 r;
    for (int k = 0; k < 8; k++) r[k] = sqrt(a[k]);
    return r;
}

INLINE v8 blend(v8 c, v8 s, double c0, double s0) { return c * c0 - s * s0; }

/* Directions after the times h * nodes; large angles take the library's functions. */
INLINE void rotate(double speed, double c0, double s0, v8 dt, v8 *c, v8 *s)
{
    const v8 a = speed * dt;
    v8 ca, sa;
    turn(a, &ca, &sa);
    double largest = 0.0;
    for (int k = 0; k < 8; k++) largest = fmax(largest, fabs(a[k]));
    if (__builtin_expect(largest > 0.3, 0))
        for (int k = 0; k < 8; k++) {
            ca[k] = cos(a[k]);
            sa[k] = sin(a[k]);
        }
    *c = blend(ca, sa, c0, s0);
    *s = blend(sa, -ca, c0, s0);
}

typedef struct {
    v8 cc, sc, cr, sr, x, y;
} lanes;

INLINE void loads(const segment *g, v8 dt, lanes *l)
{
    const press *p = g->p;
    rotate(p->speed, g->cr, g->sr, dt, &l->cr, &l->sr);
    rotate(p->cage_speed, g->cc, g->sc, dt, &l->cc, &l->sc);
    const double w = p->speed, lambda = p->rod_centre / p->rod;
    const v8 x = p->crank * l->cr, y = p->crank * l->sr;           /* crankpin */
    const v8 vx = -w * y, ax = -w * w * x, ay = -w * w * y;
    const v8 span = roots(p->rod * p->rod - x * x), inverse = 1.0 / span;
    const v8 turning = -vx * inverse;                               /* angular velocity of the rod */
    const v8 turning_t = -(ax + x * turning * turning) * inverse;
    const v8 slider = ay - vx * turning - x * turning_t;            /* acceleration of the slider */
    const v8 gx = (1.0 - lambda) * ax, gy = (1.0 - lambda) * ay + lambda * slider;
    const v8 qy = g->gate * p->punch - p->m_slider * (slider + p->gravity);
    const v8 moment = x * (qy - lambda * p->m_rod * (p->gravity + gy)) + p->j_rod * turning_t + p->m_rod * lambda * span * gx;
    l->x = p->share * (moment * inverse - p->m_rod * gx);
    l->y = p->share * (qy - p->m_rod * (gy + p->gravity) - p->m_crank * p->gravity);
}

/* Load and its time derivative at the directions of the segment's present time. */
INLINE void load_and_rate(const segment *g, place *at)
{
    const press *p = g->p;
    const double w = p->speed, lambda = p->rod_centre / p->rod;
    const double x = p->crank * g->cr, y = p->crank * g->sr, vx = -w * y, vy = w * x;
    const double ax = -w * w * x, ay = -w * w * y, jx = -w * w * vx, jy = -w * w * vy;
    const double span = sqrt(p->rod * p->rod - x * x), inverse = 1.0 / span;
    const double a1 = -vx * inverse, a2 = -(ax + x * a1 * a1) * inverse, span1 = x * a1;
    const double a3 = -(jx + vx * a1 * a1 + 2.0 * x * a1 * a2 + a2 * span1) * inverse;
    const double slider = ay - vx * a1 - x * a2, slider1 = jy - (ax * a1 + 2.0 * vx * a2 + x * a3);
    const double gx = (1.0 - lambda) * ax, gy = (1.0 - lambda) * ay + lambda * slider;
    const double gx1 = (1.0 - lambda) * jx, gy1 = (1.0 - lambda) * jy + lambda * slider1;
    const double qy = g->gate * p->punch - p->m_slider * (slider + p->gravity), qy1 = -p->m_slider * slider1;
    const double inner = qy - lambda * p->m_rod * (p->gravity + gy), inner1 = qy1 - lambda * p->m_rod * gy1;
    const double moment = x * inner + p->j_rod * a2 + p->m_rod * lambda * span * gx;
    const double moment1 = vx * inner + x * inner1 + p->j_rod * a3 + p->m_rod * lambda * (span1 * gx + span * gx1);
    at->load[0] = p->share * (moment * inverse - p->m_rod * gx);
    at->load[1] = p->share * (qy - p->m_rod * (gy + p->gravity) - p->m_crank * p->gravity);
    at->load_t[0] = p->share * ((moment1 - moment * inverse * span1) * inverse - p->m_rod * gx1);
    at->load_t[1] = p->share * (qy1 - p->m_rod * gy1);
}

#define HALF 0.70710678118654752440

INLINE void directions(double cc, double sc, place *at)
{
    const v4 c0 = {1.0, HALF, 0.0, -HALF}, s0 = {0.0, HALF, 1.0, HALF};
    at->co = c0 * cc - s0 * sc;
    at->si = s0 * cc + c0 * sc;
}

INLINE void pick(const lanes *l, int k, place *at)
{
    directions(l->cc[k], l->sc[k], at);
    at->load[0] = l->x[k];
    at->load[1] = l->y[k];
}

/* ---------------------------------------------------------------------------------------------------------- the balls */

INLINE double total(v4 a) { return (a[0] + a[2]) + (a[1] + a[3]); }

/* Force of a pair of opposite balls along the first one's direction; `root` is the root of the deflection. */
INLINE v4 pair(const press *p, v4 s, v4 d, v4 *deflection, v4 *root)
{
    v4 size, sign;
    for (int k = 0; k < 4; k++) {
        size[k] = fmax(fabs(s[k]) - p->half_clearance, 0.0);
        (*root)[k] = sqrt(size[k]);
        sign[k] = copysign(1.0, s[k]);
    }
    *deflection = size;
    if (p->tangent != 0.0) return p->contact * *root * (size * sign + 1.5 * p->rate * d);
    return p->contact * *root * size * sign + p->rate * d;
}

INLINE v8 rate(const segment *g, const place *at, v8 y)
{
    const press *p = g->p;
    const double rx = y[0] - y[2], ry = y[1] - y[3], w = p->cage_speed;
    const double vx = y[4] - y[6] + w * ry, vy = y[5] - y[7] - w * rx;
    const v4 s = rx * at->co + ry * at->si, d = vx * at->co + vy * at->si;
    v4 size, root;
    const v4 f = pair(p, s, d, &size, &root);
    const double fx = total(f * at->co), fy = total(f * at->si);
    return (v8){y[4], y[5], y[6], y[7], (at->load[0] - fx) * g->inv_mi, (at->load[1] - fy) * g->inv_mi,
                (fx - p->stiffness * y[2] - p->damping * y[6]) * g->inv_mo,
                (fy - p->stiffness * y[3] - p->damping * y[7]) * g->inv_mo};
}

/* Slopes of the ball forces by relative position (row-major) and velocity (symmetric), and accelerations' time derivative. */
typedef struct {
    double r[4], v[3], t[4];
} slopes;

INLINE v8 linearize(const segment *g, const place *at, v8 y, slopes *j)
{
    const press *p = g->p;
    const double rx = y[0] - y[2], ry = y[1] - y[3], w = p->cage_speed;
    const double vx = y[4] - y[6] + w * ry, vy = y[5] - y[7] - w * rx;
    const v4 co = at->co, si = at->si, s = rx * co + ry * si, d = vx * co + vy * si;
    v4 size, root, fs, fd;
    const v4 f = pair(p, s, d, &size, &root);
    if (p->tangent != 0.0) {
        for (int k = 0; k < 4; k++) {
            const double sign = copysign(1.0, s[k]);
            fs[k] = size[k] > 0.0 ? p->contact * (1.5 * root[k] + 0.75 * p->rate * sign * d[k] / root[k]) : 0.0;
        }
        fd = 1.5 * p->rate * p->contact * root;
    } else {
        fs = 1.5 * p->contact * root;
        fd = (v4){p->rate, p->rate, p->rate, p->rate};
    }
    const double fx = total(f * co), fy = total(f * si);
    const v4 sx = fs * co - w * fd * si, sy = fs * si + w * fd * co;
    j->r[0] = total(sx * co);
    j->r[1] = total(sy * co);
    j->r[2] = total(sx * si);
    j->r[3] = total(sy * si);
    j->v[0] = total(fd * co * co);
    j->v[1] = total(fd * co * si);
    j->v[2] = total(fd * si * si);
    const v4 along = w * (fs * (ry * co - rx * si) + fd * (vy * co - vx * si));
    const double tx = total(along * co) - w * fy, ty = total(along * si) + w * fx;
    j->t[0] = (at->load_t[0] - tx) * g->inv_mi;
    j->t[1] = (at->load_t[1] - ty) * g->inv_mi;
    j->t[2] = tx * g->inv_mo;
    j->t[3] = ty * g->inv_mo;
    return (v8){y[4], y[5], y[6], y[7], (at->load[0] - fx) * g->inv_mi, (at->load[1] - fy) * g->inv_mi,
                (fx - p->stiffness * y[2] - p->damping * y[6]) * g->inv_mo,
                (fy - p->stiffness * y[3] - p->damping * y[7]) * g->inv_mo};
}

INLINE double size_of(v8 e, v8 weight)
{
    const v8 q = e * weight;
    double sum = 0.0;
    for (int k = 0; k < 8; k++) sum += q[k] * q[k];
    return sqrt(sum * 0.125);
}

/* --------------------------------------------------------------------------------------------------------- the methods */

/* Rosenbrock: lane[i] is the lane of a stage's time among `times`, -1 the start; the last lane is the step's end. */
typedef struct {
    double gamma, order;
    v8 times;
    int lane[8], end;
    double d[8], a[8][8], c[8][8], m[8], dense[3][8];
} implicit;

static const implicit rodas4 = {
    .gamma = 0.25, .order = 4.0, .times = {0.386, 0.21, 0.63, 1.0, 1.0, 1.0, 1.0, 1.0}, .lane = {-1, 0, 1, 2, 3, 3}, .end = 3,
    .d = {0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0},
    .a = {{0.0}, {1.544}, {0.9466785280815826, 0.2557011698983284}, {3.314825187068521, 2.896124015972201, 0.9986419139977817},
        {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895}, {1.221224509226641, 6.019134481288629,
        12.53708332932087, -0.687886036105895, 1.0}},
    .c = {{0.0}, {-5.6688}, {-2.430093356833875, -0.2063599157091915}, {-0.1073529058151375, -9.594562251023355,
        -20.47028614809616}, {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.7089089320616}, {8.083246795921522,
        -7.981132988064893, -31.52159432874371, 16.31930543123136, -6.058818238834054}},
    .m = {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.687886036105895, 1.0, 1.0},
    .dense = {{10.12623508344586, -7.487995877610167, -34.80091861555747, -7.992771707568823, 1.025137723295662, 0.0},
        {-0.6762803392801253, 6.087714651680015, 16.43084320892478, 24.76722511418386, -6.594389125716872, 0.0}},
};

static const implicit rodas5p = {
    .gamma = 0.21193756319429014, .order = 5.0,
    .times = {0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1.0, 1.0, 1.0, 1.0},
    .lane = {-1, 0, 1, 2, 3, 4, 4, 4}, .end = 4,
    .d = {0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734, 2.325825639765069, 0.0, 0.0, 0.0},
    .a = {{0.0}, {3.0}, {2.849394379747939, 0.45842242204463923}, {-6.954028509809101, 2.489845061869568, -10.358996098473584},
        {2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641}, {-7.502846399306121,
        2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946}, {-7.502846399306121,
        2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0}, {-7.502846399306121,
        2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 1.0}},
    .c = {{0.0}, {-14.155112264123755}, {-17.97296035885952, -2.859693295451294}, {147.12150275711716, -1.41221402718213,
        71.68940251302358}, {165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306},
        {24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125, -0.6610691825249471},
        {30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783, -19.097331116725623,
        -28.087943162872662}, {37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047, -40.06618937091002,
        -54.66780262877968, -9.48861652309627}},
    .m = {-7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256, 0.030198172008377946, 1.0, 1.0,
        1.0},
    .dense = {{25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204, 0.524948541321073,
        1.1241088310450404, 0.4272876194431874, -0.17202221070155493}, {-9.91568850695171, -0.9689944594115154,
        3.0438037242978453, -24.495224566215796, 20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372},
        {11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643, -52.072871366152654, -59.78993625266729,
        -0.15582684282751913, 4.883087185713722}},
};

static const v8 dp54_times = {0.2, 0.3, 0.8, 0.8888888888888888, 1.0, 1.0, 1.0, 1.0};
static const double dp54_a[7][6] = {{0.0}, {0.2}, {0.075, 0.225}, {0.9777777777777777, -3.7333333333333334, 3.5555555555555554},
    {2.9525986892242035, -11.595793324188385, 9.822892851699436, -0.2908093278463649}, {2.8462752525252526, -10.757575757575758,
    8.906422717743473, 0.2784090909090909, -0.2735313036020583}, {0.09114583333333333, 0.0, 0.44923629829290207,
    0.6510416666666666, -0.322376179245283, 0.13095238095238096}};
static const double dp54_e[7] = {0.0012326388888888888, 0.0, -0.0042527702905061394, 0.03697916666666667, -0.05086379716981132,
    0.0419047619047619, -0.025};
static const double dp54_d[7] = {-1.1270175653862835, 0.0, 2.675424484351598, -5.685526961588504, 3.5219323679207912,
    -1.7672812570757455, 2.382468931778144};

typedef struct {
    v8 u[8];       /* stages or slopes */
    slopes j;
    place start;
    v8 f;          /* rate at the start */
    lanes l;
    v8 dense[3];
} work;

INLINE double implicit_step(const implicit *m, const int stages, work *k, const segment *g, v8 x, double h, v8 weight, v8 *next)
{
    const press *p = g->p;
    const double s = 1.0 / (h * m->gamma), is = h * m->gamma, ih = 1.0 / h;
    /* z + mu (V + R / s) z = right side, for z the relative velocity part of a stage */
    const double outer = 1.0 / (s + (p->damping + p->stiffness * is) * g->inv_mo), mi = g->inv_mi * is, mo = g->inv_mo * outer;
    const double mu = mi + mo;
    const double m00 = k->j.v[0] + k->j.r[0] * is, m01 = k->j.v[1] + k->j.r[1] * is;
    const double m10 = k->j.v[1] + k->j.r[2] * is, m11 = k->j.v[2] + k->j.r[3] * is;
    const double b00 = 1.0 + mu * m00, b01 = mu * m01, b10 = mu * m10, b11 = 1.0 + mu * m11;
    const double det = 1.0 / (b00 * b11 - b01 * b10);
    const double n00 = (m00 * b11 - m01 * b10) * det, n01 = (m01 * b00 - m00 * b01) * det;
    const double n10 = (m10 * b11 - m11 * b10) * det, n11 = (m11 * b00 - m10 * b01) * det;
    loads(g, h * m->times, &k->l);
#pragma GCC unroll 8
    for (int i = 0; i < stages; i++) {
        v8 y = x, R = {0}, f = k->f;
#pragma GCC unroll 8
        for (int j = 0; j < i; j++) {
            y += m->a[i][j] * k->u[j];
            R += m->c[i][j] * k->u[j];
        }
        if (i > 0) {
            place at;
            pick(&k->l, m->lane[i], &at);
            f = rate(g, &at, y);
        }
        R = R * ih + f;
        const double qx = (R[0] - R[2]) * is, qy = (R[1] - R[3]) * is, d = h * m->d[i];
        const double fx = k->j.r[0] * qx + k->j.r[1] * qy, fy = k->j.r[2] * qx + k->j.r[3] * qy;
        const double ix = R[4] + d * k->j.t[0] - fx * g->inv_mi, iy = R[5] + d * k->j.t[1] - fy * g->inv_mi;
        const double ox = R[6] + d * k->j.t[2] + (fx - p->stiffness * R[2] * is) * g->inv_mo;
        const double oy = R[7] + d * k->j.t[3] + (fy - p->stiffness * R[3] * is) * g->inv_mo;
        const double zx = ix * is - ox * outer, zy = iy * is - oy * outer;
        const double wx = n00 * zx + n01 * zy, wy = n10 * zx + n11 * zy;
        const v8 kv = {0, 0, 0, 0, ix * is - wx * mi, iy * is - wy * mi, ox * outer + wx * mo, oy * outer + wy * mo};
        k->u[i] = (v8){(R[0] + kv[4]) * is, (R[1] + kv[5]) * is, (R[2] + kv[6]) * is, (R[3] + kv[7]) * is,
                       kv[4], kv[5], kv[6], kv[7]};
    }
    v8 end = x;
#pragma GCC unroll 8
    for (int i = 0; i < stages; i++) end += m->m[i] * k->u[i];
    *next = end;
    return size_of(k->u[stages - 1], weight);
}

INLINE double explicit_step(work *k, const segment *g, v8 x, double h, v8 weight, v8 *next)
{
    place at;
    loads(g, h * dp54_times, &k->l);
#pragma GCC unroll 8
    for (int i = 1; i < 7; i++) {
        v8 y = {0};
#pragma GCC unroll 8
        for (int j = 0; j < i; j++) y += dp54_a[i][j] * k->u[j];
        y = x + h * y;
        if (i < 6) pick(&k->l, i - 1 < 4 ? i - 1 : 4, &at);
        k->u[i] = rate(g, &at, y);
        if (i == 6) *next = y;
    }
    v8 e = {0};
    for (int j = 0; j < 7; j++) e += (h * dp54_e[j]) * k->u[j];
    return size_of(e, weight);
}

/* ------------------------------------------------------------------------------------------------------------ the loop */

typedef struct {
    long next, count;
    const double *times;
    double *states; /* rows of eight, not aligned */
} outputs;

INLINE void advance(segment *g, const lanes *l, int end)
{
    g->cr = l->cr[end];
    g->sr = l->sr[end];
    g->cc = l->cc[end];
    g->sc = l->sc[end];
}

INLINE void write(const int method, work *k, outputs *o, double start, double t, double h, v8 x, v8 next, double end)
{
    if (o->next >= o->count || o->times[o->next] > end) return;
    const v8 delta = next - x;
    if (method == DP54) {
        k->dense[0] = h * k->u[0] - delta;
        k->dense[1] = 2.0 * delta - h * (k->u[0] + k->u[6]);
        k->dense[2] = (v8){0};
        for (int j = 0; j < 7; j++) k->dense[2] += (h * dp54_d[j]) * k->u[j];
    } else {
        const implicit *m = method == RODAS4 ? &rodas4 : &rodas5p;
        for (int r = 0; r < 3; r++) {
            k->dense[r] = (v8){0};
            for (int i = 0; i < (method == RODAS4 ? 6 : 8); i++) k->dense[r] += m->dense[r][i] * k->u[i];
        }
    }
    const double ih = 1.0 / h;
    for (; o->next < o->count && o->times[o->next] <= end; o->next++) {
        const double theta = (o->times[o->next] - start - t) * ih, rest = 1.0 - theta;
        v8 inner;
        if (method == DP54) inner = delta + rest * (k->dense[0] + theta * (k->dense[1] + rest * k->dense[2]));
        else inner = delta + rest * (k->dense[0] + theta * (k->dense[1] + theta * k->dense[2]));
        const v8 y = x + theta * inner;
        memcpy(o->states + 8 * o->next, &y, sizeof y);
    }
}

/* One segment with the punch on or off; its step size is estimated anew at its start. */
INLINE int run(const int method, const press *p, double gate, double start, double end, v8 *state, v8 weight, outputs *o, counts *n)
{
    segment g = {.p = p, .gate = gate, .inv_mi = 1.0 / p->m_inner, .inv_mo = 1.0 / p->m_outer};
    g.cr = cos(p->speed * start);
    g.sr = sin(p->speed * start);
    g.cc = cos(p->ball_angle + p->cage_speed * start);
    g.sc = sin(p->ball_angle + p->cage_speed * start);
    const implicit *m = method == RODAS4 ? &rodas4 : &rodas5p;
    const int stages = method == RODAS4 ? 6 : 8, last_lane = method == DP54 ? 4 : m->end;
    const float q = method == DP54 ? 5.0f : (float)m->order;
    const double length = end - start;
    work k;
    v8 x = *state, next;
    directions(g.cc, g.sc, &k.start);
    load_and_rate(&g, &k.start);
    k.f = method == DP54 ? rate(&g, &k.start, x) : linearize(&g, &k.start, x, &k.j);
    /* initial step: Hairer, Norsett & Wanner I, section II.4 */
    double step;
    {
        const double slope = size_of(k.f, weight), size = size_of(x, weight);
        step = size > 1e-5 && slope > 1e-5 ? 0.01 * size / slope : 1e-6 * length;
        if (slope > 0.0 && step < 1.0 / slope) step = 1.0 / slope;
        if (step > length) step = length;
        loads(&g, step * (v8){1, 1, 1, 1, 1, 1, 1, 1}, &k.l);
        place at;
        pick(&k.l, 0, &at);
        const v8 change = (rate(&g, &at, x + step * k.f) - k.f) / step;
        const double curve = size_of(change, weight), larger = curve > slope ? curve : slope;
        const double second = larger > 1e-15 ? pow(0.01 / larger, 1.0 / q) : step * 1e-3;
        step = fmin(fmin(100.0 * step, second), length);
    }
    n->evaluations += 2;
    double t = 0.0;
    float last_error = 1e-4f;
    int rejected = 0;
    k.u[0] = k.f;
    while (t < length) {
        double h = step;
        const double left = length - t;
        const int last = h * 1.0001 >= left;
        if (last) h = left;
        else if (2.0 * h > left) h = 0.5 * left;
        double error;
        if (method == DP54) error = explicit_step(&k, &g, x, h, weight, &next);
        else if (method == RODAS4) error = implicit_step(m, 6, &k, &g, x, h, weight, &next);
        else error = implicit_step(m, 8, &k, &g, x, h, weight, &next);
        n->evaluations += method == DP54 ? 6 : stages - 1;
        if (error <= 1.0) {
            const float e = fmaxf((float)error, 1e-10f);
            float factor = 0.9f * exp2f((-0.7f * log2f(e) + 0.4f * log2f(last_error)) / q);
            factor = factor > 6.0f ? 6.0f : factor < 0.2f ? 0.2f : factor;
            if (rejected && factor > 1.0f) factor = 1.0f;
            last_error = fmaxf(e, 1e-4f);
            n->steps++;
            write(method, &k, o, start, t, h, x, next, last ? end : start + t + h);
            x = next;
            t = last ? length : t + h;
            step = h * factor;
            rejected = 0;
            advance(&g, &k.l, last_lane);
            if (method == DP54) {
                k.u[0] = k.u[6];
            } else if (!last) {
                directions(g.cc, g.sc, &k.start);
                load_and_rate(&g, &k.start);
                k.f = linearize(&g, &k.start, x, &k.j);
                n->evaluations++;
            }
        } else {
            double factor = 0.9 * pow(error, -1.0 / q);
            factor = factor < 0.1 ? 0.1 : factor > 0.9 ? 0.9 : factor;
            if (!(factor == factor)) factor = 0.1;
            n->rejected++;
            rejected = 1;
            step = h * factor;
            if (!(step > 1e-14 * length)) return 1;
        }
    }
    *state = x;
    return 0;
}

INLINE int cycle(const int method, const press *p, v8 *x, double from, double to, v8 weight, outputs *o, counts *n)
{
    const double edges[4] = {from, p->window[0] / p->speed, p->window[1] / p->speed, to};
    for (int i = 0; i < 3; i++)
        if (run(method, p, i == 1, edges[i], edges[i + 1], x, weight, o, n)) return 1;
    return 0;
}

/* One turn of the crank from angle 0; `states` has room for `count` rows of eight.  Returns 0 when done. */
int press_cycle(int method, double tolerance, const press *p, double *x, double to, long count, const double *times, double *states,
                counts *n)
{
    v8 state, weight;
    memcpy(&state, x, sizeof state);
    for (int k = 0; k < 8; k++) weight[k] = 1.0 / (tolerance * p->scale[k]);
    outputs o = {.count = count, .times = times, .states = states};
    memset(n, 0, sizeof *n);
    if (method == DP54) n->status = cycle(DP54, p, &state, 0.0, to, weight, &o, n);
    else if (method == RODAS4) n->status = cycle(RODAS4, p, &state, 0.0, to, weight, &o, n);
    else n->status = cycle(RODAS5P, p, &state, 0.0, to, weight, &o, n);
    memcpy(x, &state, sizeof state);
    return (int)n->status;
}

/* dx/dt; also what CVODE calls. */
void press_rate(const press *p, double gate, double t, const double *x, double *dx)
{
    segment g = {.p = p, .gate = gate, .inv_mi = 1.0 / p->m_inner, .inv_mo = 1.0 / p->m_outer};
    g.cr = cos(p->speed * t);
    g.sr = sin(p->speed * t);
    g.cc = cos(p->ball_angle + p->cage_speed * t);
    g.sc = sin(p->ball_angle + p->cage_speed * t);
    place at;
    directions(g.cc, g.sc, &at);
    load_and_rate(&g, &at);
    v8 y, f;
    memcpy(&y, x, sizeof y);
    f = rate(&g, &at, y);
    memcpy(dx, &f, sizeof f);
}

/* The rate of `count` states after one another, each changed a little by the one before: nothing can be left out. */
double press_rates(const press *p, double gate, double t, double dt, long count, const double *x)
{
    double y[8], dx[8];
    memcpy(y, x, sizeof y);
    for (long k = 0; k < count; k++) {
        press_rate(p, gate, t + (double)k * dt, y, dx);
        for (int i = 0; i < 8; i++) y[i] = x[i] + 1e-12 * dx[i];
    }
    return y[0];
}

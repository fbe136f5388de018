/* See schedule.h.  Angles are reduced modulo a turn here, so that the model sees small arguments in the thousandth turn as well. */
#include "schedule.h"

#include <math.h>
#include <stdlib.h>

#define TURN 6.283185307179586476925286766559

/* Angles closer than this are one angle [rad]: an edge hit by rounding belongs to the window that starts there. */
static const double ANGLE_RESOLUTION = 1e-11;

/* Times closer than this fraction of the run are one time. */
static const double TIME_RESOLUTION = 1e-12;

/* Largest angle that a phase may reach within a segment [rad]. */
static const double LARGEST_PHASE = 1e6;

typedef struct {
    double *times;
    long count, room;
    int short_of_memory;
} time_list;

static void add(time_list *list, double time)
{
    if (list->count == list->room) {
        const long room = list->room ? 2 * list->room : 64;
        double *moved = realloc(list->times, (size_t)room * sizeof *moved);
        if (!moved) {
            list->short_of_memory = 1;
            return;
        }
        list->times = moved;
        list->room = room;
    }
    list->times[list->count++] = time;
}

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Remainder with the sign of the divisor, which is positive. */
static double modulo(double a, double b)
{
    const double rest = fmod(a, b);
    return rest < 0.0 ? rest + b : rest;
}

/* Start in [0, 2 pi) and width of a window; an end before the start lies in the next turn. */
static void window(double first, double last, double *start, double *width)
{
    double wide = last - first;
    if (wide < 0.0) {
        wide = modulo(wide, TURN);
        if (TURN - wide < ANGLE_RESOLUTION) wide = 0.0;
    } else if (wide > TURN - ANGLE_RESOLUTION) {
        wide = TURN;
    }
    *start = modulo(first, TURN);
    *width = wide;
}

/* A number and its derivative along a direction. */
typedef struct {
    double v, d;
} dual;

static dual number(const double *values, const double *moved, int place)
{
    return place < 0 ? (dual){0.0, 0.0} : (dual){values[place], moved ? moved[place] : 0.0};
}

static dual plus(dual a, dual b) { return (dual){a.v + b.v, a.d + b.d}; }
static dual minus(dual a, dual b) { return (dual){a.v - b.v, a.d - b.d}; }
static dual times(dual a, dual b) { return (dual){a.v * b.v, a.v * b.d + a.d * b.v}; }
static dual over(dual a, dual b)
{
    const double q = a.v / b.v;
    return (dual){q, (a.d - q * b.d) / b.v};
}

/* A piece of a turning: angle + rate s + half s^2 with s = t - begin, up to its end; `passed` since the first piece. */
typedef struct {
    dual begin, passed, angle, rate, half;
    double end;
} piece;

/* The piece of a table behind a time: its row, and the slope there, zero outside of the rows. */
static int row_behind(int rows, const int *at, const int *heights, const double *values, const double *moved, double begin, dual *slope)
{
    int k = 0;
    *slope = (dual){0.0, 0.0};
    while (k < rows && values[at[k]] <= begin) k++;
    if (k > 0 && k < rows)
        *slope = over(minus(number(values, moved, heights[k]), number(values, moved, heights[k - 1])),
                      minus(number(values, moved, at[k]), number(values, moved, at[k - 1])));
    return k > 0 ? k - 1 : 0;
}

/* The next row behind a time, in place of `next` where it is nearer. */
static void next_row(int rows, const int *at, const double *values, double begin, int *next)
{
    for (int k = 0; k < rows; k++)
        if (values[at[k]] > begin && (*next < 0 || values[at[k]] < values[*next])) *next = at[k];
}

/* The first piece, or the one behind a piece; 0 where that was the last. */
static int next_piece(const schedule_turning *turning, const double *values, const double *moved, int first, piece *p)
{
    const int live = turning->live >= 0 && isfinite(values[turning->live]);
    const dual offset = minus(number(values, moved, turning->offset), live ? (dual){0.0, 0.0} : number(values, moved, turning->lag));
    if (!first && isinf(p->end)) return 0;
    if (turning->turns < 0 && !turning->rows && !live) {
        *p = (piece){.angle = offset, .rate = number(values, moved, turning->rate), .end = INFINITY};
        return 1;
    }
    int next = -1;
    const double origin = live ? values[turning->live] : 0.0, from = first ? origin : p->end;
    if (!live) next_row(turning->rows, turning->times, values, from, &next);
    next_row(turning->lag_rows, turning->lag_times, values, from, &next);
    if (first) {
        p->begin = (dual){origin, 0.0};
        p->passed = (dual){0.0, 0.0};
    } else {
        int here = -1; /* the row that the last piece ended on */
        for (int k = 0; k < turning->rows && !live && here < 0; k++)
            if (values[turning->times[k]] == p->end) here = turning->times[k];
        for (int k = 0; k < turning->lag_rows && here < 0; k++)
            if (values[turning->lag_times[k]] == p->end) here = turning->lag_times[k];
        const dual end = number(values, moved, here), length = minus(end, p->begin);
        p->passed = plus(p->passed, times(length, plus(p->rate, times(length, p->half))));
        p->begin = end;
    }
    dual slope, slower, speed = {0.0, 0.0};
    if (live) {
        slope = (dual){values[turning->live + 2], 0.0};
        speed = (dual){values[turning->live + 1] + slope.v * (p->begin.v - origin), 0.0};
    } else {
        const int row = row_behind(turning->rows, turning->times, turning->speeds, values, moved, p->begin.v, &slope);
        if (turning->speeds) speed = number(values, moved, turning->speeds[row]);
        if (turning->rows) speed = plus(speed, times(slope, minus(p->begin, number(values, moved, turning->times[row]))));
    }
    row_behind(turning->lag_rows, turning->lag_times, turning->lags, values, moved, p->begin.v, &slower);
    const dual all = turning->turns < 0 ? (dual){1.0, 0.0} : number(values, moved, turning->turns);
    const dual turned = minus(all, times(number(values, moved, turning->rolling), slower));
    p->angle = plus(offset, p->passed);
    p->rate = times(turned, speed);
    p->half = times(times((dual){0.5, 0.0}, turned), slope);
    p->end = next < 0 ? INFINITY : values[next];
    return 1;
}

/* The piece that holds at a time. */
static piece piece_at(const schedule_turning *turning, const double *values, const double *moved, double inside)
{
    piece p = {.end = 0.0};
    for (int more = next_piece(turning, values, moved, 1, &p); more && p.end <= inside;) more = next_piece(turning, values, moved, 0, &p);
    return p;
}

static dual angle_of(const piece *p, double t)
{
    const dual s = minus((dual){t, 0.0}, p->begin);
    return plus(p->angle, times(s, plus(p->rate, times(s, p->half))));
}

static dual rate_of(const piece *p, double t)
{
    return plus(p->rate, times(times((dual){2.0, 0.0}, minus((dual){t, 0.0}, p->begin)), p->half));
}

void schedule_angle(const schedule_turning *turning, const double *values, double t, double *angle, double *rate)
{
    const piece p = piece_at(turning, values, NULL, t);
    if (angle) *angle = angle_of(&p, t).v;
    if (rate) *rate = rate_of(&p, t).v;
}

/* Times in a part of a piece, in which it grows or falls, at which `parts` times the angle passes an edge modulo a period. */
static void add_within(time_list *list, const piece *p, double parts, double edge, double period, double left, double right)
{
    const double begin = p->begin.v, angle = parts * p->angle.v, rate = parts * p->rate.v, half = parts * p->half.v;
    if (rate == 0.0 && half == 0.0) return;
    const double s = left - begin, u = right - begin;
    const double a = (angle + s * (rate + s * half) - edge) / period, b = (angle + u * (rate + u * half) - edge) / period;
    const double first = ceil((a < b ? a : b) - 1e-9), last = floor((a < b ? b : a) + 1e-9);
    const double sense = copysign(1.0, rate + 2.0 * half * (0.5 * (left + right) - begin));
    for (double whole = first; whole <= last && !list->short_of_memory; whole += 1.0) {
        const double ahead = (edge - angle) + period * whole;
        double time = begin + ahead / rate;
        if (half != 0.0) {
            const double square = rate * rate + 4.0 * half * ahead, slower = rate + sense * sqrt(square > 0.0 ? square : 0.0);
            time = slower == 0.0 ? begin - 0.5 * rate / half : begin + 2.0 * ahead / slower;
        }
        add(list, time < left ? left : time > right ? right : time);
    }
}

/* Where a piece turns back; its begin where it does not. */
static double turning_back(const piece *p)
{
    const double back = p->begin.v - 0.5 * p->rate.v / p->half.v;
    return p->half.v != 0.0 && p->begin.v < back && back < p->end ? back : p->begin.v;
}

double schedule_turns(const schedule_turning *turning, const double *values, double most, double *end)
{
    double made = 0.0;
    piece p = {.end = 0.0};
    for (int more = next_piece(turning, values, NULL, 1, &p); more && p.begin.v < *end; more = next_piece(turning, values, NULL, 0, &p)) {
        const double parts[] = {p.begin.v, turning_back(&p), p.end < *end ? p.end : *end};
        for (int k = 0; k < 2; k++) {
            const double left = parts[k], right = parts[k + 1];
            if (right <= left) continue;
            const double rate = rate_of(&p, left).v, half = p.half.v, length = right - left;
            const double middle = isfinite(length) ? rate + half * length : rate;
            const double sense = copysign(1.0, middle), passed = middle == 0.0 ? 0.0 : fabs(middle) * length / TURN;
            if (made + passed >= most) {
                const double ahead = sense * TURN * (most - made), square = rate * rate + 4.0 * half * ahead;
                *end = left + (ahead == 0.0 ? 0.0 : 2.0 * ahead / (rate + sense * sqrt(square > 0.0 ? square : 0.0)));
                return most;
            }
            made += passed;
        }
    }
    return made;
}

/* Times in [begin, end] at which it does so. */
static void add_passages(time_list *list, const schedule_turning *turning, const double *values, double parts, double edge, double period,
                         double begin, double end)
{
    piece p = {.end = 0.0};
    double from = begin;
    for (int more = next_piece(turning, values, NULL, 1, &p); more && from < end; more = next_piece(turning, values, NULL, 0, &p)) {
        const double to = p.end < end ? p.end : end, back = turning_back(&p);
        if (to <= from) continue;
        const int split = from < back && back < to;
        add_within(list, &p, parts, edge, period, from, split ? back : to);
        if (split) add_within(list, &p, parts, edge, period, back, to);
        from = to;
    }
}

static int covers(double angle, double start, double width)
{
    if (width <= 0.0 || width >= TURN) return width >= TURN;
    double past = modulo(angle - start, TURN);
    if (TURN - past < ANGLE_RESOLUTION) past = 0.0;
    return past < width - ANGLE_RESOLUTION;
}

/* The interval of a table in which an argument lies: number of knots at or before it. */
static int knots_before(const schedule_input *input, const double *values, double argument)
{
    int before = 0;
    while (before < input->knots && values[input->times[before]] <= argument) before++;
    return before;
}

/* Value at t of the piece of a table that holds at `inside`, or its slope, with its derivative.  A table over an angle is periodic: its last
   knot joins the first. */
static dual table(const schedule_scene *scene, const schedule_input *input, const double *values, const double *moved, double t, double inside)
{
    const int over_angle = input->turning >= 0, slope_only = input->kind == SCHEDULE_TABLE_RATE;
    double argument = inside;
    dual at = {t, 0.0};
    const double period = input->turns * TURN;
    if (over_angle) {
        const piece p = piece_at(&scene->turnings[input->turning], values, moved, inside);
        const double first = values[input->times[0]], angle = angle_of(&p, inside).v;
        double past = modulo(angle - first, period);
        if (period - past < ANGLE_RESOLUTION) past = 0.0;
        argument = first + past;
        at = angle_of(&p, t);
        at.v = argument + (at.v - angle);
    }
    const int k = knots_before(input, values, argument), last = k == input->knots;
    const int left = k > 0 ? k - 1 : 0, right = last ? 0 : k;
    const dual low = number(values, moved, input->heights[left]);
    if (!over_angle && (k == 0 || last)) return slope_only ? (dual){0.0, 0.0} : low;
    const dual begin = number(values, moved, input->times[left]);
    dual end = number(values, moved, input->times[right]);
    if (last) end.v += period;
    const dual slope = over(minus(number(values, moved, input->heights[right]), low), minus(end, begin));
    return slope_only ? slope : plus(low, times(slope, minus(at, begin)));
}

/* An input for a segment that starts at t, with its derivative; gates have none. */
static dual input_at(const schedule_scene *scene, const schedule_input *input, const double *values, const double *moved, double t, double inside)
{
    if (input->kind == SCHEDULE_BORDER) return (dual){0.0, 0.0};
    if (input->kind == SCHEDULE_TABLE || input->kind == SCHEDULE_TABLE_RATE) return table(scene, input, values, moved, t, inside);
    const piece p = piece_at(&scene->turnings[input->turning], values, moved, inside);
    if (input->kind == SCHEDULE_RATE) return rate_of(&p, t);
    if (input->kind == SCHEDULE_SLOPE) return times((dual){2.0, 0.0}, p.half);
    if (input->kind == SCHEDULE_ANGLE) return angle_of(&p, t);
    if (input->kind == SCHEDULE_PHASE) {
        const dual angle = angle_of(&p, t);
        return (dual){modulo(angle.v, input->turns * TURN), angle.d};
    }
    const piece many = {p.begin, p.passed, times((dual){input->parts, 0.0}, p.angle), times((dual){input->parts, 0.0}, p.rate),
                        times((dual){input->parts, 0.0}, p.half), p.end};
    for (int k = 0; k < input->windows; k++) {
        double start, width;
        window(values[input->edges[2 * k]], values[input->edges[2 * k + 1]], &start, &width);
        if (covers(angle_of(&many, inside).v, start, width)) return (dual){1.0, 0.0};
    }
    return (dual){0.0, 0.0};
}

void schedule_tangents(const schedule_scene *scene, const double *values, const double *moved, double t, double inside, double *ud)
{
    for (int i = 0; i < scene->count; i++) ud[i] = input_at(scene, &scene->inputs[i], values, moved, t, inside).d;
}

void schedule_inputs(const schedule_scene *scene, const double *values, double t, double inside, double *u)
{
    for (int i = 0; i < scene->count; i++) u[i] = input_at(scene, &scene->inputs[i], values, NULL, t, inside).v;
}

static int increases(int rows, const int *at, const double *values)
{
    for (int k = 1; k < rows; k++)
        if (!(values[at[k]] > values[at[k - 1]])) return 0;
    return 1;
}

int schedule_fault(const schedule_scene *scene, const double *values)
{
    for (int i = 0; i < scene->count; i++) {
        const schedule_input *input = &scene->inputs[i];
        const int *at = input->times, knots = input->knots;
        if (!increases(knots, at, values)) return 1;
        if (knots && input->turning >= 0 && !(values[at[knots - 1]] - values[at[0]] < input->turns * TURN - ANGLE_RESOLUTION)) return 1;
    }
    for (int i = 0; i < scene->turning_count; i++) {
        const schedule_turning *turning = &scene->turnings[i];
        if (!increases(turning->rows, turning->times, values) || !increases(turning->lag_rows, turning->lag_times, values)) return 1;
    }
    return 0;
}

/* Times at which something switches, sorted, those that are one time once. */
static void add_breakpoints(time_list *list, const schedule_scene *scene, const double *values, double begin, double end)
{
    time_list found = {NULL, 0, 0, 0};
    for (int i = 0; i < scene->turning_count; i++) {
        const schedule_turning *turning = &scene->turnings[i];
        const int live = turning->live >= 0 && isfinite(values[turning->live]);
        for (int k = 0; k < turning->rows && !live; k++) add(&found, values[turning->times[k]]);
        for (int k = 0; k < turning->lag_rows; k++) add(&found, values[turning->lag_times[k]]);
    }
    for (int i = 0; i < scene->count; i++) {
        const schedule_input *input = &scene->inputs[i];
        const schedule_turning *turning = input->turning < 0 ? NULL : &scene->turnings[input->turning];
        for (int k = 0; input->kind == SCHEDULE_GATE && k < input->windows; k++) {
            double start, width;
            window(values[input->edges[2 * k]], values[input->edges[2 * k + 1]], &start, &width);
            if (width <= 0.0 || width >= TURN) continue;
            add_passages(&found, turning, values, input->parts, start, TURN, begin, end);
            add_passages(&found, turning, values, input->parts, start + width, TURN, begin, end);
        }
        for (int k = 0; k < input->knots; k++) {
            if (turning) add_passages(&found, turning, values, 1.0, values[input->times[k]], input->turns * TURN, begin, end);
            else add(&found, values[input->times[k]]);
        }
    }
    if (found.count) qsort(found.times, (size_t)found.count, sizeof *found.times, by_size);
    const double largest = fabs(begin) > fabs(end) ? fabs(begin) : fabs(end), near = TIME_RESOLUTION * largest;
    const long before = list->count;
    for (long i = 0; i < found.count; i++) {
        const double time = found.times[i];
        const int apart = list->count == before || time - list->times[list->count - 1] > near;
        if (begin + near < time && time < end - near && apart) add(list, time);
    }
    if (found.short_of_memory) list->short_of_memory = 1;
    free(found.times);
}

/* Whole turns that are no breakpoint already; `breakpoints` sorted entries stand behind the run's begin. */
static void add_turns(time_list *list, long breakpoints, double begin, double end, double turn)
{
    double near = fabs(begin) > fabs(end) ? fabs(begin) : fabs(end);
    near = TIME_RESOLUTION * (near > turn ? near : turn);
    long next = 1;
    for (double k = floor(begin / turn) + 1.0; k < ceil(end / turn) && !list->short_of_memory; k += 1.0) {
        const double whole = k * turn;
        while (next <= breakpoints && list->times[next] < whole) next++;
        const int below = next > 1 && whole - list->times[next - 1] <= near;
        const int above = next <= breakpoints && list->times[next] - whole <= near;
        if (begin + near < whole && whole < end - near && !below && !above) add(list, whole);
    }
}

/* Largest rate of a turning [rad/s]. */
static double fastest_of(const schedule_turning *turning, const double *values)
{
    double most = 0.0;
    piece p = {.end = 0.0};
    for (int more = next_piece(turning, values, NULL, 1, &p); more; more = next_piece(turning, values, NULL, 0, &p)) {
        const double begin = fabs(p.rate.v), end = isfinite(p.end) ? fabs(rate_of(&p, p.end).v) : 0.0;
        if (begin > most) most = begin;
        if (end > most) most = end;
    }
    return most;
}

/* Rate of the fastest phase [rad/s]. */
static double fastest_phase(const schedule_scene *scene, const double *values)
{
    double most = 0.0;
    for (int i = 0; i < scene->turning_count; i++) {
        const double fastest = fastest_of(&scene->turnings[i], values);
        if (fastest > most) most = fastest;
    }
    return most;
}

/* The sorted edges with more between two where a phase would get too large: a fast load on a slow shaft. */
static void cut_short(time_list *list, double fastest)
{
    time_list cut = {NULL, 0, 0, 0};
    double longest = 0.0;
    for (long i = 0; i + 1 < list->count; i++)
        if (list->times[i + 1] - list->times[i] > longest) longest = list->times[i + 1] - list->times[i];
    if (longest * fastest <= LARGEST_PHASE) return;
    for (long i = 0; i + 1 < list->count && !cut.short_of_memory; i++) {
        const double begin = list->times[i], length = list->times[i + 1] - begin, parts = ceil(length * fastest / LARGEST_PHASE);
        add(&cut, begin);
        for (double k = 1.0; k < parts && !cut.short_of_memory; k += 1.0) add(&cut, k * (length / parts) + begin);
    }
    if (!cut.short_of_memory) add(&cut, list->times[list->count - 1]);
    free(list->times);
    *list = cut;
}

double schedule_most_segments(const schedule_scene *scene, const double *values, double length, double turn)
{
    double most = 1.0 + length / turn + length * fastest_phase(scene, values) / LARGEST_PHASE;
    for (int i = 0; i < scene->turning_count; i++) most += scene->turnings[i].rows + scene->turnings[i].lag_rows;
    for (int i = 0; i < scene->count; i++) {
        const schedule_input *input = &scene->inputs[i];
        double passed = 1.0;
        if (input->turning >= 0)
            passed = (double)input->parts / input->turns * (1.0 + length * fastest_of(&scene->turnings[input->turning], values) / TURN);
        most += (2.0 * input->windows + input->knots) * passed;
    }
    return most;
}

int schedule_moments(const schedule_scene *scene, const double *values, const double *edges, long segments, double horizon,
                     double *u)
{
    const int columns = scene->count > 0 ? scene->count : 1;
    const double apart = (double)(segments - 1) / (SCHEDULE_MOMENTS - 1);
    int rows = 0;
    long before = -1;
    for (int k = 0; k < SCHEDULE_MOMENTS; k++) {
        const long i = k < SCHEDULE_MOMENTS - 1 ? (long)(k * apart) : segments - 1;
        if (i == before) continue;
        before = i;
        const double middle = 0.5 * (edges[i] + edges[i + 1]);
        u[rows * columns] = 0.0;
        schedule_inputs(scene, values, middle, middle, u + rows++ * columns);
    }
    for (int k = 0; k < SCHEDULE_MOMENTS; k++) {
        const double moment = horizon * (k + 0.5) / SCHEDULE_MOMENTS;
        u[rows * columns] = 0.0;
        schedule_inputs(scene, values, moment, moment, u + rows++ * columns);
    }
    return rows;
}

long schedule_edges(const schedule_scene *scene, const double *values, double begin, double end, double turn, double **edges)
{
    time_list list = {NULL, 0, 0, 0};
    add(&list, begin);
    if (!list.short_of_memory) add_breakpoints(&list, scene, values, begin, end);
    if (!list.short_of_memory && isfinite(turn)) add_turns(&list, list.count - 1, begin, end, turn);
    add(&list, end);
    if (list.short_of_memory) {
        free(list.times);
        return -1;
    }
    qsort(list.times, (size_t)list.count, sizeof *list.times, by_size);
    cut_short(&list, fastest_phase(scene, values));
    if (list.short_of_memory) {
        free(list.times);
        return -1;
    }
    *edges = list.times;
    return list.count - 1;
}

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

/* Piece k of the time in which the angle of a gate grows evenly: its value at t = 0, its rate, begin and end. */
static void piece_of_gate(const schedule_input *gate, const double *values, int k, double *offset, double *rate, double *begin, double *end)
{
    *offset = values[gate->offset];
    *rate = values[gate->rate];
    if (!gate->knots) return;
    const int left = k > 0 ? k - 1 : 0, inside = k > 0 && k < gate->knots;
    const double height = values[gate->heights[left]], knot = values[gate->times[left]];
    const double slope = inside ? (values[gate->heights[k]] - height) / (values[gate->times[k]] - knot) : 0.0;
    *offset += height - slope * knot;
    *rate += slope;
    if (k > 0 && knot > *begin) *begin = knot;
    if (k < gate->knots && values[gate->times[k]] < *end) *end = values[gate->times[k]];
}

/* Times in [begin, end] at which offset + rate t passes `edge` modulo a turn. */
static void add_passages(time_list *list, double edge, double offset, double rate, double begin, double end)
{
    const double a = (offset + rate * begin - edge) / TURN, b = (offset + rate * end - edge) / TURN;
    const double first = ceil((a < b ? a : b) - 1e-9), last = floor((a < b ? b : a) + 1e-9);
    for (double turn = first; turn <= last && !list->short_of_memory; turn += 1.0) add(list, (edge - offset + TURN * turn) / rate);
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

/* Piece of a table that holds at a time: places of its knots and heights, twice one where it is flat; where the piece begins and ends; the
   argument that belongs to t. */
typedef struct {
    int left, right, low, high;
    double begin, end, at;
} table_piece;

/* A table over an angle is periodic: its last knot joins the first. */
static table_piece piece_of_table(const schedule_input *input, const double *values, double t, double inside)
{
    const int over_angle = input->rate >= 0;
    double argument = inside, at = t;
    if (over_angle) {
        const double first = values[input->times[0]], rate = values[input->rate];
        double past = modulo(values[input->offset] + rate * inside - first, TURN);
        if (TURN - past < ANGLE_RESOLUTION) past = 0.0;
        argument = first + past;
        at = argument + rate * (t - inside);
    }
    const int k = knots_before(input, values, argument), last = k == input->knots;
    int left = k - 1, right = last ? 0 : k;
    if (!over_angle && (k == 0 || last)) left = right = k == 0 ? 0 : k - 1;
    const double end = values[input->times[right]];
    return (table_piece){input->times[left], input->times[right], input->heights[left], input->heights[right], values[input->times[left]],
                         last && over_angle ? end + TURN : end, at};
}

/* Value at t, or slope, of the piece that holds at `inside`. */
static double table(const schedule_input *input, const double *values, double t, double inside)
{
    const table_piece piece = piece_of_table(input, values, t, inside);
    const int slope_only = input->kind == SCHEDULE_TABLE_RATE;
    if (piece.low == piece.high) return slope_only ? 0.0 : values[piece.low];
    const double slope = (values[piece.high] - values[piece.low]) / (piece.end - piece.begin);
    return slope_only ? slope : values[piece.low] + slope * (piece.at - piece.begin);
}

/* Its derivative along a direction of the values. */
static double table_tangent(const schedule_input *input, const double *values, const double *moved, double t, double inside)
{
    const table_piece piece = piece_of_table(input, values, t, inside);
    const int slope_only = input->kind == SCHEDULE_TABLE_RATE;
    if (piece.low == piece.high) return slope_only ? 0.0 : moved[piece.low];
    const double length = piece.end - piece.begin, slope = (values[piece.high] - values[piece.low]) / length;
    const double slope_moved = (moved[piece.high] - moved[piece.low] - slope * (moved[piece.right] - moved[piece.left])) / length;
    const double at_moved = input->rate >= 0 ? moved[input->offset] + moved[input->rate] * t : 0.0;
    return slope_only ? slope_moved : moved[piece.low] + slope_moved * (piece.at - piece.begin) + slope * (at_moved - moved[piece.left]);
}

void schedule_tangents(const schedule_input *inputs, int count, const double *values, const double *moved, double t, double inside, double *ud)
{
    for (int i = 0; i < count; i++) {
        const schedule_input *input = &inputs[i];
        ud[i] = 0.0;
        if (input->kind == SCHEDULE_PHASE) ud[i] = moved[input->offset] + moved[input->rate] * t;
        else if (input->kind == SCHEDULE_TABLE || input->kind == SCHEDULE_TABLE_RATE) ud[i] = table_tangent(input, values, moved, t, inside);
    }
}

void schedule_inputs(const schedule_input *inputs, int count, const double *values, double t, double inside, double *u)
{
    for (int i = 0; i < count; i++) {
        const schedule_input *input = &inputs[i];
        if (input->kind == SCHEDULE_PHASE) {
            u[i] = modulo(values[input->offset] + values[input->rate] * t, TURN);
        } else if (input->kind == SCHEDULE_GATE) {
            const int piece = input->knots ? knots_before(input, values, inside) : 0;
            double offset, rate, begin = inside, end = inside;
            piece_of_gate(input, values, piece, &offset, &rate, &begin, &end);
            const double angle = offset + rate * inside;
            u[i] = 0.0;
            for (int k = 0; k < input->windows; k++) {
                double start, width;
                window(values[input->edges[2 * k]], values[input->edges[2 * k + 1]], &start, &width);
                if (covers(angle, start, width)) u[i] = 1.0;
            }
        } else if (input->kind == SCHEDULE_BORDER) {
            u[i] = 0.0;
        } else {
            u[i] = table(input, values, t, inside);
        }
    }
}

int schedule_fault(const schedule_input *inputs, int count, const double *values)
{
    for (int i = 0; i < count; i++) {
        const int *times = inputs[i].times, knots = inputs[i].knots;
        for (int k = 1; k < knots; k++)
            if (!(values[times[k]] > values[times[k - 1]])) return i;
        if (knots && inputs[i].rate >= 0 && inputs[i].kind != SCHEDULE_GATE && !(values[times[knots - 1]] - values[times[0]] < TURN - ANGLE_RESOLUTION)) return i;
    }
    return -1;
}

/* Times at which something switches, sorted, those that are one time once. */
static void add_breakpoints(time_list *list, const schedule_input *inputs, int count, const double *values, double begin, double end)
{
    time_list found = {NULL, 0, 0, 0};
    for (int i = 0; i < count; i++) {
        const schedule_input *input = &inputs[i];
        for (int piece = 0; input->kind == SCHEDULE_GATE && piece <= input->knots; piece++) {
            double offset, rate, from = begin, to = end;
            piece_of_gate(input, values, piece, &offset, &rate, &from, &to);
            if (rate == 0.0 || from >= to) continue;
            for (int k = 0; k < input->windows; k++) {
                double start, width;
                window(values[input->edges[2 * k]], values[input->edges[2 * k + 1]], &start, &width);
                if (width <= 0.0 || width >= TURN) continue;
                add_passages(&found, start, offset, rate, from, to);
                add_passages(&found, start + width, offset, rate, from, to);
            }
        }
        if (input->kind == SCHEDULE_GATE) continue; /* its knots are those of a table */
        for (int k = 0; k < input->knots; k++) {
            const double knot = values[input->times[k]];
            if (input->rate < 0) add(&found, knot);
            else if (values[input->rate] != 0.0) add_passages(&found, knot, values[input->offset], values[input->rate], begin, end);
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

/* Rate of the fastest phase [rad/s]. */
static double fastest_phase(const schedule_input *inputs, int count, const double *values)
{
    double most = 0.0;
    for (int i = 0; i < count; i++)
        if (inputs[i].kind == SCHEDULE_PHASE && fabs(values[inputs[i].rate]) > most) most = fabs(values[inputs[i].rate]);
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

double schedule_most_segments(const schedule_input *inputs, int count, const double *values, double length, double turn)
{
    double most = 1.0 + length / turn + length * fastest_phase(inputs, count, values) / LARGEST_PHASE;
    for (int i = 0; i < count; i++) {
        const double turns = inputs[i].rate >= 0 ? 1.0 + length * fabs(values[inputs[i].rate]) / TURN : 1.0;
        most += ((inputs[i].kind == SCHEDULE_GATE ? 2.0 * inputs[i].windows : 0.0) + inputs[i].knots) * turns;
    }
    return most;
}

int schedule_moments(const schedule_input *inputs, int count, const double *values, const double *edges, long segments, double horizon,
                     double *u)
{
    const int columns = count > 0 ? count : 1;
    const double apart = (double)(segments - 1) / (SCHEDULE_MOMENTS - 1);
    int rows = 0;
    long before = -1;
    for (int k = 0; k < SCHEDULE_MOMENTS; k++) {
        const long i = k < SCHEDULE_MOMENTS - 1 ? (long)(k * apart) : segments - 1;
        if (i == before) continue;
        before = i;
        const double middle = 0.5 * (edges[i] + edges[i + 1]);
        u[rows * columns] = 0.0;
        schedule_inputs(inputs, count, values, middle, middle, u + rows++ * columns);
    }
    for (int k = 0; k < SCHEDULE_MOMENTS; k++) {
        const double moment = horizon * (k + 0.5) / SCHEDULE_MOMENTS;
        u[rows * columns] = 0.0;
        schedule_inputs(inputs, count, values, moment, moment, u + rows++ * columns);
    }
    return rows;
}

long schedule_edges(const schedule_input *inputs, int count, const double *values, double begin, double end, double turn, double **edges)
{
    time_list list = {NULL, 0, 0, 0};
    add(&list, begin);
    if (!list.short_of_memory) add_breakpoints(&list, inputs, count, values, begin, end);
    if (!list.short_of_memory && isfinite(turn)) add_turns(&list, list.count - 1, begin, end, turn);
    add(&list, end);
    if (list.short_of_memory) {
        free(list.times);
        return -1;
    }
    qsort(list.times, (size_t)list.count, sizeof *list.times, by_size);
    cut_short(&list, fastest_phase(inputs, count, values));
    if (list.short_of_memory) {
        free(list.times);
        return -1;
    }
    *edges = list.times;
    return list.count - 1;
}

/* Expressions along recorded steps, resolved: polynomials on parts of steps, which are divided where they are not accurate
   and that can change what is asked for.  The lanes are the places of one part. */
#include "dop853.h"

enum {
    FINE = 33,     /* places at which a polynomial is evaluated to find its largest and smallest values */
    FINE_ROOM = 5, /* vectors of them: the last place several times */
    DEEPEST = 40,  /* how often a part may be divided */
    ROUGH = 6      /* divisions after which one part must be more accurate than the whole, or none ever is */
};

/* Safety factor of the error estimate of a polynomial. */
static const double SAFETY = 2.0;
/* Ratio of the last coefficients to those before, times this: from 1 on they fall so slowly that there is a kink.  One
   between the first two points hardly shows in them: the error there is so many times their size. */
static const double SLOW = 10.0;
/* Error, as a part of what is between the largest and the smallest value, from which on it is that of a jump. */
static const double JUMPING = 0.1;
/* By how much that is more accurate, at least. */
static const double SMOOTHER = 0.25;
/* Part of the whole time over which a polynomial that is wrong by the tolerance counts fully in an integral. */
static const double SHORT = 1.0 / 256;
/* Part of the error of a polynomial that is left of its mean, as an inverse: less than a tenth, as its signs alternate. */
static const double MEAN = 8.0;
/* By how much a kink is enclosed on each side, as a part of what it is in, at least, and at most. */
static const double NEAR = 1e-4, WIDEST = 0.1;
/* Part of a time by which equations are evaluated inside a step: at its ends forces may jump. */
static const double INSIDE = 1e-12;

static const double ENDLESS = __builtin_inf(), UNKNOWN = __builtin_nan("");

/* Quantity for which an expression is resolved. */
enum { LARGEST, SMALLEST, SO_FAR, INTEGRAL, REACHED };

/* Recorded steps of realisations, one after the other. */
typedef struct {
    int64_t width;
    const int64_t *owner, *row;        /* (P): of which realisation, and where its states stand */
    const double *begin, *end, *last;  /* (P): from when to when it holds, where its polynomial ends */
    const int8_t *kept;                /* (P): contacts last */
    const double *states;              /* (row, PLACES, width) */
    const double *places, *weights;    /* (PLACES): parts of a step, and their barycentric weights */
} Course;

/* Expressions of states. */
typedef struct {
    int64_t parameters, inputs, many;
    Program outputs;              /* a state -> results */
    const int64_t *results;       /* rows of them (many) */
    const double *block, *values; /* (member, parameters), (member, inputs) */
} Seen;

/* Parts of steps: storage, and a list of those that count of each realisation, in order. */
typedef struct {
    const Course *course;
    int64_t members, outputs, needs;
    const int64_t *kinds, *columns;        /* (need) */
    const double *slack;                   /* (need): tolerances by which a value may be less and still count */
    const double *series;                  /* (PLACES, PLACES): values at a place to coefficients */
    const double *fine;                    /* (PLACES, 8 FINE_ROOM): a coefficient to values at the fine places */
    const double *weights;                 /* (PLACES): of values for the mean */
    double share;                          /* tolerance, as a part of the largest value */
    int64_t *step, *depth, *next, *whole;  /* (part): the next in the list, and of which one it is a part; -1: none */
    int64_t *beside;                       /* (part): beside what holds a kink */
    double *low, *high;                    /* from which part of the step's polynomial to which */
    double *begin, *end;                   /* s */
    double *values, *coefficients;         /* (part, many, PLACES), (part, output, PLACES) */
    double *error;        /* (part, output): by which the polynomial may be wrong; 0: nothing makes it better */
    double *most, *least; /* (part, output): between which the polynomial is */
    double *highest, *lowest; /* (part, output): at the places */
    double *mean;             /* (part, output) */
    int64_t *first, *open;    /* (member): first part, and whether any might be divided */
    double *allowed;          /* (member, output): tolerance */
    double *known;            /* (need): of one realisation at a time */
} Parts;

/* Weights of the states of a step for the values at the places of a part of it: Lagrange's polynomials. */
static void weights_of(const Course *c, double low, double high, V *weights) {
    V part = low + (high - low) * *(const Loose *)c->places, before = splat(1.0), after = before, sum = splat(0.0);
    part[PLACES - 1] = high;
    for (int64_t k = 0; k < PLACES; k++) {
        weights[k] = c->weights[k] * before;
        before *= part - c->places[k];
    }
    for (int64_t k = PLACES - 1; k >= 0; k--) {
        weights[k] *= after;
        after *= part - c->places[k];
        sum += weights[k];
    }
    sum = 1.0 / sum;
    for (int64_t k = 0; k < PLACES; k++) weights[k] *= sum;
}

/* Values of a polynomial whose values at the places of a step are `from`, `stride` apart. */
INLINE V weighted(const V *weights, const double *from, int64_t stride) {
    V sum = weights[0] * from[0];
#pragma clang loop unroll(full)
    for (int64_t k = 1; k < PLACES; k++) sum += weights[k] * from[k * stride];
    return sum;
}

/* Times of the places of a part, inside the step. */
static V times_of(const Course *c, int64_t k, double low, double high) {
    double begin = c->begin[k], end = c->end[k], size = 1.0;
    if (__builtin_fabs(begin) > size) size = __builtin_fabs(begin);
    if (__builtin_fabs(end) > size) size = __builtin_fabs(end);
    double margin = INSIDE * size < 0.5 * (end - begin) ? INSIDE * size : 0.5 * (end - begin);
    V time = begin + (low + (high - low) * *(const Loose *)c->places) * (c->last[k] - begin);
    return smaller(larger(time, splat(begin + margin)), splat(end - margin));
}

void part_states(const Course *c, int64_t count, const int64_t *step, const double *low, const double *high,
                 double *states, double *times) {
    for (int64_t e = 0; e < count; e++) {
        V weights[PLACES];
        const double *from = c->states + c->row[step[e]] * PLACES * c->width;
        weights_of(c, low[e], high[e], weights);
        for (int64_t i = 0; i < c->width; i++) {
            V found = weighted(weights, from + i, c->width);
            for (int64_t l = 0; l < PLACES; l++) states[(e * PLACES + l) * c->width + i] = found[l];
        }
        *(Loose *)(times + e * PLACES) = times_of(c, step[e], low[e], high[e]);
    }
}

void observe_parts(const Course *c, const Seen *s, int64_t count, const int64_t *step, const double *low,
                   const double *high, double *found, double *workspace) {
    int64_t held = -1, width = c->width;
    V *work = (V *)workspace, *parameters = work + width + 2, *inputs = parameters + s->parameters;
    work[width + 1] = splat(0.0);
    for (int64_t e = 0; e < count; e++) {
        const int64_t k = step[e];
        const double *from = c->states + c->row[k] * PLACES * width;
        V weights[PLACES];
        if (c->owner[k] != held) {
            held = c->owner[k];
            for (int64_t i = 0; i < s->parameters; i++) parameters[i] = splat(s->block[held * s->parameters + i]);
            for (int64_t i = 0; i < s->inputs; i++) inputs[i] = splat(s->values[held * s->inputs + i]);
        }
        weights_of(c, low[e], high[e], weights);
        for (int64_t i = 0; i < width; i++) work[i] = weighted(weights, from + i, width);
        work[width] = times_of(c, k, low[e], high[e]);
        run_program(&s->outputs, work);
        for (int64_t r = 0; r < s->many; r++) *(Loose *)(found + (e * s->many + r) * PLACES) = work[s->results[r]];
    }
}

static double highest_of(V x) {
    V y = larger(x, __builtin_shufflevector(x, x, 4, 5, 6, 7, 0, 1, 2, 3));
    y = larger(y, __builtin_shufflevector(y, y, 2, 3, 0, 1, 6, 7, 4, 5));
    return y[0] > y[1] ? y[0] : y[1];
}

/* Bound values of a polynomial, times a sign, from those at the fine places: a peak is less above the largest of them
   than that is above its neighbours.  Beside the first and last of them are copies. */
INLINE double above(const double *fine, double sign) {
    V most = splat(-ENDLESS), bound = most;
    for (int64_t i = 0; i < FINE_ROOM; i++) most = larger(most, sign * *(const Loose *)(fine + i * LANES));
    most = splat(highest_of(most));
    for (int64_t i = 0; i < FINE_ROOM; i++) {
        const double *at = fine + i * LANES;
        V here = sign * *(const Loose *)at;
        V beside = smaller(sign * *(const Loose *)(at - 1), sign * *(const Loose *)(at + 1));
        bound = larger(bound, choose(here == most, 2.0 * here - beside, splat(-ENDLESS)));
    }
    return highest_of(bound);
}

/* Find the polynomials of a part, and what is known of them.  What is not finite is not known. */
static void analyse(const Parts *p, int64_t e) {
    const Course *c = p->course;
    int64_t k = p->step[e];
    double length = c->last[k] - c->begin[k];
    p->begin[e] = c->begin[k] + p->low[e] * length;
    p->end[e] = c->begin[k] + p->high[e] * length;
    if (p->begin[e] > c->end[k]) p->begin[e] = c->end[k];
    if (p->end[e] > c->end[k]) p->end[e] = c->end[k];
    for (int64_t o = 0; o < p->outputs; o++) {
        const double *values = p->values + (e * p->outputs + o) * PLACES;
        int64_t at = e * p->outputs + o;
        double room[LANES * FINE_ROOM + 2], *fine = room + 1;
        V series = splat(0.0), all = *(const Loose *)values;
        double highest = highest_of(all), lowest = -highest_of(-all), zero = 0.0, mean = 0.0;
        for (int64_t j = 0; j < PLACES; j++) {
            series += *(const Loose *)(p->series + j * PLACES) * values[j];
            zero += values[j] - values[j];
            mean += p->weights[j] * values[j];
        }
        p->mean[at] = mean;
        *(Loose *)(p->coefficients + at * PLACES) = series;
        p->highest[at] = highest;
        p->lowest[at] = lowest;
        if (zero != 0.0) {
            p->error[at] = p->most[at] = p->least[at] = p->highest[at] = p->lowest[at] = UNKNOWN;
            continue;
        }
        for (int64_t i = 0; i < FINE_ROOM; i++) {
            V sum = splat(0.0);
            for (int64_t j = 0; j < PLACES; j++)
                sum += *(const Loose *)(p->fine + (j * FINE_ROOM + i) * LANES) * series[j];
            *(Loose *)(fine + i * LANES) = sum;
        }
        fine[-1] = fine[0];
        fine[LANES * FINE_ROOM] = fine[LANES * FINE_ROOM - 1];
        double most = above(fine, 1.0), least = -above(fine, -1.0);
        p->most[at] = most > highest ? most : highest;
        p->least[at] = least < lowest ? least : lowest;
        V sizes = magnitude(series);
        double last = sizes[7] + sizes[6], before = sizes[5] + sizes[4];
        double ratio = last / (before > 1e-300 ? before : 1e-300);
        if (ratio > 1.0) ratio = 1.0;
        p->error[at] = c->kept[k] ? 0.0 : SAFETY * last * (1.0 + SLOW * ratio * (SLOW * ratio));
    }
}

/* Take an output of a part as it is, since nothing makes it better; straight at a jump.

   No polynomial follows a jump: between the values on both sides it reaches others, which the output never has. */
static void as_good_as_ever(const Parts *p, int64_t e, int64_t o) {
    int64_t at = e * p->outputs + o;
    if (p->error[at] > JUMPING * (p->highest[at] - p->lowest[at])) {
        const double *values = p->values + (e * p->outputs + o) * PLACES;
        double *series = p->coefficients + at * PLACES;
        for (int64_t j = 2; j < PLACES; j++) series[j] = 0.0;
        series[0] = 0.5 * (values[0] + values[PLACES - 1]);
        series[1] = 0.5 * (values[PLACES - 1] - values[0]);
        p->most[at] = p->highest[at];
        p->least[at] = p->lowest[at];
    }
    p->error[at] = 0.0;
}

/* Tolerances of a realisation, from the sizes of its outputs where they are finite: what is reached before that ends is to
   be accurate. */
static void allow(const Parts *p, int64_t m) {
    for (int64_t o = 0; o < p->outputs; o++) {
        double size = 0.0;
        for (int64_t e = p->first[m]; e >= 0; e = p->next[e]) {
            double most = __builtin_fabs(p->most[e * p->outputs + o]), least = __builtin_fabs(p->least[e * p->outputs + o]);
            if (most > size) size = most;
            if (least > size) size = least;
        }
        p->allowed[m * p->outputs + o] = p->share * size;
    }
}

static int positive(const double *values) {
    int found = 0;
    for (int64_t j = 0; j < PLACES; j++) found |= values[j] >= 0.0;
    return found;
}

/* Note what all parts of a realisation say about the needs. */
static void know(const Parts *p, int64_t m) {
    for (int64_t n = 0; n < p->needs; n++) p->known[n] = p->kinds[n] == LARGEST ? -ENDLESS : ENDLESS;
    for (int64_t e = p->first[m]; e >= 0; e = p->next[e])
        for (int64_t n = 0; n < p->needs; n++) {
            int64_t at = e * p->outputs + p->columns[n];
            double *known = p->known + n;
            if (p->kinds[n] == LARGEST && !(p->highest[at] <= *known)) *known = p->highest[at];
            if (p->kinds[n] == SMALLEST && !(p->lowest[at] >= *known)) *known = p->lowest[at];
            if (p->kinds[n] == REACHED && p->begin[e] < *known &&
                positive(p->values + (e * p->outputs + p->columns[n]) * PLACES))
                *known = p->begin[e];
        }
}

/* Whether a polynomial that is not accurate can change what is asked for. */
static int matters(const Parts *p, int64_t m, int64_t e, int64_t n) {
    int64_t at = e * p->outputs + p->columns[n];
    double error = p->error[at], slack = p->slack[n] * p->allowed[m * p->outputs + p->columns[n]];
    switch (p->kinds[n]) {
        case LARGEST: return p->most[at] + error >= p->known[n] - slack;
        case SMALLEST: return p->least[at] - error <= p->known[n] + slack;
        case SO_FAR: return p->least[at] - error < p->known[n];
        case REACHED: return p->most[at] + error >= 0.0 && p->begin[e] <= p->known[n];
        default: return 1;
    }
}

/* Value at x of the polynomial through three values at places. */
static double through(const double *at, const double *values, double x) {
    double a = x - at[0], b = x - at[1], c = x - at[2], ab = at[0] - at[1], ac = at[0] - at[2], bc = at[1] - at[2];
    return values[0] * b * c / (ab * ac) - values[1] * a * c / (ab * bc) + values[2] * a * b / (ac * bc);
}

/* Look for a kink between two places that have three places on both sides: where parabolas through these meet.  Its
   place, from 0 to 1, and how far around it the kink surely is. */
static int find_kink(const double *places, const double *values, double *at, double *around) {
    int64_t gap = 0;
    double most = 0.0;
    for (int64_t k = 0; k + 2 < PLACES; k++) {
        double before = (values[k + 1] - values[k]) / (places[k + 1] - places[k]);
        double after = (values[k + 2] - values[k + 1]) / (places[k + 2] - places[k + 1]);
        double bend = __builtin_fabs(after - before) / (places[k + 2] - places[k]);
        if (bend > most) most = bend, gap = k;
    }
    for (int64_t k = gap; k < gap + 2; k++) {
        if (k < 2 || k + 3 >= PLACES) continue;
        const double *x = places + k, *y = values + k;
        double low = x[0], high = x[1];
        double left = through(x - 2, y - 2, low) - through(x + 1, y + 1, low);
        double right = through(x - 2, y - 2, high) - through(x + 1, y + 1, high);
        if (!(left * right < 0.0)) continue;
        for (int64_t i = 0; i < 40; i++) {
            double middle = 0.5 * (low + high), here = through(x - 2, y - 2, middle) - through(x + 1, y + 1, middle);
            if (here * left > 0.0)
                low = middle;
            else
                high = middle;
        }
        /* straight lines meet there, too, but for how much less they know */
        double rise = (y[0] - y[-1]) / (x[0] - x[-1]), fall = (y[2] - y[1]) / (x[2] - x[1]);
        double line = (y[1] - y[0] + rise * x[0] - fall * x[1]) / (rise - fall);
        *at = 0.5 * (low + high);
        *around = 4.0 * __builtin_fabs(line - *at) + NEAR;
        if (*around <= WIDEST) return 1;
    }
    return 0;
}

/* Where a part is to be divided: in the middle, or on both sides of a kink of an output; how many parts there are then. */
static int64_t divide(const Parts *p, int64_t e, int64_t o, double *edges) {
    double at, around, low = p->low[e], length = p->high[e] - low;
    int64_t index = e * p->outputs + o;
    edges[0] = low;
    if (!p->beside[e] && find_kink(p->course->places, p->values + index * PLACES, &at, &around)) {
        edges[1] = low + (at - around) * length;
        edges[2] = low + (at + around) * length;
        edges[3] = p->high[e];
        return 3;
    }
    edges[1] = 0.5 * (low + p->high[e]);
    edges[2] = p->high[e];
    return 2;
}

/* Divide the parts of a realisation that need it; new ones stand behind the others. */
static int64_t halve(const Parts *p, int64_t m, int64_t count) {
    const double *allowed = p->allowed + m * p->outputs;
    int64_t before = -1, found = count;
    double end = 0.0;
    for (int64_t e = p->first[m]; e >= 0; e = p->next[e]) end = p->end[e];
    double whole = end - p->begin[p->first[m]];
    know(p, m);
    for (int64_t e = p->first[m]; e >= 0; e = p->next[e]) {
        int64_t needed = -1;
        for (int64_t n = 0; n < p->needs; n++) {
            int64_t o = p->columns[n], at = e * p->outputs + o;
            double length = p->end[e] - p->begin[e], much = allowed[o];
            if (p->kinds[n] == INTEGRAL) much *= MEAN * (length < SHORT * whole ? SHORT * whole / length : 1.0);
            if (p->error[at] > much && needed < 0 && matters(p, m, e, n)) needed = o;
            if (p->kinds[n] == SO_FAR && !(p->lowest[at] >= p->known[n])) p->known[n] = p->lowest[at];
        }
        if (needed < 0) {
            before = e;
            continue;
        }
        double edges[4];
        int64_t many = divide(p, e, needed, edges);
        for (int64_t k = 0; k < many; k++) {
            int64_t new = found + k;
            p->step[new] = p->step[e];
            p->depth[new] = p->depth[e] + 1;
            p->low[new] = edges[k];
            p->high[new] = edges[k + 1];
            p->whole[new] = e;
            p->beside[new] = many > 2 && k != 1;
            p->next[new] = k + 1 < many ? new + 1 : p->next[e];
        }
        if (before < 0)
            p->first[m] = found;
        else
            p->next[before] = found;
        found += many;
        e = before = found - 1;
    }
    p->open[m] = found > count;
    return found;
}

/* Resolve parts further: the values of those from number `from` on are new.  Return how many parts there are then, whose
   values are wanted. */
int64_t refine_parts(const Parts *p, int64_t from, int64_t count) {
    for (int64_t e = from; e < count; e++) {
        analyse(p, e);
        for (int64_t o = 0; p->depth[e] >= DEEPEST && o < p->outputs; o++) as_good_as_ever(p, e, o);
    }
    /* what is no better in all its parts is rounding, or rougher than can be resolved */
    for (int64_t e = from, end; from && e < count; e = end) {
        int64_t whole = p->whole[e];
        for (end = e + 1; end < count && p->whole[end] == whole;) end++;
        for (int64_t o = 0; o < p->outputs && p->depth[e] > ROUGH; o++) {
            int better = 0;
            for (int64_t k = e; k < end; k++)
                better |= p->error[k * p->outputs + o] <= SMOOTHER * p->error[whole * p->outputs + o];
            for (int64_t k = e; k < end && !better; k++) as_good_as_ever(p, k, o);
        }
    }
    int64_t found = count;
    for (int64_t m = 0; m < p->members; m++) {
        if (!from) allow(p, m);
        if (!from || p->open[m]) found = halve(p, m, found);
    }
    return found;
}

/* Numbers of the parts that count, in order; how many. */
int64_t list_parts(const Parts *p, int64_t *order) {
    int64_t found = 0;
    for (int64_t m = 0; m < p->members; m++)
        for (int64_t e = p->first[m]; e >= 0; e = p->next[e]) order[found++] = e;
    return found;
}

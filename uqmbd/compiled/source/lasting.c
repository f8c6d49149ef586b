/* The states of closed contacts at an instant: open, sticking, or sliding in a direction, with all their forces. */
#include "group.h"

static const double PRESSED = 1e-9; /* normal force, relative to the largest force, that counts as zero */
static const double UNMOVED = 1e-6; /* internal forces, relative to all forces, that count as zero */

/* States of closed contacts, headings of those that slip, forces, and what they contain beside the least forces. */
typedef struct {
    int64_t mode[MOST_CLOSED];
    double heading[MOST_CLOSED][2], force[MOST_ROWS], internal[MOST_ROWS];
} Lasting;

/* Forces of contacts in given states: the least ones, or, where these violate the laws, those with the largest reserve;
   whether they are finite. */
static int find_lasting_forces(const Closed *c, Lane *s, Lasting *x) {
    int64_t rows = c->first[c->count], lasting = 0;
    int clear = 1;
    Spread spread;
    set_spread(c, x->mode, x->heading, &spread);
    least_forces(c, &spread, s, x->force);
    for (int64_t i = 0; i < rows; i++) {
        x->internal[i] = 0.0;
        if (!is_finite(x->force[i])) return 0;
    }
    double size = size_of_forces(c, x->force);
    for (int64_t k = 0; k < c->count; k++) {
        if (x->mode[k] == OPEN) continue;
        double none = has_cone(c, x->mode, k) ? AT_LIMIT * c->friction[k] * x->force[c->first[k]] : PRESSED * size;
        clear &= reserve_of(c, x->mode, k, x->force) > none;
        lasting++;
    }
    if (lasting < 2 || clear) return 1;
    double ways[MOST_ROWS][MOST_ROWS], force[MOST_ROWS], change = 0.0;
    int64_t count = find_ways(c, &spread, s, ways);
    for (int64_t i = 0; i < rows; i++) force[i] = x->force[i];
    enlarge_reserves(c, x->mode, ways, count, force);
    for (int64_t i = 0; i < rows; i++) change = greatest(change, __builtin_fabs(force[i] - x->force[i]));
    if (!(change > UNMOVED * size)) return 1;
    for (int64_t i = 0; i < rows; i++) {
        x->internal[i] = force[i] - x->force[i];
        x->force[i] = force[i];
    }
    return 1;
}

static int has_internal(const Closed *c, const Lasting *x) { return magnitude_of(x->internal, c->first[c->count]) > 0.0; }

/* Whether all lasting contacts are pressed, with sufficient friction where they stick: up to a part of its limit. */
static int are_pressed(const Closed *c, const Lasting *x, double part) {
    double size = size_of_forces(c, x->force);
    for (int64_t k = 0; k < c->count; k++) {
        if (x->mode[k] == OPEN) continue;
        double normal = x->force[c->first[k]];
        if (!(normal > PRESSED * size && reserve_of(c, x->mode, k, x->force) >= -part * c->friction[k] * normal)) return 0;
    }
    return 1;
}

/* Direction in which a contact starts to slide: against its friction. */
static void start_against(const double *friction, int64_t tangents, double sign, double *heading) {
    double size = 0.0;
    for (int64_t i = 0; i < tangents; i++) size += friction[i] * friction[i];
    size = __builtin_sqrt(size);
    for (int64_t i = 0; i < tangents; i++) heading[i] = size > 0.0 ? -sign * friction[i] / size : i == 0;
}

/* Contacts without a force and without motion may also be loaded: whether the same motion has such forces. */
static int load_others(const Closed *c, Lane *s, double still, const int64_t *unloaded, const Lasting *x, Lasting *found) {
    double before[MOST_ROWS], after[MOST_ROWS], moved = 0.0;
    *found = *x;
    for (int64_t k = 0; k < c->count; k++)
        if (unloaded[k] != OPEN) found->mode[k] = unloaded[k];
    if (!find_lasting_forces(c, s, found)) return 0;
    respond_closed(c, x->force, before);
    respond_closed(c, found->force, after);
    for (int64_t i = 0; i < c->first[c->count]; i++) moved = greatest(moved, __builtin_fabs(after[i] - before[i]));
    /* at the limit of friction of all contacts, guards have just fallen, and the reserves are inexact */
    return moved <= still && are_pressed(c, found, CLEAR);
}

/* The states of closed contacts; whether they are known.  Speeds up to `slow` count as zero.  The caller decides if no
   forces satisfy the laws, or if the first motion that satisfies them is unstable. */
static int find_lasting(const Closed *c, double slow, Lane *s, Lasting *found) {
    double force[MOST_ROWS], after[MOST_ROWS], largest = 0.0, most = 0.0;
    int slides[MOST_CLOSED];
    int64_t unloaded[MOST_CLOSED], loaded = 0, others = 0;
    for (int64_t k = 0; k < c->count; k++) {
        double fast = 0.0;
        for (int64_t i = c->first[k] + 1; i < c->first[k + 1]; i++) fast += c->speed[i] * c->speed[i];
        fast = __builtin_sqrt(fast);
        slides[k] = fast > slow;
        for (int64_t i = c->first[k] + 1; slides[k] && i < c->first[k + 1]; i++)
            found->heading[k][i - c->first[k] - 1] = c->speed[i] / fast;
    }
    Collision x;
    set_forces(c, slides, found->heading, &x);
    if (solve_together(&x, FORCES, s, force) != 1 || !is_stable(&x, force)) return 0;
    respond_together(&x, force, after);
    for (int64_t k = 0; k < x.count; k++)
        for (int64_t i = x.first[k] + (c->given[k] ? 1 : 0); i < x.first[k + 1]; i++) {
            largest = greatest(largest, __builtin_fabs(x.before[i]));
            most = greatest(most, __builtin_fabs(force[i]) * own_response(&x, k));
        }
    for (int64_t k = 0; k < c->count; k++) {
        int64_t first = x.first[k], rubs = c->first[k + 1] - c->first[k] > 1, tangents = x.first[k + 1] - first - 1;
        double along = 0.0;
        for (int64_t i = first + 1; i < x.first[k + 1]; i++) along += after[i] * after[i];
        int stays = rubs && !slides[k] && __builtin_sqrt(along) <= RESTS * largest;
        int64_t mode = !rubs ? SMOOTH : stays ? STICK : SLIP;
        int open = force[first] * own_response(&x, k) <= EXACT * most;
        found->mode[k] = open ? OPEN : mode;
        unloaded[k] = open && after[first] <= RESTS * largest ? mode : OPEN;
        loaded += !open;
        others += unloaded[k] != OPEN;
        if (mode == SLIP && !slides[k])
            start_against((open ? after : force) + first + 1, tangents, open ? -1.0 : 1.0, found->heading[k]);
    }
    if (!loaded) {
        for (int64_t i = 0; i < c->first[c->count]; i++) found->force[i] = found->internal[i] = 0.0;
        return 1;
    }
    if (!find_lasting_forces(c, s, found)) return 0;
    Lasting more;
    if (others && load_others(c, s, RESTS * largest, unloaded, found, &more)) *found = more;
    return 1;
}

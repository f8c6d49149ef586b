/* Data of a group of eight realisations, and the transfer of a realisation into a lane and out of it. */
#include "group.h"

/* Rows of the workspace for implicit steps. */
int64_t implicit_rows(const Problem *p);
static void place_implicit(const Problem *p, Group *g, V *at);
static int64_t brief_rows(const Problem *p);
static void load_control(const Problem *p, Group *g, int64_t l, int64_t m);

int64_t advance_workspace(const Problem *p) {
    int64_t rows = 2 * p->rows + (5 + ALL_STAGES + DENSE + NODES + 2 * GROUPS) * p->width + NODES + 2 * p->turning;
    rows += 2 * p->coordinates + p->equations + 1 + POINTS * GROUPS;
    if (p->implicit) rows += implicit_rows(p);
    if (p->control) rows += p->control->rows;
    rows += brief_rows(p);
    return rows * LANES + (p->contacts ? contact_workspace(p->contacts) : 0);
}

static void place(const Problem *p, Group *g, double *workspace) {
    V *at = (V *)workspace;
    int64_t width = p->width;
    g->work = at;
    at += p->rows;
    g->z = at;
    at += width;
    g->base = at;
    at += width;
    g->next = at;
    at += width;
    g->last = at;
    at += width;
    g->sizes = at;
    at += width;
    g->rates = at;
    at += ALL_STAGES * width;
    g->dense = at;
    at += DENSE * width;
    g->nodes = at;
    at += NODES * width;
    g->surplus = at;
    at += 2 * p->coordinates;
    g->node_times = at;
    at += NODES;
    g->lengths = at;
    at += p->turning;
    g->shrink = at;
    at += p->turning;
    g->other = at;
    at += p->rows;
    g->series = at;
    at += width * GROUPS;
    g->shifts = at;
    at += width * GROUPS;
    g->sums = at;
    at += POINTS * GROUPS;
    g->most->rows = at;
    at += p->equations + 1;
    fill(g->most->rows, 0.0, p->equations + 1);
    for (int64_t l = 0; l < LANES; l++) g->most->member[l] = -1;
    for (int64_t i = 0; i < POINTS * POINTS; i++) ((double *)g->sums)[i] = p->tableau->points[2 * POINTS + i];
    if (p->implicit) {
        place_implicit(p, g, at);
        at += implicit_rows(p);
    }
    if (p->control) {
        g->control = at;
        at += p->control->rows;
    }
    g->slopes = at;
    at += brief_rows(p);
    if (p->contacts) place_contacts(p->contacts, g, at);
    g->brief = (Mask){0};
    g->evaluations = 0;
}

/* Times between which the equations are evaluated: forces may jump at the ends of an integration interval. */
static void bounds(const Problem *p, Group *g, int64_t l, int64_t leg) {
    double begin = g->begin[l], end = p->leg_ends[leg];
    double size = 1.0;
    if (begin > size) size = begin;
    if (-begin > size) size = -begin;
    if (end > size) size = end;
    g->end[l] = end;
    g->bound[l] = p->leg_longest[leg];
    g->low[l] = begin + 1e-12 * size;
    g->high[l] = end - 1e-12 * size;
}

/* Put a row of entries into a lane, and rows of further terms into the next ones; zero without a term. */
static void load_entries(const Problem *p, const double *rows, V *x, int64_t l, int64_t m, int64_t running) {
    int64_t entries = p->width / p->blocks;
    for (int64_t b = 0; b < p->blocks; b++) {
        int64_t row = m + b * LANES;
        for (int64_t i = 0; i < entries; i++)
            x[i * p->blocks + b][l] = !p->terms || (running && row < p->terms) ? rows[row * entries + i] : 0.0;
    }
}

static void store_entries(const Problem *p, double *rows, int64_t stride, const V *x, int64_t l, int64_t m) {
    int64_t entries = p->width / p->blocks;
    for (int64_t b = 0; b < p->blocks; b++) {
        int64_t row = m + b * LANES;
        if (p->terms && row >= p->terms) return;
        for (int64_t i = 0; i < entries; i++) rows[row * stride + i] = x[i * p->blocks + b][l];
    }
}

/* Number of entries of the last states, in order of time, that are not known. */
static int64_t unknown_nodes(const Problem *p, const Pool *pool, int64_t m) {
    return p->guarded ? (NODES - pool->known[m]) * p->width : NODES * p->width;
}

static void load_lane(const Problem *p, const Pool *pool, Group *g, int64_t l, int64_t m, int64_t running) {
    int64_t width = p->width;
    g->member[l] = running ? m : -1;
    g->running[l] = running ? -1 : 0;
    load_entries(p, pool->z, g->z, l, m, running);
    load_entries(p, pool->rate, g->rates, l, m, running);
    for (int64_t i = unknown_nodes(p, pool, m); i < NODES * width; i++)
        g->nodes[i][l] = pool->nodes[m * NODES * width + i];
    for (int64_t i = 0; i < NODES; i++) g->node_times[i][l] = pool->node_times[m * NODES + i];
    if (p->implicit) {
        int64_t count = p->implicit->stages * width;
        const double *from = pool->history + m * (count + 2);
        for (int64_t i = 0; i < count; i++) g->history[i][l] = from[i];
        g->before[l] = from[count];
        g->contraction[l] = from[count + 1];
    }
    V *parameters = g->work + p->time + 2;
    for (int64_t i = 0; i < p->parameters; i++) parameters[i][l] = pool->parameters[m * p->parameters + i];
    g->now[l] = pool->now[m];
    g->begin[l] = pool->begin[m];
    g->wanted[l] = pool->wanted[m];
    g->floor[l] = pool->floor[m];
    g->limit[l] = pool->limit[m];
    g->fresh[l] = running && pool->fresh[m] ? -1 : 0;
    g->touching[l] = running && p->contacts && touches(p->contacts, pool->encounters, m) ? -1 : 0;
    g->arming[l] = running && p->contacts && pool->encounters->decides && pool->encounters->arming[m] ? -1 : 0;
    g->due[l] = running && p->control && p->control->instant[m] >= 0 ? -1 : 0;
    if (p->control) load_control(p, g, l, m);
    bounds(p, g, l, pool->leg[m] <= pool->last_leg[m] ? pool->leg[m] : pool->last_leg[m]);
}

static void store_lane(const Problem *p, const Pool *pool, Group *g, int64_t l) {
    int64_t width = p->width, m = g->member[l];
    collect_off(p, pool, g->most);
    store_entries(p, pool->z, width / p->blocks, g->z, l, m);
    store_entries(p, pool->rate, width / p->blocks, g->rates, l, m);
    for (int64_t i = unknown_nodes(p, pool, m); i < NODES * width; i++)
        pool->nodes[m * NODES * width + i] = g->nodes[i][l];
    for (int64_t i = 0; i < NODES; i++) pool->node_times[m * NODES + i] = g->node_times[i][l];
    if (p->implicit) {
        int64_t count = p->implicit->stages * width;
        double *to = pool->history + m * (count + 2);
        for (int64_t i = 0; i < count; i++) to[i] = g->history[i][l];
        to[count] = g->before[l];
        to[count + 1] = g->contraction[l];
    }
    pool->now[m] = g->now[l];
    pool->begin[m] = g->begin[l];
    pool->wanted[m] = g->wanted[l];
    pool->tried[m] = g->size[l];
    pool->fresh[m] = g->fresh[l] ? 1 : 0;
    g->member[l] = -1;
    g->running[l] = g->touching[l] = g->arming[l] = g->due[l] = 0;
}

/* Step loop: acceptance of steps, size of the next ones, and lanes that wait for a decision. */
#include "group.h"

/* Lanes whose step leads farther off the constraints than tolerances do. */
static Mask strayed(const Problem *p, const Group *g) {
    int64_t n = p->coordinates;
    V sum = splat(0.0), most = splat(p->surplus_allowed * p->surplus_allowed * p->moving);
    for (int64_t i = 0; i < 2 * n; i++) sum += g->surplus[i] * g->surplus[i];
    Mask doubtful = ~(sum <= most * g->floor * g->floor);
    if (!any(doubtful & g->running)) return (Mask){0};
    sum = splat(0.0);
    for (int64_t i = 0; i < n; i++) {
        V q = g->surplus[i] / (g->floor + p->rtol * magnitude(g->z[i]));
        V v = g->surplus[n + i] / (g->floor + p->rtol * magnitude(g->z[p->velocities + i]));
        sum += q * q + v * v;
    }
    return doubtful & ~(sum <= most);
}

/* Remember the states that were reached. */
static void remember(const Problem *p, Group *g, Mask taken) {
    int64_t width = p->width;
    for (int64_t k = 0; k + 1 < NODES; k++) {
        g->node_times[k] = choose(taken, g->node_times[k + 1], g->node_times[k]);
        for (int64_t i = 0; i < width; i++)
            g->nodes[k * width + i] = choose(taken, g->nodes[(k + 1) * width + i], g->nodes[k * width + i]);
    }
    V *newest = g->nodes + (NODES - 1) * width;
    g->node_times[NODES - 1] = choose(taken, g->now, g->node_times[NODES - 1]);
    for (int64_t i = 0; i < width; i++) newest[i] = choose(taken, g->z[i], newest[i]);
}

/* Continue from the states at the end of the step, projected onto the constraints.  The projection changes most rates by
   as little as the states, so that they are kept.  Rates of rotating bodies are evaluated again: they change by the
   square of the speed times that, and steps of some radians would amplify the change from step to step. */
static void accept(const Problem *p, Group *g, Mask taken, V now) {
    int64_t width = p->width, n = p->coordinates;
    const V *reached = g->rates + STAGES * width;
    to_state(p, g, g->next);
    if (p->implicit) keep_stages(p, g, taken);
    for (int64_t i = 0; i < width; i++) {
        g->z[i] = choose(taken, g->next[i], g->z[i]);
        g->rates[i] = choose(taken, reached[i], g->rates[i]);
    }
    /* the rate was one of a quaternion before its length was made one */
    for (int64_t b = 0; b < p->turning; b++)
        for (int64_t i = p->turns[b]; i < p->turns[b] + p->turn; i++)
            g->rates[i] = choose(taken, g->z[p->velocities + i], g->rates[i]);
    if (!p->surplus) return;
    for (int64_t i = 0; i < n; i++) {
        V q = g->surplus[i], v = g->surplus[n + i];
        q = choose(taken & (q == q), q, splat(0.0));
        v = choose(taken & (v == v), v, splat(0.0));
        g->z[i] -= q;
        g->z[p->velocities + i] -= v;
        g->rates[i] -= v;
    }
    /* lanes at the ends of their intervals evaluate their rates when they start again */
    taken &= now < g->end - (g->low - g->begin);
    if (!p->turning || !any(taken)) return;
    copy(g->work, g->z, width);
    for (int64_t b = 0; b < p->turning; b++) {
        g->lengths[b] = length_of(p->turn, g->z + p->turns[b]);
        g->shrink[b] = splat(1.0);
    }
    evaluate_rate(p, g, now, g->next);
    for (int64_t i = 0; i < width; i++) g->rates[i] = choose(taken, g->next[i], g->rates[i]);
}

/* Choose the sizes of the next steps. */
static void choose_sizes(const Pool *pool, Group *g) {
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->running[l]) {
            g->size[l] = 0.0;
            continue;
        }
        double left = g->end[l] - g->now[l], size = g->wanted[l];
        if (left < size) size = left;
        if (g->bound[l] < size) size = g->bound[l];
        if (g->limit[l] < size) size = g->limit[l];
        if (size > left - 0.1 * size) size = left; /* no tiny last step */
        g->size[l] = size;
        pool->attempts[g->member[l]]++;
        pool->allowed[g->member[l]]--;
    }
}

/* Decide about the attempts of all lanes; the lanes whose steps are taken, and the status of those that wait. */
static Mask decide(const Problem *p, const Pool *pool, Group *g, int64_t *status) {
    V shrink = p->implicit ? g->growth : 0.9 / root(root(root(g->error)));
    Mask taken = {0};
    for (int64_t l = 0; l < LANES; l++) {
        status[l] = RUNNING;
        if (!g->running[l]) continue;
        int64_t m = g->member[l];
        double span = g->end[l] - g->begin[l], now = g->now[l] < 0 ? -g->now[l] : g->now[l];
        double least = 1e-13 * (now > span ? now : span);
        if ((double)pool->attempts[m] > (double)p->attempts + span / g->bound[l] || pool->allowed[m] < 0) {
            status[l] = MANY;
        } else if (g->size[l] < least) {
            status[l] = SMALL;
        } else if (g->error[l] < 1.0) {
            taken[l] = -1;
        } else {
            g->wanted[l] = g->size[l] * (g->error[l] < 1e300 && shrink[l] > 0.2 ? shrink[l] : 0.2);
            pool->rejected[m] = INACCURATE;
            int64_t most = pool->steps[m] ? p->refusals : 2 * p->refusals; /* the first size is a guess */
            if (++pool->refused[m] % most == 0 && p->guarded) status[l] = REFUSED;
        }
    }
    return taken;
}

/* Process an accepted step: the next size, the end of an integration interval, the end. */
static int64_t advance_lane(const Problem *p, const Pool *pool, Group *g, int64_t l, double error, int stiff) {
    int64_t m = g->member[l];
    double factor = 5.0;
    if (p->implicit) {
        if (g->growth[l] < factor) factor = g->growth[l];
    } else if (error > 1e-10) {
        double fourth = __builtin_sqrt(__builtin_sqrt(error)), part = 0.9 / (g->brief[l] ? fourth : __builtin_sqrt(fourth));
        if (part < factor) factor = part;
    }
    int64_t before = pool->rejected[m], shortened = before == COARSE || before == AFTER_COARSE;
    if (before && before != AFTER_COARSE && factor > 1.0) factor = 1.0;
    g->wanted[l] = g->size[l] * factor;
    pool->rejected[m] = before == COARSE ? AFTER_COARSE : 0;
    pool->refused[m] = pool->trusted[m] = 0;
    pool->steps[m]++;
    if (pool->known[m] < NODES) pool->known[m]++;
    if (count_stiff(p, pool, m, stiff, shortened)) return STIFF;
    if (g->now[l] < g->end[l] - (g->low[l] - g->begin[l])) return pool->told[m] ? STEPPED : RUNNING;
    int64_t leg = pool->leg[m]++;
    g->now[l] = g->begin[l] = g->end[l];
    pool->attempts[m] = 0;
    if (p->control && p->control->instants[leg] >= 0) {
        p->control->instant[m] = p->control->instants[leg];
        g->due[l] = -1;
    }
    if (leg == pool->last_leg[m]) return DONE;
    pool->known[m] = 1;
    g->fresh[l] = -1;
    bounds(p, g, l, leg + 1);
    if (g->wanted[l] > g->end[l] - g->begin[l]) g->wanted[l] = g->end[l] - g->begin[l];
    return p->leg_jumps[leg] ? JUMP : RUNNING;
}

/* Events: continue from within the step, projected onto the constraints and persistent contacts. */
static void stop(const Problem *p, Group *g, Mask stopped, V until) {
    interpolate(p, g, until, g->work);
    g->work[p->time] = smaller(larger(g->now + until * g->size, g->low), g->high);
    put_on_constraints(p, g, stopped);
    put_on_contacts(p, g, stopped);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(stopped, g->work[i], g->z[i]);
    g->fresh |= stopped;
}

/* Project the new states onto persistent contacts; return lanes where one has come to rest, and its guard. */
static Mask keep_contacts(const Problem *p, Group *g, Mask taken, V reached, int64_t *happened) {
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(reached, g->low), g->high);
    put_on_contacts(p, g, taken);
    Mask stopped = turn_headings(p, g, taken, happened);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(taken & g->touching, g->work[i], g->z[i]);
    g->fresh |= taken & g->touching;
    return stopped;
}

/* Park a lane with an event. */
static int64_t happen(const Pool *pool, Group *g, int64_t l, int64_t happened) {
    int64_t m = g->member[l];
    pool->encounters->happened[m] = happened;
    if (pool->encounters->decides) count_event(pool->encounters, m, g->now[l]);
    pool->rejected[m] = pool->refused[m] = 0;
    pool->steps[m]++;
    return EVENT;
}

enum { OF_DECISION = 2 * MOST_CLOSED }; /* most events that a decision notes */

/* Whether a step might add more event marks than the buffer holds. */
static int noted_many(const Problem *p, const Pool *pool, int64_t m) {
    int64_t noted = pool->encounters->noted[m];
    return noted && noted > pool->encounters->room - SAMPLES * p->contacts->events - OF_DECISION;
}

static void step(const Problem *p, const Pool *pool, Group *g, int64_t *status) {
    choose_sizes(pool, g);
    if (p->implicit)
        attempt_implicit(p, g);
    else
        attempt_all(p, pool, g);
    Mask taken = decide(p, pool, g, status), stiff = {0}, whole = {0};
    if (!p->implicit) {
        stiff = looks_stiff(p, g) & ~g->brief;
        if (p->early) count_refused(p, pool, g, stiff & ~taken, status);
    }
    if (!any(taken)) return;
    if (p->surplus) find_surplus(p, g, g->surplus);
    if (p->equations) find_near(p, g);
    if (p->surplus && p->guarded) {
        Mask astray = strayed(p, g) & taken;
        for (int64_t l = 0; l < LANES; l++) {
            if (!astray[l] || pool->trusted[g->member[l]]) continue;
            taken[l] = 0;
            status[l] = STRAYED;
            g->wanted[l] = g->size[l];
        }
    }
    /* a step of half the size, as at ends of integration intervals, is also accurate between its ends */
    if (!p->implicit) whole = taken & ~g->brief & (g->error > splat(1.0 / 256.0));
    int64_t known = any(whole);
    if (known) {
        interpolant(p, g);
        taken &= ~refuse_coarse(p, pool, g, whole, stiff);
        if (!any(taken)) return;
    }
    V reached = choose(g->size >= g->end - g->now, g->end, g->now + g->size), last = reached;
    double end = p->times[p->instants - 1];
    for (int64_t l = 0; l < LANES; l++) {
        double off = end - last[l], near = 1e-12 * (end > 1.0 ? end : end < -1.0 ? -end : 1.0);
        if (off < near && -off < near) last[l] = end;
    }
    Mask stopped = {0};
    int64_t watched = p->contacts && pool->encounters->watched, happened[LANES];
    V until = splat(1.0);
    if (watched) {
        if (!known) interpolant(p, g);
        known = 1;
        stopped = find_events(p, g, taken, &until, happened);
        reached = choose(stopped, g->now + until * g->size, reached);
        /* an output time that differs from that of an event by rounding is that of the event */
        last = choose(stopped, reached - 1e-13 * larger(splat(1.0), magnitude(reached)), last);
    }
    write_outputs(p, pool, g, taken, last, known);
    if (any(stopped)) stop(p, g, stopped, until);
    accept(p, g, taken & ~stopped, reached);
    if (any(g->touching)) stopped |= keep_contacts(p, g, taken & ~stopped, reached, happened);
    g->now = choose(taken, reached, g->now);
    if (p->guarded) remember(p, g, taken);
    for (int64_t l = 0; l < LANES; l++) {
        if (!taken[l]) continue;
        if (stopped[l])
            status[l] = happen(pool, g, l, happened[l]);
        else
            status[l] = advance_lane(p, pool, g, l, g->error[l], stiff[l] != 0);
    }
    Mask left = stopped;
    if (any(stopped) && pool->encounters->decides == 1) left = decide_events(p, g, stopped, happened);
    for (int64_t l = 0; l < LANES; l++) {
        if (!taken[l] || !watched) continue;
        if (stopped[l] && !left[l]) status[l] = pool->encounters->reports && !g->arming[l] ? STEPPED : RUNNING;
        if (status[l] == RUNNING && noted_many(p, pool, g->member[l])) status[l] = NOTED;
    }
}

int64_t advance(const Problem *p, const Pool *pool, const int64_t *queue, int64_t count, double *workspace,
                int64_t budget) {
    Group g;
    Most most;
    g.most = &most;
    place(p, &g, workspace);
    g.pool = pool;
    g.work[p->time + 1] = splat(0.0);
    int64_t next = 0, running = 0;
    for (int64_t l = 0; l < LANES; l++) {
        while (next < count && pool->status[queue[next]] != RUNNING) next++;
        /* a lane without a member computes something harmless */
        load_lane(p, pool, &g, l, queue[next < count ? next : 0], next < count);
        running += next < count;
        if (next < count) next++;
    }
    while (running) {
        if (g.evaluations >= budget || (p->room && *pool->recorded + LANES > p->room)) {
            for (int64_t l = 0; l < LANES; l++)
                if (g.member[l] >= 0) store_lane(p, pool, &g, l);
            return g.evaluations;
        }
        int64_t status[LANES] = {RUNNING}, lost = 0;
        if (any(g.arming)) {
            for (int64_t l = 0; l < LANES; l++) /* motions begin here */
                if (g.arming[l] && pool->encounters->reports) status[l] = STEPPED;
            arm(p, &g);
        }
        if (any(g.due)) sample(p, pool, &g, status); /* at the start */
        for (int64_t l = 0; l < LANES; l++) lost += status[l] != RUNNING;
        if (!lost) {
            if (any(g.fresh)) start(p, &g);
            step(p, pool, &g, status);
            if (any(g.due)) sample(p, pool, &g, status);
        }
        for (int64_t l = 0; l < LANES; l++) {
            if (status[l] == RUNNING) continue;
            pool->status[g.member[l]] = status[l];
            store_lane(p, pool, &g, l);
            while (next < count && pool->status[queue[next]] != RUNNING) next++;
            if (next < count)
                load_lane(p, pool, &g, l, queue[next++], 1);
            else
                running--;
        }
    }
    return g.evaluations;
}

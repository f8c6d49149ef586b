/* The driver of motions without contacts: functions of decisions.c and waiting.c that are never called. */
#include "group.h"
#include "waiting.h"

enum { MOST_CLOSED = 0 };

static void count_event(const Encounters *e, int64_t m, double now) { (void)e, (void)m, (void)now; }

static void arm(const Problem *p, Group *g) { (void)p, (void)g; }

static Mask decide_events(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    (void)p, (void)g, (void)guards;
    return which;
}

int decide_waiting(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    (void)p, (void)pool, (void)member, (void)workspace;
    return 0;
}

int decide_push(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    return decide_waiting(p, pool, member, workspace);
}

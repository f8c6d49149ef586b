/* Bodies that turn are stepped in angular velocities.

   The rates of a quaternion turn as it does, so that a method of finite order damps or feeds a rotation, however smooth
   its speed is: by the same sign in each step, and unseen by the estimates of its error, since the drift that does it
   leads off the constraint.  So a step is made of y, which is a state x whose rates of quaternions e' are replaced by
   half the angular velocity in the axes of the body:

       y = (e, w),   w = G(e) e' / |e|,   x = (e / |e|, G(e)^T w / |e|).

   G has one row less than the quaternion has entries; the first entry of w is no velocity, and stays zero.  In stages
   quaternions keep the length that they have got, and the equations of motion are evaluated there, as they are at other
   stages off the constraints: e' = G(e)^T w, which is linear, and w' = G(e) e'' / |e|^2.  Were the length taken out in
   stages, the estimates of the error would be too small by far.  Programs, output times, projections and whoever decides
   see states x only. */
#include "group.h"

/* w = G(e) r. */
INLINE void into_axes(int64_t size, const V *e, V *r) {
    if (size == 2) {
        r[1] = e[0] * r[1] - e[1] * r[0];
    } else {
        V a = e[0] * r[1] - e[1] * r[0] + e[3] * r[2] - e[2] * r[3];
        V b = e[0] * r[2] - e[2] * r[0] + e[1] * r[3] - e[3] * r[1];
        V c = e[0] * r[3] - e[3] * r[0] + e[2] * r[1] - e[1] * r[2];
        r[1] = a, r[2] = b, r[3] = c;
    }
    r[0] = splat(0.0);
}

/* r = G(e)^T w. */
INLINE void out_of_axes(int64_t size, const V *e, V *w) {
    if (size == 2) {
        w[0] = -e[1] * w[1];
        w[1] = e[0] * w[1];
        return;
    }
    V a = w[1], b = w[2], c = w[3];
    w[0] = -e[1] * a - e[2] * b - e[3] * c;
    w[1] = e[0] * a - e[3] * b + e[2] * c;
    w[2] = e[3] * a + e[0] * b - e[1] * c;
    w[3] = -e[2] * a + e[1] * b + e[0] * c;
}

INLINE V length_of(int64_t size, const V *e) {
    V sum = e[0] * e[0];
    for (int64_t i = 1; i < size; i++) sum += e[i] * e[i];
    return root(sum);
}

/* Make a state of what is stepped; the lengths that quaternions had are noted. */
static void to_state(const Problem *p, Group *g, V *y) {
    for (int64_t b = 0; b < p->turning; b++) {
        V *e = y + p->turns[b], length = length_of(p->turn, e), inverse = 1.0 / length;
        g->lengths[b] = length;
        g->shrink[b] = splat(1.0);
        for (int64_t i = 0; i < p->turn; i++) e[i] *= inverse;
        out_of_axes(p->turn, e, e + p->velocities);
    }
}

/* Make of what is stepped the stage at which the equations of motion are evaluated. */
static void to_stage(const Problem *p, Group *g, V *y) {
    for (int64_t b = 0; b < p->turning; b++) {
        V *e = y + p->turns[b], length = length_of(p->turn, e);
        g->lengths[b] = splat(1.0);
        g->shrink[b] = 1.0 / (length * length);
        out_of_axes(p->turn, e, e + p->velocities);
    }
}

/* ... and the other way round. */
static void from_state(const Problem *p, V *x) {
    for (int64_t b = 0; b < p->turning; b++) {
        V *e = x + p->turns[b], *w = e + p->velocities, inverse = 1.0 / length_of(p->turn, e);
        into_axes(p->turn, e, w);
        for (int64_t i = 1; i < p->turn; i++) w[i] *= inverse;
    }
}

/* Make the rate of y of that of the state or stage in the work array. */
static void turn_rate(const Problem *p, const Group *g, const V *x, V *rate) {
    for (int64_t b = 0; b < p->turning; b++) {
        int64_t first = p->turns[b];
        for (int64_t i = 0; i < p->turn; i++) rate[first + i] *= g->lengths[b];
        into_axes(p->turn, x + first, rate + p->velocities + first);
        for (int64_t i = 1; i < p->turn; i++) rate[p->velocities + first + i] *= g->shrink[b];
    }
}

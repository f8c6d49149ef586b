#include "program.h"

void run_program(const Program *program, V *work) {
    V *scratch = work + program->scratch;
    for (int64_t s = 0; s < program->count; s++) {
        const Step *step = program->steps + s;
        V *to = work + step->to;
        if (step->method) {
            step->method(step->context, work + step->first, to);
            continue;
        }
        if (!step->code) {
            for (int64_t i = 0; i < step->count; i++) {
                V sum = splat(0.0);
                int64_t term = step->starts[i], end = step->starts[i + 1];
                if (term < end) sum = work[step->reads[term++]];
                for (; term < end; term++) sum += work[step->reads[term]];
                to[i] = sum;
            }
            continue;
        }
        for (int64_t i = 0; i < step->count; i++) {
            const V *arguments = work + step->first + i * step->inputs;
            if (step->reads) {
                const int64_t *reads = step->reads + i * step->inputs;
                for (int64_t j = 0; j < step->inputs; j++) scratch[j] = work[reads[j]];
                arguments = scratch;
            }
            step->code(arguments, to + i * step->outputs);
        }
    }
}

/* Address of the arguments of the next state, and common values of all lanes of a source; null: they differ. */
typedef struct {
    int64_t row, rest;
    const double *held;
} Cursor;

static void begin(Cursor *cursors, const Source *sources, int64_t many, int64_t first) {
    for (int64_t s = 0; s < many; s++) {
        const Source *source = sources + s;
        cursors[s] = (Cursor){first / source->divisor % source->modulus, first % source->divisor, 0};
    }
}

/* Put the arguments of the next `lanes` states into the work array; further lanes are copies of the last. */
static void load(V *work, const Source *sources, Cursor *cursors, int64_t many, int64_t lanes) {
    for (int64_t s = 0; s < many; s++) {
        const Source *source = sources + s;
        Cursor *at = cursors + s;
        const double *from[LANES];
        for (int64_t l = 0; l < lanes; l++) {
            from[l] = source->data + at->row * source->stride;
            if (++at->rest < source->divisor) continue;
            at->rest = 0;
            if (++at->row == source->modulus) at->row = 0;
        }
        for (int64_t l = lanes; l < LANES; l++) from[l] = from[l - 1];
        V *to = work + source->to;
        int same = 1;
        for (int64_t l = 1; l < LANES; l++) same &= from[l] == from[0];
        if (!same) {
            to_lanes(to, from, source->columns);
            at->held = 0;
        } else if (at->held != from[0]) {
            for (int64_t c = 0; c < source->columns; c++) to[c] = splat(from[0][c]);
            at->held = from[0];
        }
    }
}

void evaluate(const Program *program, V *work, const Source *sources, int64_t many, int64_t first, int64_t count,
              const int64_t *rows, int64_t results, double *out) {
    Cursor cursors[SOURCES];
    begin(cursors, sources, many, first);
    for (int64_t k = 0; k < count; k += LANES) {
        int64_t lanes = count - k < LANES ? count - k : LANES, r = 0;
        load(work, sources, cursors, many, lanes);
        run_program(program, work);
        for (; r < results; r += LANES) {
            V found[LANES];
            double *to[LANES];
            int64_t many_rows = results - r < LANES ? results - r : LANES;
            for (int64_t i = 0; i < many_rows; i++) found[i] = work[rows[r + i]];
            for (int64_t l = 0; l < LANES; l++) to[l] = out + (k + l) * results + r;
            to_rows(to, lanes, found, many_rows);
        }
    }
}

/* Let the largest of lanes count for a row of results. */
static void collect(const V *most, int64_t results, double *out) {
    for (int64_t r = 0; r < results; r++)
        for (int64_t l = 0; l < LANES; l++)
            if (most[r][l] > out[r]) out[r] = most[r][l];
}

void largest(const Program *program, V *work, V *most, const Source *sources, int64_t many, int64_t states,
             int64_t count, const int64_t *rows, int64_t results, double *out) {
    Cursor cursors[SOURCES];
    begin(cursors, sources, many, 0);
    for (int64_t first = 0; first < count; first += states) {
        int64_t end = first + states;
        fill(most, 0.0, results);
        for (int64_t k = first; k < end; k += LANES) {
            load(work, sources, cursors, many, end - k < LANES ? end - k : LANES);
            run_program(program, work);
            for (int64_t r = 0; r < results; r++) count_largest(most + r, work[rows[r]]);
        }
        collect(most, results, out + first / states * results);
    }
}

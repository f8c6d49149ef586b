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

/* Put the arguments of states number first .. first + 7 into the work array; those past `end` are copies of the last. */
static void load(V *work, const Source *sources, int64_t many, int64_t first, int64_t end) {
    for (int64_t s = 0; s < many; s++) {
        const Source *source = sources + s;
        const double *from[LANES];
        for (int64_t l = 0; l < LANES; l++) {
            int64_t k = first + l < end ? first + l : end - 1;
            from[l] = source->data + (k / source->divisor) % source->modulus * source->stride;
        }
        V *to = work + source->to;
        int same = 1;
        for (int64_t l = 1; l < LANES; l++) same &= from[l] == from[0];
        if (same) {
            for (int64_t c = 0; c < source->columns; c++) to[c] = splat(from[0][c]);
            continue;
        }
        for (int64_t c = 0; c < source->columns; c++)
            to[c] = (V){from[0][c], from[1][c], from[2][c], from[3][c], from[4][c], from[5][c], from[6][c], from[7][c]};
    }
}

void evaluate(const Program *program, V *work, const Source *sources, int64_t many, int64_t first, int64_t count,
              const int64_t *rows, int64_t results, double *out) {
    int64_t end = first + count;
    for (int64_t k = first; k < end; k += LANES) {
        load(work, sources, many, k, end);
        run_program(program, work);
        int64_t lanes = end - k < LANES ? end - k : LANES;
        for (int64_t r = 0; r < results; r++) {
            V found = work[rows[r]];
            double *to = out + (k - first) * results + r;
            for (int64_t l = 0; l < lanes; l++) to[l * results] = found[l];
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
    for (int64_t first = 0; first < count; first += states) {
        fill(most, 0.0, results);
        for (int64_t k = first; k < first + states; k += LANES) {
            load(work, sources, many, k, first + states);
            run_program(program, work);
            for (int64_t r = 0; r < results; r++) most[r] = larger(magnitude(work[rows[r]]), most[r]);
        }
        collect(most, results, out + first / states * results);
    }
}

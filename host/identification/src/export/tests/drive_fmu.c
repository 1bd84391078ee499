/* Drives an FMU through the functions of FMI 3.0, as a tool does: prints what the model gives at every point of points.h, and fails where a misuse is let pass. */
#include "fmi3Functions.h"
#include "points.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COLUMNS = N + M + P, STATES = 1, RATES = STATES + N, INPUTS = RATES + N, READINGS = INPUTS + M, PARAMETERS = READINGS + Y, ALL = PARAMETERS + P };

static int told;

static void listen(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)status, (void)category, (void)message;
    ++*(int *)environment;
}

static fmi3Instance make(int is_co_simulation) {
    fmi3Instance made = is_co_simulation
        ? fmi3InstantiateCoSimulation("one", TOKEN, NULL, fmi3False, fmi3False, fmi3False, fmi3False, NULL, 0, &told, listen, NULL)
        : fmi3InstantiateModelExchange("one", TOKEN, NULL, fmi3False, fmi3False, &told, listen);
    if (!made) fprintf(stderr, "no instance\n"), exit(1);
    return made;
}

/* What is expected of a call; anything else ends the program with the line. */
#define GIVES(status, call) do { \
    if ((call) != (status)) fprintf(stderr, "line %d: not " #status ": " #call "\n", __LINE__), exit(1); } while (0)
#define OK(call) GIVES(fmi3OK, call)
/* Refused, with a word on it to the tool. */
#define REFUSED(call) do { int before = told; GIVES(fmi3Error, call); \
    if (told == before) fprintf(stderr, "line %d: not a word on " #call "\n", __LINE__), exit(1); } while (0)

static void set(fmi3Instance instance, int first, int count, const double *values) {
    fmi3ValueReference references[ALL];
    for (int i = 0; i < count; ++i) references[i] = first + i;
    OK(fmi3SetFloat64(instance, references, count, values, count));
}

static void get(fmi3Instance instance, int first, int count, double *values) {
    fmi3ValueReference references[ALL];
    for (int i = 0; i < count; ++i) references[i] = first + i;
    OK(fmi3GetFloat64(instance, references, count, values, count));
}

static void show(const double *values, int count) {
    for (int i = 0; i < count; ++i) printf("%.17g ", values[i]);
}

static void begin(fmi3Instance instance, double time) {
    OK(fmi3EnterInitializationMode(instance, fmi3False, 0, time, fmi3False, 0));
    OK(fmi3ExitInitializationMode(instance));
}

static fmi3Status step(fmi3Instance instance, double time, double size) {
    fmi3Boolean needs_events, ends, early;
    double last;
    fmi3Status status = fmi3DoStep(instance, time, size, fmi3True, &needs_events, &ends, &early, &last);
    if (status == fmi3OK && (needs_events || ends || early || last != time + size)) exit(1);
    return status;
}

/* The matrix of derivatives by columns from seeds of one, held against its rows from the other side. */
static void show_slopes(fmi3Instance instance, int first, int rows) {
    static double slopes[(N + Y) * COLUMNS], row[COLUMNS];
    static fmi3ValueReference unknowns[N + Y], knowns[COLUMNS];
    const double one = 1;
    for (int i = 0; i < rows; ++i) unknowns[i] = first + i;
    for (int j = 0; j < N; ++j) knowns[j] = STATES + j;
    for (int j = 0; j < M; ++j) knowns[N + j] = INPUTS + j;
    for (int j = 0; j < P; ++j) knowns[N + M + j] = PARAMETERS + j;
    for (int j = 0; j < COLUMNS; ++j) {
        double column[N + Y];
        OK(fmi3GetDirectionalDerivative(instance, unknowns, rows, knowns + j, 1, &one, 1, column, rows));
        for (int i = 0; i < rows; ++i) slopes[i * COLUMNS + j] = column[i];
    }
    for (int i = 0; i < rows; ++i) {
        OK(fmi3GetAdjointDerivative(instance, unknowns + i, 1, knowns, COLUMNS, &one, 1, row, COLUMNS));
        if (memcmp(row, slopes + i * COLUMNS, sizeof row)) fprintf(stderr, "the adjoint is another matrix\n"), exit(1);
    }
    show(slopes, rows * COLUMNS);
}

static void show_point(const double *v) {
    const double *x = v, *u = v + N, *p = u + M, time = v[COLUMNS];
    double values[ALL], more[N];
    fmi3Boolean flags[5];
    fmi3Instance exchange = make(0), own = make(1);
    /* Model exchange: everything is given in the mode in which a solver gives it. */
    set(exchange, PARAMETERS, P, p);
    begin(exchange, 0);
    OK(fmi3UpdateDiscreteStates(exchange, flags, flags + 1, flags + 2, flags + 3, flags + 4, values));
    OK(fmi3EnterContinuousTimeMode(exchange));
    OK(fmi3SetTime(exchange, time));
    OK(fmi3SetContinuousStates(exchange, x, N));
    set(exchange, INPUTS, M, u);
    OK(fmi3GetContinuousStateDerivatives(exchange, values, N));
    show(values, N);
    get(exchange, RATES, N, more);
    if (memcmp(values, more, sizeof more)) exit(1);
    get(exchange, READINGS, Y, values);
    show(values, Y);
    /* Co-simulation: a step from there. */
    set(own, STATES, N, x);
    set(own, INPUTS, M, u);
    set(own, PARAMETERS, P, p);
    begin(own, time);
    OK(step(own, time, PERIOD));
    get(own, STATES, N, values);
    show(values, N);
    show_slopes(exchange, RATES, N);
    show_slopes(exchange, READINGS, Y);
    OK(fmi3Terminate(exchange));
    fmi3FreeInstance(exchange), fmi3FreeInstance(own);
}

/* A run from rest with the inputs of the points, beside another instance that is driven otherwise. */
static void show_run(void) {
    fmi3Instance own = make(1), other = make(1);
    double x[N], none[M] = {0};
    set(own, PARAMETERS, P, points + N + M);
    begin(own, 0), begin(other, 0);
    for (int k = 0; k < STEPS; ++k) {
        set(own, INPUTS, M, points + k / 20 % COUNT * SIZE + N);
        OK(step(own, k * PERIOD, PERIOD));
        set(other, INPUTS, M, none);
        OK(step(other, k * PERIOD, PERIOD));
        if (k == STEPS / 2) {
            /* Kept, written, read and restored, it goes on as if nothing had been. */
            fmi3FMUState kept = NULL, read = NULL;
            fmi3Byte *bytes;
            size_t size;
            OK(fmi3GetFMUState(own, &kept));
            OK(fmi3SerializedFMUStateSize(own, kept, &size));
            bytes = malloc(size);
            OK(fmi3SerializeFMUState(own, kept, bytes, size));
            OK(fmi3DeserializeFMUState(other, bytes, size, &read));
            bytes[0] ^= 1;
            REFUSED(fmi3DeserializeFMUState(other, bytes, size, &read));
            REFUSED(fmi3DeserializeFMUState(other, bytes, size - 1, &read));
            OK(step(own, (k + 1) * PERIOD, PERIOD));
            OK(fmi3Reset(own));
            OK(fmi3SetFMUState(own, read));
            OK(fmi3FreeFMUState(own, &kept));
            OK(fmi3FreeFMUState(own, &read));
            OK(fmi3FreeFMUState(own, &read));
            free(bytes);
        }
    }
    get(own, STATES, N, x);
    show(x, N);
    fmi3FreeInstance(own), fmi3FreeInstance(other);
}

static void misuse(void) {
    fmi3ValueReference reference = INPUTS, state = STATES, reading = READINGS, none = ALL;
    double value = 0.1, not_a_number = NAN, x[N] = {0}, pair[2];
    int32_t integer = 0;
    fmi3Boolean flags[2];
    fmi3Instance own = make(1), exchange = make(0);
    /* Without an instance, or with another model's token. */
    GIVES(fmi3Error, fmi3Terminate(NULL));
    GIVES(fmi3Error, fmi3GetFloat64(NULL, &reference, 1, &value, 1));
    GIVES(fmi3Error, fmi3GetContinuousStateDerivatives(NULL, x, N));
    GIVES(fmi3Error, step(NULL, 0, PERIOD));
    fmi3FreeInstance(NULL);
    if (fmi3InstantiateModelExchange("one", "another", NULL, fmi3False, fmi3False, NULL, NULL)) exit(1);
    if (fmi3InstantiateCoSimulation("one", TOKEN, NULL, fmi3False, fmi3False, fmi3True, fmi3False, NULL, 0, &told, listen, NULL)) exit(1);
    /* In the wrong order. */
    REFUSED(step(own, 0, PERIOD));
    REFUSED(fmi3ExitInitializationMode(own));
    REFUSED(fmi3GetContinuousStates(exchange, x, N));
    REFUSED(fmi3EnterContinuousTimeMode(exchange));
    OK(fmi3EnterInitializationMode(own, fmi3False, 0, 1, fmi3True, 1 + 3 * PERIOD));
    OK(fmi3ExitInitializationMode(own));
    REFUSED(fmi3EnterInitializationMode(own, fmi3False, 0, 0, fmi3False, 0));
    begin(exchange, 0);
    OK(fmi3EnterContinuousTimeMode(exchange));
    /* Of the other interface. */
    REFUSED(fmi3SetContinuousStates(own, x, N));
    REFUSED(step(exchange, 0, PERIOD));
    REFUSED(fmi3EnterStepMode(own));
    /* Variables: unknown, of another type, not to be set, more or fewer values, no numbers. */
    REFUSED(fmi3GetFloat64(own, &none, 1, &value, 1));
    REFUSED(fmi3SetFloat64(own, &none, 1, &value, 1));
    REFUSED(fmi3GetInt32(own, &reference, 1, &integer, 1));
    OK(fmi3GetInt32(own, NULL, 0, NULL, 0));
    REFUSED(fmi3SetFloat64(own, &reading, 1, &value, 1));
    REFUSED(fmi3SetFloat64(own, &state, 1, &value, 1));
    REFUSED(fmi3SetFloat64(own, &reference, 1, &value, 2));
    REFUSED(fmi3SetFloat64(own, NULL, 1, &value, 1));
    REFUSED(fmi3SetFloat64(own, &reference, 1, &not_a_number, 1));
    REFUSED(fmi3GetDirectionalDerivative(own, &reading, 1, &reading, 1, &value, 1, pair, 1));
    REFUSED(fmi3GetDirectionalDerivative(own, &reading, 1, &reference, 1, &value, 1, pair, 2));
    x[0] = NAN;
    GIVES(fmi3Discard, fmi3SetContinuousStates(exchange, x, N));
    REFUSED(fmi3SetContinuousStates(exchange, x, N + 1));
    REFUSED(fmi3CompletedIntegratorStep(exchange, fmi3True, flags, NULL));
    /* Steps: from elsewhere, backwards, past the end. */
    REFUSED(step(own, 0, PERIOD));
    REFUSED(step(own, 1, -PERIOD));
    REFUSED(step(own, 1, 0));
    REFUSED(step(own, 1, NAN));
    REFUSED(step(own, 1, 4 * PERIOD));
    OK(step(own, 1, 3 * PERIOD));
    /* A result that is no number ends the run; a reset begins another. */
    OK(fmi3Reset(own));
    for (int i = 0; i < N; ++i) x[i] = 1.7e308;
    set(own, STATES, N, x);
    begin(own, 0);
    REFUSED(step(own, 0, 20));
    REFUSED(step(own, 0, PERIOD));
    OK(fmi3Reset(own));
    begin(own, 0);
    OK(step(own, 0, PERIOD));
    fmi3FreeInstance(own), fmi3FreeInstance(exchange);
}

int main(void) {
    if (strcmp(fmi3GetVersion(), "3.0")) return 1;
    for (int k = 0; k < COUNT; ++k) show_point(points + k * SIZE);
    show_run();
    misuse();
    return 0;
}

/* An instance of the model and what the functions of FMI 3.0 share. Nothing of it is global: there may be any number of instances. */
#ifndef FMU_INSTANCE_H
#define FMU_INSTANCE_H

#include "fmi3Functions.h"
#include "fmu_model.h"

/* Which of the two interfaces an instance was made for. */
enum { MODEL_EXCHANGE = 1, CO_SIMULATION = 2, EITHER = 3 };

/* States of the standard's state machine, as members of a set. */
enum {
    INSTANTIATED = 1,
    INITIALIZATION_MODE = 2,
    EVENT_MODE = 4,
    CONTINUOUS_TIME_MODE = 8,
    STEP_MODE = 16,
    TERMINATED = 32,
    /* a step had no finite result: the instance can be reset, given an earlier state, or freed */
    FAILED = 64,
    ANY_MODE = 127,
    INITIALIZED = EVENT_MODE | CONTINUOUS_TIME_MODE | STEP_MODE | TERMINATED
};

enum { COLUMNS = STATES + INPUTS + PARAMETERS, ROWS = STATES + READINGS };

/* What fmi3GetFMUState keeps and fmi3SerializeFMUState writes. */
typedef struct {
    char token[sizeof INSTANTIATION_TOKEN];
    int interface, mode, has_stop_time;
    double time, stop_time;
    /* One parameter more: C has no tables of nothing. */
    double x[STATES], u[INPUTS], p[PARAMETERS + 1];
} Kept;

typedef struct {
    Kept now;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    /* Whether rates and readings, and their derivatives, are those of `now`. */
    int has_values, has_slopes;
    double rates[STATES], readings[READINGS];
    /* Derivatives of rates, then of readings, by rows. */
    double by_x[ROWS * STATES], by_u[ROWS * INPUTS], by_p[ROWS * PARAMETERS + 1];
    /* Where a step ends, before it is known to be finite. */
    double next[STATES];
} Instance;

/* Tells why a function refuses, and is fmi3Error. The instance may be none. */
fmi3Status fmu_refuse(const Instance *instance, const char *function, const char *reason);

/* Whether an instance of one of these interfaces, in one of these modes, may call this function; otherwise tells why not. */
int fmu_admits(const Instance *instance, const char *function, int interfaces, int modes);

/* To be called after a change of `now`. */
void fmu_changed(Instance *instance);

/* Rates and readings at `now`; their derivatives as well. */
void fmu_values(Instance *instance);
void fmu_slopes(Instance *instance);

/* Whether all of these are numbers. */
int fmu_all_finite(const double *values, size_t count);

#endif

/* Instances: made, led through the standard's state machine, kept, restored and freed. */
#include "fmu_instance.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef char the_interface_takes_doubles[sizeof(model_real) == sizeof(double) ? 1 : -1];

static void tell(fmi3LogMessageCallback log, fmi3InstanceEnvironment environment, const char *function, const char *reason) {
    char text[400];
    if (!log) return;
    snprintf(text, sizeof text, "%s: %s", function, reason);
    log(environment, fmi3Error, "logStatusError", text);
}

fmi3Status fmu_refuse(const Instance *instance, const char *function, const char *reason) {
    if (instance) tell(instance->log, instance->environment, function, reason);
    return fmi3Error;
}

static const char *mode_name(int mode) {
    switch (mode) {
    case INSTANTIATED: return "the state Instantiated";
    case INITIALIZATION_MODE: return "Initialization Mode";
    case EVENT_MODE: return "Event Mode";
    case CONTINUOUS_TIME_MODE: return "Continuous-Time Mode";
    case STEP_MODE: return "Step Mode";
    case TERMINATED: return "the state Terminated";
    default: return "the state after an error: reset the instance, or give it an earlier state";
    }
}

int fmu_admits(const Instance *instance, const char *function, int interfaces, int modes) {
    char reason[200];
    if (!instance) return 0;
    if (!(instance->now.interface & interfaces)) {
        fmu_refuse(instance, function, "not a function of the interface that the instance was made for");
        return 0;
    }
    if (!(instance->now.mode & modes)) {
        snprintf(reason, sizeof reason, "not allowed in %s", mode_name(instance->now.mode));
        fmu_refuse(instance, function, reason);
        return 0;
    }
    return 1;
}

void fmu_changed(Instance *instance) {
    instance->has_values = instance->has_slopes = 0;
}

void fmu_values(Instance *instance) {
    const Kept *now = &instance->now;
    if (instance->has_values) return;
    model_rates(now->x, now->u, now->p, now->time, instance->rates);
    model_readings(now->x, now->u, now->p, now->time, instance->readings);
    instance->has_values = 1;
}

void fmu_slopes(Instance *instance) {
    const Kept *now = &instance->now;
    if (instance->has_slopes) return;
    model_rates_jacobian(now->x, now->u, now->p, now->time, instance->rates, instance->by_x, instance->by_u, instance->by_p);
    model_readings_jacobian(now->x, now->u, now->p, now->time, instance->readings, instance->by_x + STATES * STATES,
                            instance->by_u + STATES * INPUTS, instance->by_p + STATES * PARAMETERS);
    instance->has_values = instance->has_slopes = 1;
}

int fmu_all_finite(const double *values, size_t count) {
    for (size_t i = 0; i < count; ++i)
        if (!isfinite(values[i])) return 0;
    return 1;
}

/* At rest at zero, without input, at the calibrated parameters. */
static void start(Kept *now, int interface) {
    memset(now, 0, sizeof *now);
    memcpy(now->token, INSTANTIATION_TOKEN, sizeof now->token);
    now->interface = interface;
    now->mode = INSTANTIATED;
    for (int i = 0; i < PARAMETERS; ++i) now->p[i] = model_calibrated[i];
}

static Instance *instantiate(const char *function, int interface, fmi3String token, fmi3InstanceEnvironment environment,
                             fmi3LogMessageCallback log) {
    if (!token || strcmp(token, INSTANTIATION_TOKEN) != 0) {
        tell(log, environment, function, "the instantiation token is another model's: modelDescription.xml and the binary do not belong together");
        return NULL;
    }
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) {
        tell(log, environment, function, "no memory is left");
        return NULL;
    }
    instance->environment = environment;
    instance->log = log;
    start(&instance->now, interface);
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage) {
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn;
    return instantiate("fmi3InstantiateModelExchange", MODEL_EXCHANGE, instantiationToken, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                         fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate) {
    static const char function[] = "fmi3InstantiateCoSimulation";
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn, (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables, (void)intermediateUpdate;
    if (eventModeUsed || nRequiredIntermediateVariables > 0) {
        tell(logMessage, instanceEnvironment, function, "the model has neither an Event Mode in co-simulation nor intermediate updates");
        return NULL;
    }
    return instantiate(function, CO_SIMULATION, instantiationToken, instanceEnvironment, logMessage);
}

void fmi3FreeInstance(fmi3Instance instance) {
    free(instance);
}

const char *fmi3GetVersion(void) {
    return fmi3Version;
}

/* Errors are always told; there is nothing else to tell. */
fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[]) {
    static const char function[] = "fmi3SetDebugLogging";
    (void)loggingOn;
    if (!fmu_admits(instance, function, EITHER, ANY_MODE)) return fmi3Error;
    if (nCategories && !categories) return fmu_refuse(instance, function, "no categories are given");
    for (size_t i = 0; i < nCategories; ++i)
        if (!categories[i] || strcmp(categories[i], "logStatusError") != 0) return fmu_refuse(instance, function, "the only category is logStatusError");
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    static const char function[] = "fmi3EnterInitializationMode";
    Instance *own = instance;
    (void)toleranceDefined, (void)tolerance;
    if (!fmu_admits(own, function, EITHER, INSTANTIATED)) return fmi3Error;
    if (!isfinite(startTime)) return fmu_refuse(own, function, "the start time is no number");
    if (stopTimeDefined && !(stopTime >= startTime)) return fmu_refuse(own, function, "the stop time is before the start time");
    own->now.time = startTime;
    own->now.has_stop_time = stopTimeDefined;
    own->now.stop_time = stopTimeDefined ? stopTime : 0;
    own->now.mode = INITIALIZATION_MODE;
    fmu_changed(own);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    Instance *own = instance;
    if (!fmu_admits(own, "fmi3ExitInitializationMode", EITHER, INITIALIZATION_MODE)) return fmi3Error;
    own->now.mode = own->now.interface == CO_SIMULATION ? STEP_MODE : EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    Instance *own = instance;
    if (!fmu_admits(own, "fmi3Terminate", EITHER, EVENT_MODE | CONTINUOUS_TIME_MODE | STEP_MODE | FAILED)) return fmi3Error;
    own->now.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    Instance *own = instance;
    if (!fmu_admits(own, "fmi3Reset", EITHER, ANY_MODE)) return fmi3Error;
    start(&own->now, own->now.interface);
    fmu_changed(own);
    return fmi3OK;
}

/* A state that was kept by an instance of this model and this interface. */
static fmi3Status restored(Instance *own, const char *function, const Kept *kept) {
    int modes = own->now.interface == CO_SIMULATION ? ANY_MODE & ~(EVENT_MODE | CONTINUOUS_TIME_MODE) : ANY_MODE & ~STEP_MODE;
    if (memcmp(kept->token, INSTANTIATION_TOKEN, sizeof kept->token) != 0) return fmu_refuse(own, function, "the state is another model's");
    if (kept->interface != own->now.interface) return fmu_refuse(own, function, "the state is one of the other interface");
    if (kept->mode <= 0 || kept->mode & (kept->mode - 1) || !(kept->mode & modes)) return fmu_refuse(own, function, "the state is damaged");
    if (!isfinite(kept->time) || !fmu_all_finite(kept->x, STATES) || !fmu_all_finite(kept->u, INPUTS) || !fmu_all_finite(kept->p, PARAMETERS))
        return fmu_refuse(own, function, "the state holds what is no number");
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    static const char function[] = "fmi3GetFMUState";
    Instance *own = instance;
    if (!fmu_admits(own, function, EITHER, ANY_MODE)) return fmi3Error;
    if (!FMUState) return fmu_refuse(own, function, "no place for the state is given");
    if (!*FMUState) *FMUState = malloc(sizeof(Kept));
    if (!*FMUState) return fmu_refuse(own, function, "no memory is left");
    memcpy(*FMUState, &own->now, sizeof(Kept));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    static const char function[] = "fmi3SetFMUState";
    Instance *own = instance;
    if (!fmu_admits(own, function, EITHER, ANY_MODE)) return fmi3Error;
    if (!FMUState) return fmu_refuse(own, function, "no state is given");
    if (restored(own, function, FMUState) != fmi3OK) return fmi3Error;
    memcpy(&own->now, FMUState, sizeof(Kept));
    fmu_changed(own);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    if (!fmu_admits(instance, "fmi3FreeFMUState", EITHER, ANY_MODE)) return fmi3Error;
    if (FMUState) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    static const char function[] = "fmi3SerializedFMUStateSize";
    if (!fmu_admits(instance, function, EITHER, ANY_MODE)) return fmi3Error;
    if (!FMUState || !size) return fmu_refuse(instance, function, "no state or no place for its size is given");
    *size = sizeof(Kept);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size) {
    static const char function[] = "fmi3SerializeFMUState";
    if (!fmu_admits(instance, function, EITHER, ANY_MODE)) return fmi3Error;
    if (!FMUState || !serializedState) return fmu_refuse(instance, function, "no state or no place for its bytes is given");
    if (size < sizeof(Kept)) return fmu_refuse(instance, function, "fewer bytes than fmi3SerializedFMUStateSize tells");
    memcpy(serializedState, FMUState, sizeof(Kept));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState) {
    static const char function[] = "fmi3DeserializeFMUState";
    Kept kept;
    if (!fmu_admits(instance, function, EITHER, ANY_MODE)) return fmi3Error;
    if (!serializedState || !FMUState) return fmu_refuse(instance, function, "no bytes or no place for the state are given");
    if (size != sizeof kept) return fmu_refuse(instance, function, "another number of bytes than a state has");
    memcpy(&kept, serializedState, sizeof kept);
    if (restored(instance, function, &kept) != fmi3OK) return fmi3Error;
    if (!*FMUState) *FMUState = malloc(sizeof kept);
    if (!*FMUState) return fmu_refuse(instance, function, "no memory is left");
    memcpy(*FMUState, &kept, sizeof kept);
    return fmi3OK;
}

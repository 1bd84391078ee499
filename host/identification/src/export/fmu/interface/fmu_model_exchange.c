/* Model exchange: the tool integrates. There are no events: kinks of the model's laws are found by the tool's control of its steps. */
#include "fmu_instance.h"

#include <math.h>
#include <string.h>

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    Instance *own = instance;
    if (!fmu_admits(own, "fmi3EnterEventMode", MODEL_EXCHANGE, CONTINUOUS_TIME_MODE)) return fmi3Error;
    own->now.mode = EVENT_MODE;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    Instance *own = instance;
    if (!fmu_admits(own, "fmi3EnterContinuousTimeMode", MODEL_EXCHANGE, EVENT_MODE)) return fmi3Error;
    own->now.mode = CONTINUOUS_TIME_MODE;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime) {
    static const char function[] = "fmi3UpdateDiscreteStates";
    if (!fmu_admits(instance, function, MODEL_EXCHANGE, EVENT_MODE)) return fmi3Error;
    if (!discreteStatesNeedUpdate || !terminateSimulation || !nominalsOfContinuousStatesChanged || !valuesOfContinuousStatesChanged ||
        !nextEventTimeDefined || !nextEventTime)
        return fmu_refuse(instance, function, "no place for a result is given");
    *discreteStatesNeedUpdate = *terminateSimulation = *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = *nextEventTimeDefined = fmi3False;
    *nextEventTime = 0;
    return fmi3OK;
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    return fmu_admits(instance, "fmi3EvaluateDiscreteStates", MODEL_EXCHANGE, INITIALIZATION_MODE | EVENT_MODE) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    static const char function[] = "fmi3CompletedIntegratorStep";
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!fmu_admits(instance, function, MODEL_EXCHANGE, CONTINUOUS_TIME_MODE)) return fmi3Error;
    if (!enterEventMode || !terminateSimulation) return fmu_refuse(instance, function, "no place for a result is given");
    *enterEventMode = *terminateSimulation = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    static const char function[] = "fmi3SetTime";
    Instance *own = instance;
    if (!fmu_admits(own, function, MODEL_EXCHANGE, EVENT_MODE | CONTINUOUS_TIME_MODE)) return fmi3Error;
    if (!isfinite(time)) return fmu_refuse(own, function, "the time is no number");
    own->now.time = time;
    fmu_changed(own);
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates) {
    static const char function[] = "fmi3SetContinuousStates";
    Instance *own = instance;
    if (!fmu_admits(own, function, MODEL_EXCHANGE, CONTINUOUS_TIME_MODE)) return fmi3Error;
    if (nContinuousStates != STATES || !continuousStates) return fmu_refuse(own, function, "another number of states than the model has");
    if (!fmu_all_finite(continuousStates, STATES)) {
        fmu_refuse(own, function, "a state is no number");
        return fmi3Discard;
    }
    memcpy(own->now.x, continuousStates, sizeof own->now.x);
    fmu_changed(own);
    return fmi3OK;
}

/* Copies one number for each state. */
static fmi3Status get(Instance *own, const char *function, int modes, const double *from, fmi3Float64 values[], size_t count) {
    if (!fmu_admits(own, function, MODEL_EXCHANGE, modes)) return fmi3Error;
    if (count != STATES || !values) return fmu_refuse(own, function, "another number of states than the model has");
    memcpy(values, from, STATES * sizeof(double));
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates) {
    Instance *own = instance;
    return get(own, "fmi3GetContinuousStates", INITIALIZATION_MODE | INITIALIZED, own ? own->now.x : NULL, continuousStates, nContinuousStates);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates) {
    static const char function[] = "fmi3GetContinuousStateDerivatives";
    Instance *own = instance;
    if (own) fmu_values(own);
    if (get(own, function, INITIALIZATION_MODE | INITIALIZED, own ? own->rates : NULL, derivatives, nContinuousStates) != fmi3OK) return fmi3Error;
    if (!fmu_all_finite(derivatives, STATES)) {
        fmu_refuse(own, function, "a derivative is no number at this state");
        return fmi3Discard;
    }
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates) {
    static const char function[] = "fmi3GetNominalsOfContinuousStates";
    Instance *own = instance;
    if (get(own, function, INITIALIZATION_MODE | INITIALIZED, own ? own->now.x : NULL, nominals, nContinuousStates) != fmi3OK) return fmi3Error;
    for (size_t i = 0; i < STATES; ++i) nominals[i] = 1;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    static const char function[] = "fmi3GetNumberOfContinuousStates";
    if (!fmu_admits(instance, function, MODEL_EXCHANGE, ANY_MODE)) return fmi3Error;
    if (!nContinuousStates) return fmu_refuse(instance, function, "no place for the number is given");
    *nContinuousStates = STATES;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    static const char function[] = "fmi3GetNumberOfEventIndicators";
    if (!fmu_admits(instance, function, MODEL_EXCHANGE, ANY_MODE)) return fmi3Error;
    if (!nEventIndicators) return fmu_refuse(instance, function, "no place for the number is given");
    *nEventIndicators = 0;
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators) {
    static const char function[] = "fmi3GetEventIndicators";
    (void)eventIndicators;
    if (!fmu_admits(instance, function, MODEL_EXCHANGE, INITIALIZATION_MODE | INITIALIZED)) return fmi3Error;
    return nEventIndicators == 0 ? fmi3OK : fmu_refuse(instance, function, "the model has no event indicators");
}

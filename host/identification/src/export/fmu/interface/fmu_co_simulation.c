/* Co-simulation: the estimator's own steps, none longer than the sample period; inputs are held over a communication step. */
#include "fmu_instance.h"

#include <math.h>
#include <string.h>

/* Times that differ by less than this share of a sample period are the same. */
#define SAME_TIME (1e-6 * SAMPLE_PERIOD_S)

/* More steps than this in one communication step are a mistake. */
#define MOST_STEPS 1e9

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    static const char function[] = "fmi3DoStep";
    Instance *own = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!fmu_admits(own, function, CO_SIMULATION, STEP_MODE)) return fmi3Error;
    if (!eventHandlingNeeded || !terminateSimulation || !earlyReturn || !lastSuccessfulTime) return fmu_refuse(own, function, "no place for a result is given");
    Kept *now = &own->now;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = now->time;
    if (!(fabs(currentCommunicationPoint - now->time) <= SAME_TIME)) return fmu_refuse(own, function, "the step does not begin where the last one ended");
    if (!(communicationStepSize > 0) || !isfinite(communicationStepSize)) return fmu_refuse(own, function, "the size of the step is not above zero");
    if (now->has_stop_time && currentCommunicationPoint + communicationStepSize > now->stop_time + SAME_TIME)
        return fmu_refuse(own, function, "the step ends after the stop time");
    /* A communication step of the sample period is one step, however it was rounded. */
    const double steps = fmax(1, ceil(communicationStepSize / SAMPLE_PERIOD_S - 1e-6)), size = communicationStepSize / steps;
    if (steps > MOST_STEPS) return fmu_refuse(own, function, "the step holds more than 1e9 sample periods");
    fmu_changed(own);
    for (double step = 0; step < steps; ++step) {
        const double time = currentCommunicationPoint + step * size;
        model_step(now->x, now->u, now->p, time, size, own->next);
        if (!fmu_all_finite(own->next, STATES)) {
            now->time = *lastSuccessfulTime = time;
            now->mode = FAILED;
            return fmu_refuse(own, function, "a step has no finite result: inputs or parameters are beyond what the model can take");
        }
        memcpy(now->x, own->next, sizeof own->next);
    }
    now->time = *lastSuccessfulTime = currentCommunicationPoint + communicationStepSize;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    if (!fmu_admits(instance, "fmi3EnterStepMode", CO_SIMULATION, 0)) return fmi3Error;
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
    (void)valueReferences, (void)orders, (void)values;
    if (!fmu_admits(instance, "fmi3GetOutputDerivatives", CO_SIMULATION, STEP_MODE | TERMINATED)) return fmi3Error;
    if (nValueReferences == 0 && nValues == 0) return fmi3OK;
    return fmu_refuse(instance, "fmi3GetOutputDerivatives", "derivatives of outputs by the time are not provided");
}

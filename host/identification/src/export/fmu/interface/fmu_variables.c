/* Variables by their references, and their partial derivatives. */
#include "fmu_instance.h"

#include <math.h>

/* The place of a reference among those that begin with `first`; a large number if it is none of them. */
static size_t place_of(fmi3ValueReference reference, size_t first) {
    return reference >= first ? reference - first : (size_t)-1;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
    static const char function[] = "fmi3GetFloat64";
    Instance *own = instance;
    size_t place;
    if (!fmu_admits(own, function, EITHER, ANY_MODE)) return fmi3Error;
    if (nValues != nValueReferences) return fmu_refuse(own, function, "every variable is one number: as many values as references are due");
    if (nValues && (!valueReferences || !values)) return fmu_refuse(own, function, "no references or no place for the values are given");
    for (size_t i = 0; i < nValueReferences; ++i)
        if (valueReferences[i] >= REFERENCES) return fmu_refuse(own, function, "there is no variable of this reference");
    fmu_values(own);
    for (size_t i = 0; i < nValues; ++i) {
        fmi3ValueReference reference = valueReferences[i];
        if (reference == OF_TIME) values[i] = own->now.time;
        else if ((place = place_of(reference, OF_STATES)) < STATES) values[i] = own->now.x[place];
        else if ((place = place_of(reference, OF_RATES)) < STATES) values[i] = own->rates[place];
        else if ((place = place_of(reference, OF_INPUTS)) < INPUTS) values[i] = own->now.u[place];
        else if ((place = place_of(reference, OF_READINGS)) < READINGS) values[i] = own->readings[place];
        else values[i] = own->now.p[place_of(reference, OF_PARAMETERS)];
    }
    if (!fmu_all_finite(values, nValues)) {
        fmu_refuse(own, function, "a value is no number at this state");
        return fmi3Discard;
    }
    return fmi3OK;
}

/* Where a variable is kept, if it may be set now. */
static double *settable(Instance *own, fmi3ValueReference reference) {
    int mode = own->now.mode;
    size_t place;
    if ((place = place_of(reference, OF_INPUTS)) < INPUTS) return &own->now.u[place];
    if ((place = place_of(reference, OF_STATES)) < STATES) return mode & (INSTANTIATED | INITIALIZATION_MODE) ? &own->now.x[place] : NULL;
    if ((place = place_of(reference, OF_PARAMETERS)) < PARAMETERS) return mode & CONTINUOUS_TIME_MODE ? NULL : &own->now.p[place];
    return NULL;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    static const char function[] = "fmi3SetFloat64";
    Instance *own = instance;
    if (!fmu_admits(own, function, EITHER, INSTANTIATED | INITIALIZATION_MODE | EVENT_MODE | CONTINUOUS_TIME_MODE | STEP_MODE)) return fmi3Error;
    if (nValues != nValueReferences) return fmu_refuse(own, function, "every variable is one number: as many values as references are due");
    if (nValues && (!valueReferences || !values)) return fmu_refuse(own, function, "no references or no values are given");
    if (!fmu_all_finite(values, nValues)) return fmu_refuse(own, function, "a value is no number");
    for (size_t i = 0; i < nValues; ++i)
        if (!settable(own, valueReferences[i]))
            return fmu_refuse(own, function, "there is no variable of this reference that may be set now: states until Initialization Mode ends, parameters outside of Continuous-Time Mode, inputs always");
    for (size_t i = 0; i < nValues; ++i) *settable(own, valueReferences[i]) = values[i];
    fmu_changed(own);
    return fmi3OK;
}

/* d unknown / d known; not a number where the pair is none. */
static double slope(const Instance *own, fmi3ValueReference unknown, fmi3ValueReference known) {
    size_t row, column;
    if ((row = place_of(unknown, OF_STATES)) < STATES)
        return (column = place_of(known, OF_STATES)) < STATES ? row == column
             : place_of(known, OF_INPUTS) < INPUTS || place_of(known, OF_PARAMETERS) < PARAMETERS ? 0 : NAN;
    if ((row = place_of(unknown, OF_RATES)) >= STATES) {
        if ((row = place_of(unknown, OF_READINGS)) >= READINGS) return NAN;
        row += STATES;
    }
    if ((column = place_of(known, OF_STATES)) < STATES) return own->by_x[row * STATES + column];
    if ((column = place_of(known, OF_INPUTS)) < INPUTS) return own->by_u[row * INPUTS + column];
    if ((column = place_of(known, OF_PARAMETERS)) < PARAMETERS) return own->by_p[row * PARAMETERS + column];
    return NAN;
}

/* The products of a seed with the matrix of derivatives from the left (adjoint) or from the right (directional). */
static fmi3Status derivative(Instance *own, const char *function, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                             size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity, int is_adjoint) {
    if (!fmu_admits(own, function, EITHER, INITIALIZATION_MODE | INITIALIZED)) return fmi3Error;
    if (nSeed != (is_adjoint ? nUnknowns : nKnowns) || nSensitivity != (is_adjoint ? nKnowns : nUnknowns))
        return fmu_refuse(own, function, "the sizes of seed and sensitivity are not those of the references");
    if ((nUnknowns && !unknowns) || (nKnowns && !knowns) || (nSeed && !seed) || (nSensitivity && !sensitivity))
        return fmu_refuse(own, function, "references, seed or sensitivity are missing");
    fmu_slopes(own);
    for (size_t i = 0; i < nSensitivity; ++i) {
        sensitivity[i] = 0;
        for (size_t j = 0; j < nSeed; ++j) {
            double of_pair = slope(own, unknowns[is_adjoint ? j : i], knowns[is_adjoint ? i : j]);
            if (isnan(of_pair))
                return fmu_refuse(own, function, "no derivative: unknowns are states, their rates and outputs; knowns are states, inputs and parameters");
            sensitivity[i] += of_pair * seed[j];
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    return derivative(instance, "fmi3GetDirectionalDerivative", unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity, 0);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    return derivative(instance, "fmi3GetAdjointDerivative", unknowns, nUnknowns, knowns, nKnowns, seed, nSeed, sensitivity, nSensitivity, 1);
}

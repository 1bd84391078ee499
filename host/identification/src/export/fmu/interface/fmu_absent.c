/* What FMI 3.0 has and this model has not: variables other than Float64, clocks, structural parameters, scheduled execution. */
#include "fmu_instance.h"

static fmi3Status absent(fmi3Instance instance, const char *function, size_t count) {
    if (!fmu_admits(instance, function, EITHER, ANY_MODE)) return fmi3Error;
    return count == 0 ? fmi3OK : fmu_refuse(instance, function, "the model has nothing of this kind: its variables are Float64");
}

#define NO_VARIABLES(type)                                                                                                      \
    fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,         \
                             fmi3##type values[], size_t nValues) {                                                             \
        (void)valueReferences, (void)values;                                                                                    \
        return absent(instance, "fmi3Get" #type, nValueReferences + nValues);                                                   \
    }                                                                                                                           \
    fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,         \
                             const fmi3##type values[], size_t nValues) {                                                       \
        (void)valueReferences, (void)values;                                                                                    \
        return absent(instance, "fmi3Set" #type, nValueReferences + nValues);                                                   \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

/* A function of references and further arguments, none of which is looked at. */
#define NONE_OF_THESE(function, arguments, unused)                                                                              \
    fmi3Status function arguments {                                                                                             \
        (void)valueReferences, unused;                                                                                          \
        return absent(instance, #function, nValueReferences);                                                                   \
    }
#define REFERENCES_OF fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences

NONE_OF_THESE(fmi3GetBinary, (REFERENCES_OF, size_t valueSizes[], fmi3Binary values[], size_t nValues), ((void)valueSizes, (void)values, (void)nValues))
NONE_OF_THESE(fmi3SetBinary, (REFERENCES_OF, const size_t valueSizes[], const fmi3Binary values[], size_t nValues), ((void)valueSizes, (void)values, (void)nValues))
NONE_OF_THESE(fmi3GetClock, (REFERENCES_OF, fmi3Clock values[]), (void)values)
NONE_OF_THESE(fmi3SetClock, (REFERENCES_OF, const fmi3Clock values[]), (void)values)
NONE_OF_THESE(fmi3GetIntervalDecimal, (REFERENCES_OF, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), ((void)intervals, (void)qualifiers))
NONE_OF_THESE(fmi3GetIntervalFraction, (REFERENCES_OF, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]), ((void)counters, (void)resolutions, (void)qualifiers))
NONE_OF_THESE(fmi3GetShiftDecimal, (REFERENCES_OF, fmi3Float64 shifts[]), (void)shifts)
NONE_OF_THESE(fmi3GetShiftFraction, (REFERENCES_OF, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), ((void)counters, (void)resolutions))
NONE_OF_THESE(fmi3SetIntervalDecimal, (REFERENCES_OF, const fmi3Float64 intervals[]), (void)intervals)
NONE_OF_THESE(fmi3SetIntervalFraction, (REFERENCES_OF, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), ((void)counters, (void)resolutions))
NONE_OF_THESE(fmi3SetShiftDecimal, (REFERENCES_OF, const fmi3Float64 shifts[]), (void)shifts)
NONE_OF_THESE(fmi3SetShiftFraction, (REFERENCES_OF, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), ((void)counters, (void)resolutions))

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies) {
    (void)valueReference, (void)nDependencies;
    return absent(instance, "fmi3GetNumberOfVariableDependencies", 1);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies) {
    (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents;
    (void)dependencyKinds, (void)nDependencies;
    return absent(instance, "fmi3GetVariableDependencies", 1);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return absent(instance, "fmi3EnterConfigurationMode", 1);
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return absent(instance, "fmi3ExitConfigurationMode", 1);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
                                               fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                               fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    if (logMessage)
        logMessage(instanceEnvironment, fmi3Error, "logStatusError", "fmi3InstantiateScheduledExecution: the model has co-simulation and model exchange only");
    return NULL;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime) {
    (void)clockReference, (void)activationTime;
    return absent(instance, "fmi3ActivateModelPartition", 1);
}
